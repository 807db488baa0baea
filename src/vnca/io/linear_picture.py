"""Pictures of scene-linear light: OpenEXR, and Radiance (.hdr) with its shared exponent.

Reference: Academy Software Foundation, Technical Introduction to OpenEXR; Ward 1991, Real Pixels,
in Graphics Gems II.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vnca.core import AnyArray, FloatArray
from vnca.core.colour import rec709_from
from vnca.core.errors import BackendUnavailableError, FileFormatError
from vnca.core.files import whole_file

EXR_MAGIC = b"\x76\x2f\x31\x01"
_LARGEST_HALF = 65504.0
_CHANNELS = 4
"""Values a pixel may have on average, all layers together, before the file counts as too large."""
_WHOLE_PICTURE = ("combined", "beauty", "rgba", "rgb", "color", "colour")
"""What renderers call the layer that holds all light."""
HDR_MAGICS = (b"#?RADIANCE", b"#?RGBE")
_SIZE = re.compile(rb"\n(-Y ([0-9]{1,9}) \+X ([0-9]{1,9})|[-+][XY] [0-9]+ [-+][XY] [0-9]+)\n")
_EXPOSURE = re.compile(rb"^EXPOSURE=[ \t]*(\S+)", re.MULTILINE)


def read_exr(path: Path, most_pixels: int) -> tuple[FloatArray, FloatArray | None]:
    """Read a picture as linear RGB of Rec. 709 primaries, and its opacity.

    Of several layers the one that is not named is read, else the one that renderers give all
    light, else the only one. What lies outside the display window is cut off.

    Args:
        path: The file.
        most_pixels: Files whose layers hold more than pictures of so many pixels are refused.

    Returns:
        Premultiplied colour `[row, column, 3]`, unbounded, and opacity `[row, column, 1]`.

    Raises:
        FileFormatError: If it is damaged, too large, or of a kind that is not read.
        BackendUnavailableError: If OpenEXR is not installed.
    """
    library = _library(path, "reading")
    heads = library.File(str(path), header_only=True).parts
    values = sum(_pixels(part.header) * len(part.header["channels"]) for part in heads)
    if values > _CHANNELS * most_pixels:
        raise FileFormatError(
            f"{path}: its layers hold {values} values, more than {_CHANNELS * most_pixels}; "
            "scale it down, or save one layer"
        )
    flat = (library.scanlineimage, library.tiledimage)
    layers = [
        (number, layer)
        for number, part in enumerate(heads)
        if part.header["type"] in flat
        for layer in _layers({channel.name for channel in part.header["channels"]})
    ]
    number, layer = _chosen(path, layers)
    parts = library.File(str(path), separate_channels=True).parts
    if len(parts) < len(heads):  # Those that it cannot read are left out.
        raise FileFormatError(f"{path}: the picture is damaged (its pixels cannot be read)")
    part = parts[number]
    header = part.header
    names = [layer + name for name in "RGB"]
    if names[0] not in part.channels:
        names = [layer + "Y"] * 3
    planes = [_plane(path, part.channels[name]) for name in names]
    alpha = part.channels.get(layer + "A")
    if header.get("pixelAspectRatio", 1.0) != 1.0:
        raise FileFormatError(
            f"{path}: its pixels are not square (ratio {header['pixelAspectRatio']:g}); "
            "resample it first"
        )
    colour = np.stack(planes, -1)
    if "chromaticities" in header:
        colour = (colour @ rec709_from(header["chromaticities"]).T).astype(np.float32)
    shown = _shown(header)
    opacity = None if alpha is None else _plane(path, alpha)[shown][..., None]
    return colour[shown], opacity


def write_exr(path: Path, image: AnyArray) -> None:
    """Write linear RGB, or premultiplied RGBA, as half floats.

    Raises:
        OutputError: If it cannot be written.
        BackendUnavailableError: If OpenEXR is not installed.
    """
    library = _library(path, "writing")
    half = np.clip(image, -_LARGEST_HALF, _LARGEST_HALF).astype(np.float16)
    header = {"compression": library.ZIP_COMPRESSION, "type": library.scanlineimage}
    names = "RGB" if image.shape[2] == 3 else "RGBA"
    with whole_file(path) as temporary:
        library.File(header, {names: np.ascontiguousarray(half)}).write(str(temporary))


def _library(path: Path, doing: str) -> Any:
    try:
        import OpenEXR
    except ImportError as error:
        raise BackendUnavailableError(
            f"{path}: {doing} OpenEXR needs the OpenEXR package: pip install 'vnca[train]'"
        ) from error
    return OpenEXR


def _pixels(header: Mapping[str, Any]) -> int:
    low, high = (np.asarray(corner, np.int64) for corner in header["dataWindow"])
    return int(np.prod((high - low + 1).astype(float)))


def _layers(names: set[str]) -> Iterator[str]:
    """What stands before the channel names of each layer that is a picture."""
    for name in sorted(names):
        before, last = name[:-1], name[-1:]
        if before and not before.endswith("."):
            continue
        if last == "R" and {before + "G", before + "B"} <= names:
            yield before
        if last == "Y" and not {before + "RY", before + "BY"} & names:
            yield before


def _chosen(path: Path, layers: list[tuple[int, str]]) -> tuple[int, str]:
    """The part and the layer that is the picture."""
    for number, layer in layers:
        if not layer:
            return number, layer
    for number, layer in layers:
        if layer.split(".")[-2].lower() in _WHOLE_PICTURE:
            return number, layer
    if len(layers) == 1:
        return layers[0]
    named = ", ".join(layer.rstrip(".") for _, layer in layers)
    raise FileFormatError(
        f"{path}: none of its layers is the picture ({named}); save one alone"
        if layers
        else f"{path}: holds no flat picture of channels R, G and B; save it as one"
    )


def _plane(path: Path, channel: Any) -> FloatArray:
    values = channel.pixels
    if channel.xSampling != 1 or channel.ySampling != 1 or values.dtype.kind != "f":
        raise FileFormatError(
            f"{path}: its channel {channel.name} has no floating-point value at each pixel; "
            "save it as RGB"
        )
    return values.astype(np.float32)


def _shown(header: Mapping[str, Any]) -> tuple[slice, slice]:
    """The rows and columns of what is stored that are to be seen; all, if none are."""
    (left, top), (right, bottom) = (map(int, corner) for corner in header["dataWindow"])
    (first, above), (last, below) = (map(int, corner) for corner in header["displayWindow"])
    rows = slice(max(above - top, 0), min(below, bottom) - top + 1)
    columns = slice(max(first - left, 0), min(last, right) - left + 1)
    if rows.start >= rows.stop or columns.start >= columns.stop:
        return slice(None), slice(None)
    return rows, columns


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
