"""Makes `textures.jpg`: a row a texture, the picture and every mesh that wears it from two sides.

    python docs/images/textures.py OUT STYLE GLB[,GLB...] [STYLE GLB[,GLB...] ...]

STYLE is a picture, each GLB a mesh that `vnca texture bake` gave a texture learned from it.
"""

import sys
from pathlib import Path

from vnca.io.image import fit, read_image, write_image
from vnca.io.mesh import read_mesh
from vnca.io.sheet import contact_sheet
from vnca.texturing.turntable import Turntable, TurntableConfig, textured

SIZE = 240
AZIMUTHS = (0.0, 150.0)


def main(out: str, *pairs: str) -> None:
    """Write the sheet."""
    rows = []
    for style, meshes in zip(pairs[::2], pairs[1::2], strict=True):
        row = [fit(read_image(Path(style)), SIZE, SIZE)]
        for mesh in (read_mesh(Path(name), None) for name in meshes.split(",")):
            for azimuth in AZIMUTHS:
                table = Turntable(mesh, TurntableConfig(rows=SIZE, columns=SIZE, azimuth=azimuth))
                row.append(table.picture(0, textured(table, mesh)))
        rows.append(row)
    write_image(Path(out), contact_sheet(rows, background=(0.9, 0.9, 0.9)))


if __name__ == "__main__":
    main(*sys.argv[1:])
