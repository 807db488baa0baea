"""Pictures: linear RGB in memory, sRGB in files.

Where there is an alpha channel, colour in memory is premultiplied by it.
"""

import os
import re
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageCms, ImageOps

from vnca.core import AnyArray, FloatArray
from vnca.core.colour import linear_to_srgb, luminance, srgb_to_linear
from vnca.core.errors import FileFormatError, OptionError, ShapeError, VncaError
from vnca.core.files import existing_file, whole_file
from vnca.io.linear_picture import EXR_MAGIC, HDR_MAGICS, read_exr, read_hdr, write_exr

_ENCODERS: dict[str, tuple[str, dict[str, Any]]] = {
    ".png": ("PNG", {}),
    ".jpg": ("JPEG", {"quality": 92, "subsampling": 0}),
    ".jpeg": ("JPEG", {"quality": 92, "subsampling": 0}),
    ".webp": ("WEBP", {"quality": 92, "method": 4}),
}
SUFFIXES = (*_ENCODERS, ".exr")
"""What `write_image` writes."""
FORMATS = ("PNG", "JPEG", "WEBP", "TIFF", "GIF", "BMP", "PPM", "JPEG2000", "AVIF")
"""What Pillow reads for us. It knows more, some of it decoded by other programs (EPS) or hardly
tested."""
_READ = "PNG, JPEG, WebP, AVIF, TIFF, GIF, BMP, PPM, JPEG 2000, TGA, OpenEXR, Radiance HDR"
_KINDS = (
    (rb"\x89PNG|\xff\xd8\xff|GIF8", "a picture that is damaged"),
    (rb"....ftypavi[fs]", "AVIF that is damaged, or that this Pillow was built without"),
    (rb"II\*\0|MM\0\*|II\+\0|MM\0\+", "TIFF of a kind that is not read"),
    (rb"8BPS", "a Photoshop document"),
    (rb"gimp xcf", "a GIMP document"),
    (rb"PK\x03\x04", "an archive, or a document in one, such as of Krita"),
    (rb"\xff\x0a|\0\0\0\x0cJXL ", "JPEG XL"),
    (rb"....ftyp(hei[cfmsx]|hev[cmsx]|mif1|msf1)", "HEIC"),
    (rb"....ftyp|\x1aE\xdf\xa3|RIFF....AVI ", "a film"),
    (rb"DDS |\xabKTX", "a texture compressed for graphics cards"),
    (rb"%PDF|%!PS|\xc5\xd0\xd3\xc6", "PDF or PostScript"),
    (rb"\s*<(\?xml|svg)", "SVG or other XML"),
    (rb"(?i)\s*<(!doctype html|html)", "a web page"),
    (rb" BDV\0", "an OpenVDB file"),
    (rb"glTF", "a GLB mesh"),
)
_TGA_END = b"TRUEVISION-XFILE.\0"
# In scene-linear pictures: a stop above white.
_GLARING = 2.0
_SMALLEST_STYLE = 8


def read_image(path: str | Path) -> FloatArray:
    """Read a picture upright, as linear RGB; its content decides the format, not its name.

    PNG, JPEG, WebP, AVIF, TIFF, GIF, BMP, PPM, JPEG 2000, TGA, OpenEXR and Radiance HDR. Colour
    profiles, and primaries that OpenEXR files name, are converted to sRGB's. Transparent parts are
    laid over white, as on paper; of an animation the first frame is taken. OpenEXR, Radiance and
    grey floating-point pictures hold scene-linear light: it is clipped to [0, 1], as a viewer
    shows it at exposure 0, NaN becomes black, and a picture that is mostly glare is refused.

    Returns:
        `[row, column, 3]` in [0, 1].

    Raises:
        FileFormatError: If the file is missing, not a picture, damaged, overexposed, or larger
            than Pillow's limit against decompression bombs (89 million pixels).
        BackendUnavailableError: If the package that the format needs is not installed.
    """
    return _over_white(*_read(Path(path)))


def read_style(path: str | Path) -> FloatArray:
    """Read a picture to learn from: like `read_image`, and there is something in it to learn.

    Raises:
        FileFormatError: If it is transparent, a single colour or tiny; and as `read_image` says.
        BackendUnavailableError: If the package that the format needs is not installed.
    """
    colour, alpha = _read(Path(path))
    if alpha is not None and not alpha.any():
        raise FileFormatError(f"{path}: the picture is fully transparent; nothing can be learned")
    return _with_something_to_learn(_over_white(colour, alpha), str(path))


def style_array(image: ArrayLike) -> FloatArray:
    """An array as a picture to learn from: `[r, c, 3]`, linear RGB from 0 to 1, in float32.

    Raises:
        FileFormatError: If it is none, a single colour or tiny.
    """
    try:
        picture = np.asarray(image, np.float32)
    except (TypeError, ValueError) as error:
        raise FileFormatError(f"`style`: not an array of numbers ({error})") from error
    if picture.ndim != 3 or picture.shape[2] != 3:
        raise FileFormatError(f"`style`: expected an array [r, c, 3], got {list(picture.shape)}")
    if not (picture.size and picture.min() >= 0 and picture.max() <= 1):  # NaN is neither
        raise FileFormatError("`style`: expected linear RGB from 0 to 1; divide bytes by 255 first")
    return _with_something_to_learn(picture, "`style`")


