"""How well a texture is painted and moves, in numbers."""
