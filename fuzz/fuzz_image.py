"""Fuzzing of pictures; the checksums of PNG files are put right.

OpenEXR and most codecs are native code that is not instrumented: of them only what ends the
process, or takes too much, is found.
"""

import shutil
import struct
import tempfile
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import atheris
import cv2
import numpy as np
import OpenEXR
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
    """Three floats for each pixel, or what layers may hold, and the file."""
    return 16 * _PIXELS + size


def seeds() -> Iterator[bytes]:
    """Every format with every kind of pixel that it has."""
    random = np.random.default_rng(0)
    pixels = random.integers(0, 256, (8, 9, 4), dtype=np.uint8)
    for name, modes in {
        "PNG": ("1", "L", "LA", "P", "RGB", "RGBA", "I;16"),
        "JPEG": ("L", "RGB", "CMYK"),
        "WEBP": ("RGB", "RGBA"),
        "TIFF": ("L", "RGB", "CMYK", "F", "I;16"),
        "GIF": ("P",),
        "BMP": ("RGB",),
        "PPM": ("RGB",),
        "JPEG2000": ("RGB",),
        "AVIF": ("RGB", "RGBA"),
        "TGA": ("L", "P", "RGB", "RGBA"),
    }.items():
        for mode in modes:
            picture = Image.fromarray(pixels)
            if mode == "F":
                picture = Image.fromarray(pixels[..., 0].astype(np.float32) / 255)
            elif mode == "I;16":
                picture = picture.convert("L")
            picture = picture.convert(mode)
            file = BytesIO()
            picture.save(file, format=name)
            yield file.getvalue()
    light = np.ascontiguousarray(pixels.astype(np.float32) / 255)
    yield cv2.imencode(".hdr", light[..., :3])[1].tobytes()
    yield from _exr_seeds(light)


def _exr_seeds(light: np.ndarray) -> Iterator[bytes]:
    layers = {f"{layer}.{name}": light[..., i].copy() for i, name in enumerate("RGBA")
              for layer in ("Combined", "b")}  # fmt: skip
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = 4
    cases = (
        ({"RGB": light[..., :3].copy()}, {"compression": OpenEXR.NO_COMPRESSION}),
        ({"RGBA": light.astype(np.float16)}, {"compression": OpenEXR.PIZ_COMPRESSION}),
        (layers, {"chromaticities": (0.7, 0.3, 0.2, 0.8, 0.1, 0.05, 0.32, 0.34)}),
        ({"Y": light[..., 0].copy()}, {"type": OpenEXR.tiledimage, "tiles": tiles}),
    )
    for channels, header in cases:
        file = Path(tempfile.mkdtemp()) / "seed.exr"
        OpenEXR.File({"type": OpenEXR.scanlineimage, **header}, channels).write(str(file))
        yield file.read_bytes()
        shutil.rmtree(file.parent)


if __name__ == "__main__":
    Image.MAX_IMAGE_PIXELS = _PIXELS
    fuzz("image", suffix=".png", build=build, read=read, limit=limit, seeds=seeds())
