"""What both halves of the gallery are made with: pictures, their textures, the command line."""

import sys
from pathlib import Path

import pictures

from vnca.cli import main as vnca

HERE = Path(__file__).parent


def drawn(work: Path) -> dict[str, Path]:
    """Our own pictures by name, drawn to a folder unless they are there."""
    files = {name: work / f"{name}.png" for name in pictures.PICTURES}
    if not all(file.exists() for file in files.values()):
        pictures.main(str(work))
    return files


def texture_of(picture: Path, work: Path) -> Path:
    """The run of a solid texture of a picture."""
    run = work / f"texture_{picture.stem}"
    made(run / "model.safetensors", "texture", "train", picture, "--out", run)
    return run


def made(target: Path, *arguments: object) -> Path:
    """A file that a subcommand makes unless it is there; ends with its exit code if it cannot."""
    if not target.exists() and (code := vnca([str(argument) for argument in arguments])):
        sys.exit(code)
    return target