def _with_something_to_learn(shown: FloatArray, what: str) -> FloatArray:
    rows, columns = shown.shape[:2]
    if min(rows, columns) < _SMALLEST_STYLE:
        raise FileFormatError(
            f"{what}: the picture has {columns}×{rows} pixels; to learn from it, "
            f"{_SMALLEST_STYLE}×{_SMALLEST_STYLE} are the least"
        )
    least, greatest = (linear_to_srgb(end) for end in (shown.min((0, 1)), shown.max((0, 1))))
    if (greatest - least).max() < 1.5 / 255:
        raise FileFormatError(f"{what}: the picture is a single colour; nothing can be learned")
    return shown


def kind_of(data: bytes) -> str:
    """What a file seems to be that is no picture we read, in words."""
    return next((kind for start, kind in _KINDS if re.match(start, data, re.DOTALL)),
                "something else")  # fmt: skip


def write_image(path: str | Path, image: AnyArray) -> None:
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
        write_exr(path, image)
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


def _read(path: Path) -> tuple[FloatArray, FloatArray | None]:
    """Premultiplied linear RGB `[row, column, 3]`, and opacity `[row, column, 1]` if there is."""
    path = existing_file(path)
    # From memory: Pillow asks a file for as many bytes as a chunk says it has, and Python makes
    # room for them all before it reads.
    data = path.read_bytes()
    try:
        with _quiet():
            return _decoded(path, data)
    except Image.UnidentifiedImageError as error:
        raise FileFormatError(
            f"{path}: expected a picture ({_READ}), found {kind_of(data)}"
        ) from error
    except (Image.DecompressionBombWarning, Image.DecompressionBombError) as error:
        raise FileFormatError(
            f"{path}: the picture has more than {Image.MAX_IMAGE_PIXELS} pixels; scale it down"
        ) from error
    except (VncaError, MemoryError):
        raise
    except Exception as error:  # Decoders raise whatever a damaged file makes them trip over.
        raise FileFormatError(f"{path}: the picture is damaged ({error})") from error


def _decoded(path: Path, data: bytes) -> tuple[FloatArray, FloatArray | None]:
    most = Image.MAX_IMAGE_PIXELS or 2**63
    if data.startswith(EXR_MAGIC):
        colour, alpha = read_exr(path, most)
        if alpha is not None:
            alpha = np.clip(np.nan_to_num(alpha, nan=0.0), 0, 1)
        return _exposed(path, colour), alpha
    if data.startswith(HDR_MAGICS):
        return _exposed(path, read_hdr(path, data, most)), None
    with warnings.catch_warnings():
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        warnings.filterwarnings("ignore", category=UserWarning, module="PIL")
        with Image.open(BytesIO(data), formats=_formats(path, data)) as image:
            return _linear(path, ImageOps.exif_transpose(image))


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep decoders from printing what they find wrong: a line of ours says it.

    libtiff and OpenEXR do so past `sys.stderr`, so the file descriptor itself is led away.
    """
    sys.stderr.flush()
    nowhere, kept = os.open(os.devnull, os.O_WRONLY), os.dup(2)
    try:
        os.dup2(nowhere, 2)
        with redirect_stdout(StringIO()):
            yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _formats(path: Path, data: bytes) -> tuple[str, ...]:
    # Older files of this kind can be told by nothing but their names.
    is_tga = data.endswith(_TGA_END) or path.suffix.lower() == ".tga"
    return (*FORMATS, "TGA") if is_tga else FORMATS


def _over_white(colour: FloatArray, alpha: FloatArray | None) -> FloatArray:
    if alpha is None:
        return colour
    return np.clip(colour + (1 - alpha), 0, 1).astype(np.float32, copy=False)


def _exposed(path: Path, light: FloatArray) -> FloatArray:
    """Scene-linear RGB as a viewer shows it.

    Raises:
        FileFormatError: If too little would be left of it.
    """
    light = np.nan_to_num(light, nan=0.0)
    glare = np.mean(luminance(light) > _GLARING)
    if glare > 0.5:
        raise FileFormatError(
            f"{path}: {glare:.0%} of its pixels are more than {_GLARING:g} times as bright as "
            "white; lower its exposure first"
        )
    return np.clip(light, 0, 1)


def _linear(path: Path, image: Image.Image) -> tuple[FloatArray, FloatArray | None]:
    if image.mode == "F":
        return _exposed(path, np.stack([np.asarray(image, np.float32)] * 3, axis=-1)), None
    if image.mode.startswith("I"):  # 16 bits of grey; Pillow widens some of them to 32.
        grey = srgb_to_linear(np.clip(np.asarray(image).astype(np.float32) / 65535, 0, 1))
        return np.stack([grey] * 3, axis=-1), None
    pixels = np.asarray(_in_srgb(image).convert("RGBA"))
    # A table, because a large picture in floats several times over would fill the memory.
    linear = srgb_to_linear(np.arange(256, dtype=np.float32) / 255).astype(np.float32)
    colour = linear[pixels[..., :3]]
    if (pixels[..., 3] == 255).all():
        return colour, None
    alpha = np.divide(pixels[..., 3:], 255, dtype=np.float32)
    return colour * alpha, alpha


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
