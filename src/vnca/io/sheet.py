"""Contact sheets: pictures side by side, with captions."""

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from vnca.core.colour import luminance, srgb_to_linear
from vnca.core.errors import OptionError, ShapeError
from vnca.core.typing import AnyArray, FloatArray


def contact_sheet(
    images: Sequence[Sequence[AnyArray | None]],
    captions: Sequence[Sequence[str]] | None = None,
    *,
    gap: int = 8,
    background: tuple[float, float, float] = (1.0, 1.0, 1.0),
    text_height: int = 14,
) -> FloatArray:
    """Lay pictures out in rows and columns.

    Pictures keep their size, centred in a cell as large as the largest of its row and of its
    column. A caption stands below its picture, in black or white, whichever the background
    asks for, and is cut to the width of the cell.

    Args:
        images: Rows of linear RGB pictures `[row, column, 3]`; None leaves a cell empty, and
            rows may be of different lengths.
        captions: One for each picture, or None for a sheet without.
        gap: Pixels around every cell.
        background: Linear RGB.
        text_height: Size of the captions, pixels.

    Returns:
        Linear RGB, `[row, column, 3]`.

    Raises:
        OptionError: If there is no picture, or the captions do not match the pictures.
        ShapeError: If an array is not an RGB picture.
    """
    _check(images, captions)
    cells = [(i, j, image) for i, row in enumerate(images) for j, image in enumerate(row)]
    heights = np.zeros(len(images), int)
    widths = np.zeros(max(len(row) for row in images), int)
    for i, j, image in cells:
        if image is not None:
            heights[i] = max(heights[i], image.shape[0])
            widths[j] = max(widths[j], image.shape[1])
    line = text_height + text_height // 2 if captions else 0
    tops = gap + np.concatenate([[0], np.cumsum(heights + line + gap)])
    lefts = gap + np.concatenate([[0], np.cumsum(widths + gap)])
    sheet = np.empty((tops[-1], lefts[-1], 3), np.float32)
    sheet[:] = background
    for i, j, image in cells:
        if image is not None:
            rows, columns = image.shape[:2]
            top = tops[i] + (heights[i] - rows) // 2
            left = lefts[j] + (widths[j] - columns) // 2
            sheet[top : top + rows, left : left + columns] = image
        if captions:
            top, left = tops[i] + heights[i], lefts[j]
            _write(sheet[top : top + line, left : left + widths[j]], captions[i][j], text_height)
    return sheet


def _write(strip: FloatArray, text: str, height: int) -> None:
    """Write centred text onto a strip of plain background, in place."""
    rows, columns = strip.shape[:2]
    if not columns:
        return
    font = ImageFont.load_default(height)
    text = _shortened(text, font, columns)
    mask = Image.new("L", (columns, rows))
    start = ((columns - font.getlength(text)) / 2, rows - height // 4)
    ImageDraw.Draw(mask).text(start, text, fill=255, font=font, anchor="ls")
    ink = 0.0 if luminance(strip[0, 0]) > 0.18 else 1.0
    # Glyph coverage is meant for encoded values: blended in light, black text looks thin.
    coverage = srgb_to_linear(np.asarray(mask, np.float32)[..., None] / 255)
    strip += (ink - strip) * coverage.astype(np.float32)


def _shortened(text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: int) -> str:
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(text + "…") > width:
        text = text[:-1]
    return text + "…" if text else ""


def _check(
    images: Sequence[Sequence[AnyArray | None]], captions: Sequence[Sequence[str]] | None
) -> None:
    pictures = [image for row in images for image in row if image is not None]
    if not pictures:
        raise OptionError("contact sheet: expected at least one picture, got none")
    for image in pictures:
        if image.ndim != 3 or image.shape[2] != 3 or 0 in image.shape:
            raise ShapeError(f"contact sheet: expected [row, column, 3], got {image.shape}")
    if captions is not None and [len(row) for row in captions] != [len(row) for row in images]:
        raise OptionError("contact sheet: expected one caption for each picture")
