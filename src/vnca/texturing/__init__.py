"""Solid textures for meshes: train a rule on slices of a block, grow a block, put it on a mesh."""
