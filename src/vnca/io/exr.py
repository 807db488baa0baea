"""OpenEXR pictures: scene-linear light.

Reference: Academy Software Foundation, Technical Introduction to OpenEXR.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vnca.colour import rec709_from
from vnca.errors import BackendUnavailableError, FileFormatError
from vnca.files import whole_file
from vnca.typing import AnyArray, FloatArray

MAGIC = b"\x76\x2f\x31\x01"
_LARGEST_HALF = 65504.0
_CHANNELS = 4
"""Values a pixel may have on average, all layers together, before the file counts as too large."""
_WHOLE_PICTURE = ("combined", "beauty", "rgba", "rgb", "color", "colour")
"""What renderers call the layer that holds all light."""


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
