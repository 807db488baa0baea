"""Pictures to train styles on that are nobody else's: each is drawn here, from a seed.

Run `python benchmarks/styles/pictures.py OUT_FOLDER`, with `--only ink frost` for some of them.
Each repeats without a seam and has marks some hundredths of its side wide.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from fields import Field
from lines import circuit, engraving, frost, fur, threads
from numpy.random import Generator
from PIL import Image
from surfaces import embers, ink, marble, mosaic, rust, stained_glass, watercolour, woodcut

SMALLEST = 64  # Below, the finest lines are narrower than a pixel.
PICTURES: dict[str, Callable[[Generator, int], Field]] = {
    "ink": ink,
    "embers": embers,
    "marble": marble,
    "stained_glass": stained_glass,
    "threads": threads,
    "woodcut": woodcut,
    "watercolour": watercolour,
    "mosaic": mosaic,
    "fur": fur,
    "engraving": engraving,
    "rust": rust,
    "frost": frost,
    "circuit": circuit,
}


def draw(name: str, side: int = 640) -> Image.Image:
    """The picture, `side` pixels wide and high, drawn twice as large; the same at every call."""
    if side < SMALLEST:
        raise ValueError(f"{name}: a side of {side} pixels, but {SMALLEST} are the fewest")
    seed = int.from_bytes(name.encode()[:8], "big")
    fine = PICTURES[name](np.random.default_rng(seed), 2 * side)
    pixels = np.clip(fine, 0, 1).reshape(side, 2, side, 2, 3).mean((1, 3))
    return Image.fromarray((255 * pixels + 0.5).astype(np.uint8))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="a folder")
    parser.add_argument("--only", nargs="+", choices=PICTURES, default=list(PICTURES))
    parser.add_argument("--side", type=int, default=640, help="pixels")
    options = parser.parse_args()
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        for name in options.only:
            draw(name, options.side).save(options.out / f"{name}.png")
            print(options.out / f"{name}.png")
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
