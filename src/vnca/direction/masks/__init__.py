"""Where a value holds: grids of files, shapes, pictures, meshes."""
