"""What `vnca` does from files to files: train, texture, stylize, render, evaluate, simulate."""
