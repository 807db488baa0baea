"""Pictures: linear RGB in memory, sRGB in files.

Where there is an alpha channel, colour in memory is premultiplied by it.
"""

import warnings
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageCms, ImageOps

from vnca.colour import linear_to_srgb, srgb_to_linear
from vnca.errors import BackendUnavailableError, FileFormatError, OptionError, ShapeError
from vnca.files import existing_file, whole_file
from vnca.typing import AnyArray, FloatArray

_ENCODERS: dict[str, tuple[str, dict[str, Any]]] = {
    ".png": ("PNG", {}),
    ".jpg": ("JPEG", {"quality": 92, "subsampling": 0}),
    ".jpeg": ("JPEG", {"quality": 92, "subsampling": 0}),
    ".webp": ("WEBP", {"quality": 92, "method": 4}),
}
SUFFIXES = (*_ENCODERS, ".exr")
"""What `write_image` writes."""
FORMATS = ("PNG", "JPEG", "WEBP", "TIFF", "GIF", "BMP", "PPM", "JPEG2000")
"""What is read. Pillow knows more, some of it decoded by other programs (EPS) or hardly tested."""
_LARGEST_HALF = 65504.0


def read_image(path: Path) -> FloatArray:
    """Read a picture (PNG, JPEG, WebP, TIFF, …) upright, as linear RGB.

    Colour profiles are converted to sRGB. Transparent parts are laid over white, as on paper;
    of an animation the first frame is taken. Grey floating-point pictures count as linear.

    Returns:
        `[row, column, 3]`, nominally in [0, 1].

    Raises:
        FileFormatError: If the file is missing, not a picture, damaged, or larger than
            Pillow's limit against decompression bombs (89 million pixels).
    """
    path = existing_file(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            warnings.filterwarnings("ignore", category=UserWarning, module="PIL")
            # From memory: Pillow asks a file for as many bytes as a chunk says it has, and Python
            # makes room for them all before it reads.
            with Image.open(BytesIO(path.read_bytes()), formats=FORMATS) as image:
                return _linear_rgb(ImageOps.exif_transpose(image))
    except Image.UnidentifiedImageError as error:
        raise FileFormatError(
            f"{path}: expected a picture (PNG, JPEG, WebP, TIFF), found something else"
        ) from error
    except (Image.DecompressionBombWarning, Image.DecompressionBombError) as error:
        raise FileFormatError(
            f"{path}: the picture has more than {Image.MAX_IMAGE_PIXELS} pixels; scale it down"
        ) from error
    except MemoryError:
        raise
    except Exception as error:  # Decoders raise whatever a damaged file makes them trip over.
        raise FileFormatError(f"{path}: the picture is damaged ({error})") from error


def write_image(path: Path, image: AnyArray) -> None:
    """Write a picture as PNG, JPEG, WebP (8-bit sRGB) or OpenEXR (linear, half floats).

    PNG and WebP store straight alpha, OpenEXR premultiplied; JPEG, which has none, shows the
    picture over white.

    Args:
        path: The suffix decides the format.
        image: Linear RGB or premultiplied RGBA, `[row, column, 3 | 4]`.

    Raises:
        OptionError: If the suffix is none of these.
        ShapeError: If the array is not a picture.
        OutputError: If the file cannot be written.
        BackendUnavailableError: If OpenEXR is asked for and not installed.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix != ".exr" and suffix not in _ENCODERS:
        raise OptionError(f"{path}: expected a name ending in .png, .jpg, .webp or .exr")
    image = np.asarray(image)
    if image.ndim != 3 or image.shape[2] not in (3, 4) or 0 in image.shape:
        raise ShapeError(f"{path}: expected a picture [row, column, 3 or 4], got {image.shape}")
    if suffix == ".exr":
        _write_exr(path, image)
        return
    name, options = _ENCODERS[suffix]
    pixels = _straight(image, opaque=name == "JPEG")
    with whole_file(path) as temporary:
        Image.fromarray(pixels).save(temporary, format=name, **options)


def to_srgb8(image: ArrayLike) -> NDArray[np.uint8]:
    """Linear light as 8-bit sRGB, clipped to [0, 1]; NaN becomes black."""
    encoded = linear_to_srgb(np.clip(np.nan_to_num(np.asarray(image), posinf=1.0), 0, 1))
    return np.rint(encoded * 255).astype(np.uint8)


def resize(image: AnyArray, rows: int, columns: int) -> FloatArray:
    """Resample a linear picture `[row, column, channel]` with an antialiased Lanczos filter.

    Works in linear light, as an eye far away would average; ringing is clipped to the range
    of each channel.
    """
    if image.ndim != 3:
        raise ShapeError(f"picture to resize: expected [row, column, channel], got {image.shape}")
    if min(rows, columns) < 1:
        raise OptionError(f"picture size: expected at least 1×1 pixels, got {columns}×{rows}")
    image = np.asarray(image, np.float32)
    channels = [
        Image.fromarray(np.ascontiguousarray(image[..., c])).resize(
            (columns, rows), Image.Resampling.LANCZOS
        )
        for c in range(image.shape[2])
    ]
    resized = np.stack([np.asarray(channel) for channel in channels], axis=-1)
    return np.clip(resized, image.min((0, 1)), image.max((0, 1)))


def fit(image: AnyArray, rows: int, columns: int) -> FloatArray:
    """Resize a picture to the largest size of its own proportions inside `rows` × `columns`."""
    scale = min(rows / image.shape[0], columns / image.shape[1])
    return resize(
        image,
        min(rows, max(1, round(image.shape[0] * scale))),
        min(columns, max(1, round(image.shape[1] * scale))),
    )


def _linear_rgb(image: Image.Image) -> FloatArray:
    if image.mode == "F":
        return np.stack([np.asarray(image, np.float32)] * 3, axis=-1)
    if image.mode.startswith("I"):  # 16 bits of grey; Pillow widens some of them to 32.
        grey = srgb_to_linear(np.asarray(image).astype(np.float32) / 65535)
        return np.stack([grey] * 3, axis=-1)
    pixels = np.asarray(_in_srgb(image).convert("RGBA"))
    # A table, because a large picture in floats several times over would fill the memory.
    linear = srgb_to_linear(np.arange(256, dtype=np.float32) / 255).astype(np.float32)
    colour = linear[pixels[..., :3]]
    if (pixels[..., 3] == 255).all():
        return colour
    alpha = pixels[..., 3:].astype(np.float32) / 255
    return (colour * alpha + (1 - alpha)).astype(np.float32, copy=False)


def _in_srgb(image: Image.Image) -> Image.Image:
    """The picture without its colour profile, converted if it has one that fits it."""
    profile = image.info.get("icc_profile")
    if not profile or image.mode not in ("L", "RGB", "RGBA", "CMYK"):
        return image
    mode = "RGBA" if image.mode == "RGBA" else "RGB"
    try:
        converted = ImageCms.profileToProfile(
            image, ImageCms.ImageCmsProfile(BytesIO(profile)), ImageCms.createProfile("sRGB"),
            outputMode=mode,
        )  # fmt: skip
    except (ImageCms.PyCMSError, OSError):  # A broken or foreign profile: as if it were not there.
        return image
    return converted or image


def _straight(image: AnyArray, *, opaque: bool) -> NDArray[np.uint8]:
    """8-bit sRGB, with straight alpha where there is alpha and `opaque` does not forbid it."""
    if image.shape[2] == 3:
        return to_srgb8(image)
    colour, alpha = image[..., :3], np.clip(np.nan_to_num(image[..., 3:]), 0, 1)
    if opaque:
        return to_srgb8(colour + (1 - alpha))
    colour = to_srgb8(colour / np.where(alpha > 0, alpha, 1))
    return np.concatenate([colour, np.rint(alpha * 255).astype(np.uint8)], axis=-1)


def _write_exr(path: Path, image: AnyArray) -> None:
    try:
        import OpenEXR
    except ImportError as error:
        raise BackendUnavailableError(
            f"{path}: writing OpenEXR needs the OpenEXR package: pip install 'vnca[train]'"
        ) from error
    half = np.clip(image, -_LARGEST_HALF, _LARGEST_HALF).astype(np.float16)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    names = "RGB" if image.shape[2] == 3 else "RGBA"
    with whole_file(path) as temporary:
        OpenEXR.File(header, {names: np.ascontiguousarray(half)}).write(str(temporary))
