"""Fuzzing of pictures; the checksums of PNG files are put right."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import atheris
import numpy as np
from harness import fuzz

with atheris.instrument_imports(include=["vnca", "PIL"]):
    from PIL import Image

    from vnca.io.image import read_image

_PNG = b"\x89PNG\r\n\x1a\n"
_PIXELS = 2**14


def build(data: bytes) -> bytes:
    """The file as it is, or as a PNG file with checksums that are right."""
    if not data.startswith(_PNG):
        return data
    content, at = bytearray(data), len(_PNG)
    while at + 12 <= len(content):
        (length,) = struct.unpack_from(">I", content, at)
        end = at + 8 + length
        if end + 4 > len(content):
            break
        struct.pack_into(">I", content, end, zlib.crc32(content[at + 4 : end]))
        at = end + 4
    return bytes(content)


def read(path: Path) -> None:
    """Read a picture."""
    image = read_image(path)
    assert image.dtype == np.float32
    assert image.shape[2:] == (3,)


def limit(size: int) -> int:
    """Three floats for each pixel, and the file."""
    return 12 * _PIXELS + size


def seeds() -> Iterator[bytes]:
    """Every format with every kind of pixel that it has."""
    random = np.random.default_rng(0)
    pixels = random.integers(0, 256, (5, 7, 4), dtype=np.uint8)
    for name, modes in {
        "PNG": ("1", "L", "LA", "P", "RGB", "RGBA", "I;16"),
        "JPEG": ("L", "RGB", "CMYK"),
        "WEBP": ("RGB", "RGBA"),
        "TIFF": ("L", "RGB", "CMYK", "F", "I;16"),
        "GIF": ("P",),
        "BMP": ("RGB",),
        "PPM": ("RGB",),
        "JPEG2000": ("RGB",),
    }.items():
        for mode in modes:
            picture = Image.fromarray(pixels)
            picture = (
                picture.convert("L").convert(mode) if mode == "I;16" else picture.convert(mode)
            )
            file = BytesIO()
            picture.save(file, format=name)
            yield file.getvalue()


if __name__ == "__main__":
    Image.MAX_IMAGE_PIXELS = _PIXELS
    fuzz("image", suffix=".png", build=build, read=read, limit=limit, seeds=seeds())
