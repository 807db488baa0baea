"""Makes the texture half of the gallery: a film a picture and mesh, and a sheet of them all.

    python docs/gallery/textures.py WORK

Draws the pictures, trains a texture on each, bakes it on the bunny and the knot and films them
turning. Pictures, runs and meshes go to the folder WORK; those that are there are not made again.
Films and sheet go to `textures/`, beside this file.
"""

import sys
from pathlib import Path

import knot
from workshop import HERE, drawn, made, texture_of

from vnca.core import FloatArray
from vnca.io.film import contact_sheet
from vnca.io.mesh import read_mesh
from vnca.io.picture import fit, read_image, write_image
from vnca.meshes.turntable import Turntable, TurntableConfig, textured

FILMS = HERE / "textures"
FILM = ("--rows", 200, "--columns", 200, "--frames", 36, "--fps", 12)
SIZE = 240
"""Rows and columns of a picture in the sheet."""
AZIMUTHS = (0.0, 150.0)


def main(folder: str) -> None:
    """Make what is missing, then the sheet."""
    work = Path(folder)
    for sub in (work, FILMS):
        sub.mkdir(parents=True, exist_ok=True)
    knot.main(str(work / "knot.obj"))
    meshes = {"bunny": HERE / "stanford_bunny.obj", "knot": work / "knot.obj"}
    rows = []
    for name, picture in drawn(work).items():
        run = texture_of(picture, work)
        row = [fit(read_image(picture), SIZE, SIZE)]
        for mesh, source in meshes.items():
            baked, film = work / f"{name}_{mesh}.glb", FILMS / f"{name}_{mesh}.webp"
            made(baked, "texture", "bake", run, source, "--out", baked, "--block", 96)
            made(film, "texture", "turntable", baked, "--out", film, *FILM)
            row += preview_views(baked)
        rows.append(row)
    write_image(FILMS / "sheet.jpg", contact_sheet(rows, background=(0.9, 0.9, 0.9)))


def preview_views(baked: Path) -> list[FloatArray]:
    """A textured mesh from two sides."""
    mesh = read_mesh(baked)
    sides = [TurntableConfig(rows=SIZE, columns=SIZE, azimuth=azimuth) for azimuth in AZIMUTHS]
    tables = [Turntable(mesh, side) for side in sides]
    return [table.picture(0, textured(table, mesh)) for table in tables]


if __name__ == "__main__":
    main(sys.argv[1])
