"""`vnca styles`: the library of styles that come with the package."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from vnca.cli.options import parse, print_json
from vnca.cli.terminal import made
from vnca.core.colour import srgb_to_linear
from vnca.core.files import writable_file
from vnca.core.typing import FloatArray
from vnca.io.film import contact_sheet
from vnca.io.picture import fit, write_image
from vnca.rule.library import load_style, style_names, style_thumbnail

SIZE = 160
"""Rows and columns of a picture on the sheet, pixels."""
COLUMNS = 3
"""Styles in a row of the sheet."""


@dataclass(frozen=True)
class Styles:
    """List the styles that paint without training: vnca paint SMOKE --style NAME --out DIR."""

    sheet: Path | None = None
    """A picture of all of them to write: each picture, and smoke painted in its style."""
    json: bool = False
    """Print JSON."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and list the styles.

    Raises:
        VncaError: If the sheet cannot be written.
    """
    options = parse("styles", Styles, arguments)
    named = {name: load_style(name) for name in style_names()}
    if options.sheet is not None:
        writable_file(options.sheet)
    if options.json:
        print_json({name: model.training for name, model in named.items()})
    else:
        for name, model in named.items():
            print(f"{name:16}{model.training.get('title', '')}")
    if options.sheet is not None:
        pairs = [(_linear(named[name].style), _painted(name)) for name in named]
        rows = [pairs[start : start + COLUMNS] for start in range(0, len(pairs), COLUMNS)]
        empty = np.ones((SIZE, SIZE, 3), np.float32)
        rows[-1] += [(empty, empty)] * (COLUMNS - len(rows[-1]))
        write_image(
            options.sheet, contact_sheet([[p for pair in row for p in pair] for row in rows])
        )
        made("sheet", options.sheet)


def _linear(picture: np.ndarray | None) -> FloatArray:
    assert picture is not None, "a style of the library has its picture"
    return fit(srgb_to_linear(picture / np.float32(255)), SIZE, SIZE)


def _painted(name: str) -> FloatArray:
    with Image.open(io.BytesIO(style_thumbnail(name))) as image:
        return _linear(np.asarray(image.convert("RGB")))
