"""Cells of a grid as bricks of 8³, kept only where there is something."""
