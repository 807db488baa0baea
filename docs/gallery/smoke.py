"""Makes the smoke half of the gallery: a film a picture and scene.

    python docs/gallery/smoke.py WORK

Simulates a plume, jets and a ring. For each of eight pictures, trains a solid texture and then,
beginning with it, a rule on one frame of the plume; paints and films all three scenes with that
rule: two of them it never saw. What is in the folder WORK already is not made again. Films go to
`smoke/`, beside this file, each picture with them, small.
"""

import sys
from importlib.resources import as_file, files
from pathlib import Path

from workshop import HERE, drawn, made, texture_of

from vnca.io.picture import fit, read_image, write_image

FILMS = HERE / "smoke"
SCENES = {"plume": (64, 40), "jets": (64, 40), "ring": (64, 40)}
"""Cells across a scene, and frames."""
TRAINED = "plume_0030.vdb"
TRAINING = (
    *("--preset", "standard", "--iterations", 500, "--no-winds"),
    *("--hidden", 96, "--appearance.style-scale", 1.2),
)
"""The rule is as large as the texture it begins with, and so are patterns, in cells."""
PAINTINGS = ("vangogh_church_auvers", "vangogh_harvest")
THUMBNAIL = 200
"""Rows and columns of the picture beside its films."""
FILM = ("--rows", 200, "--columns", 200, "--film-fps", 12, "--background", "#3c3c42")


def main(folder: str) -> None:
    """Make what is missing."""
    work = Path(folder)
    for sub in (work, FILMS):
        sub.mkdir(parents=True, exist_ok=True)
    for scene, (cells, frames) in SCENES.items():
        smoke = work / scene
        last = smoke / f"{scene}_{frames:04d}.vdb"
        size = ("--resolution", cells, "--frames", frames)
        made(last, "simulate", scene, "--out", smoke, *size)
    with as_file(files("vnca.data") / "vangogh_cafe_terrace.webp") as terrace:
        paintings = [terrace, *(HERE / f"{name}.webp" for name in PAINTINGS)]
        for picture in [*drawn(work).values(), *paintings]:
            films_of(picture, work)


def films_of(picture: Path, work: Path) -> None:
    """Train on the plume, paint all scenes."""
    name = picture.stem
    write_image(FILMS / f"{name}.webp", fit(read_image(picture), THUMBNAIL, THUMBNAIL))
    run = work / f"smoke_{name}"
    how = ("--init", texture_of(picture, work), *TRAINING)
    made(run / "model.safetensors", "train", work / "plume" / TRAINED, picture, "--out", run, *how)
    for scene, (_, frames) in SCENES.items():
        painted, film = work / f"{name}_{scene}", FILMS / f"{name}_{scene}.webp"
        last = painted / f"{scene}_{frames:04d}.vdb"
        some = ("--frames", f"{frames // 4}-{frames}")
        again = ("--resume", "--overwrite")
        made(last, "stylize", run, work / scene, "--out", painted, "--refine", 2, *again, *some)
        made(film, "render", painted, "--out", film, *FILM)


if __name__ == "__main__":
    main(sys.argv[1])
