"""Meshes in and out."""
