"""Radiance pictures (.hdr): scene-linear light with a shared exponent.

Reference: Ward 1991, Real Pixels, in Graphics Gems II.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vnca.errors import FileFormatError
from vnca.typing import FloatArray

MAGICS = (b"#?RADIANCE", b"#?RGBE")
_SIZE = re.compile(rb"\n(-Y ([0-9]{1,9}) \+X ([0-9]{1,9})|[-+][XY] [0-9]+ [-+][XY] [0-9]+)\n")
_EXPOSURE = re.compile(rb"^EXPOSURE=[ \t]*(\S+)", re.MULTILINE)


def read_hdr(path: Path, data: bytes, most_pixels: int) -> FloatArray:
    """Read a picture as linear RGB `[row, column, 3]`, unbounded.

    Args:
        path: For messages.
        data: The bytes of the file.
        most_pixels: Larger pictures are refused.

    Raises:
        FileFormatError: If it is too large, or of a kind that is not read.
        ValueError: If it is damaged.
    """
    size = _SIZE.search(data)
    if size is None:
        raise ValueError("it does not tell its size")
    head = data[: size.start()]
    if size[2] is None or b"FORMAT=32-bit_rle_xyze" in head:
        raise FileFormatError(
            f"{path}: its pixels are turned, or are XYZ; save it upright, as RGB or OpenEXR"
        )
    rows, columns = int(size[2]), int(size[3])
    if rows * columns > most_pixels:
        raise FileFormatError(
            f"{path}: the picture has more than {most_pixels} pixels; scale it down"
        )
    pixels = _unpacked(data, size.end(), rows, columns)
    # The fourth byte is the exponent, of 2⁻¹²⁸ and more, of the others as parts of 256; 0 is black.
    scale = np.where(
        pixels[..., 3:] > 0, np.ldexp(np.float32(1), pixels[..., 3:].astype(int) - 136), 0
    )
    exposure = np.prod([float(value) for value in _EXPOSURE.findall(head)])
    return (pixels[..., :3] * scale / np.float32(exposure)).astype(np.float32)


def _unpacked(data: bytes, at: int, rows: int, columns: int) -> NDArray[np.uint8]:
    """The bytes `[row, column, 4]` of pixels that are stored from `at` on."""
    if not (8 <= columns < 2**15 and data[at : at + 2] == b"\2\2"):
        if len(data) - at < 4 * rows * columns:
            raise ValueError("it is cut off")
        return np.frombuffer(data, np.uint8, 4 * rows * columns, at).reshape(rows, columns, 4)
    plain = bytearray()
    for row in range(1, rows + 1):
        if data[at : at + 4] != b"\2\2" + columns.to_bytes(2, "big"):
            raise ValueError("a row of it does not begin as it should")
        at += 4
        end = 4 * row * columns
        # Its four bytes are stored one after the other, for all of the row: runs of a byte, whose
        # length has 128 added, and stretches of bytes.
        while len(plain) < end:
            length = data[at]
            if length > 128:
                plain += data[at + 1 : at + 2] * (length - 128)
                at += 2
            else:
                plain += data[at + 1 : at + 1 + length]
                at += 1 + length
            if not length or at > len(data) or len(plain) > end:
                raise ValueError("a row of it is not as long as the others")
    return np.frombuffer(plain, np.uint8).reshape(rows, 4, columns).transpose(0, 2, 1)
