"""Radiance pictures (.hdr): scene-linear light with a shared exponent.

Reference: Ward 1991, Real Pixels, in Graphics Gems II.
"""

import re
from pathlib import Path

import numpy as np

from vnca.errors import BackendUnavailableError, FileFormatError
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
        FileFormatError: If it is damaged, too large, or of a kind that is not read.
        BackendUnavailableError: If OpenCV is not installed.
    """
    size = _SIZE.search(data)
    if size is None:
        raise FileFormatError(f"{path}: the picture is damaged (it does not tell its size)")
    head = data[: size.start()]
    if size[2] is None or b"FORMAT=32-bit_rle_xyze" in head:
        raise FileFormatError(
            f"{path}: its pixels are turned, or are XYZ; save it upright, as RGB or OpenEXR"
        )
    if int(size[2]) * int(size[3]) > most_pixels:
        raise FileFormatError(
            f"{path}: the picture has more than {most_pixels} pixels; scale it down"
        )
    try:
        import cv2
    except ImportError as error:
        raise BackendUnavailableError(
            f"{path}: reading Radiance pictures needs OpenCV: pip install 'vnca[evaluate]'; "
            "or save it as OpenEXR"
        ) from error
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
    if pixels is None or pixels.dtype != np.float32:
        raise FileFormatError(f"{path}: the picture is damaged (its pixels cannot be read)")
    exposure = np.prod([float(value) for value in _EXPOSURE.findall(head)])
    return (pixels[..., ::-1] / exposure).astype(np.float32)
