"""A small smoke solver and scenes for demos and tests."""
