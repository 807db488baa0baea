"""Meshes: unwrapping, rasterising, baking, turning."""
