"""Pictures of a film, to measure it by."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence, UnidentifiedImageError

from vnca.core import FloatArray
from vnca.core.errors import BackendUnavailableError, FileFormatError
from vnca.core.files import existing_file

_BY_PILLOW = (".gif", ".webp")
SUFFIXES = (".mp4", ".mov", ".mkv", ".webm", ".avi", *_BY_PILLOW)
"""Films that are read."""


def brightness_of_film(path: Path, *, shorter: int, most: int) -> Iterator[FloatArray]:
    """The first pictures of a film in grey, `[r, c]` from 0 to 1, one after the other.

    Args:
        path: The film.
        shorter: Pixels along the shorter side, which larger films are scaled down to.
        most: Pictures.

    Raises:
        FileFormatError: If the file is missing or cannot be read as a film.
        BackendUnavailableError: If reading it needs PyAV, which is not installed.
    """
    existing_file(path)
    pictures = _by_pillow(path) if path.suffix.lower() in _BY_PILLOW else _by_av(path)
    for picture in islice(pictures, most):
        factor = min(1.0, shorter / min(picture.size))
        columns, rows = (max(1, round(factor * side)) for side in picture.size)
        small = picture.convert("L").resize((columns, rows), Image.Resampling.BOX)
        yield (np.asarray(small) / 255).astype(np.float32)


def _by_pillow(path: Path) -> Iterator[Image.Image]:
    try:
        with Image.open(path) as film:
            yield from ImageSequence.Iterator(film)
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise FileFormatError(f"{path}: cannot be read as a film ({error})") from error


def _by_av(path: Path) -> Iterator[Image.Image]:
    try:
        import av
        import av.error
    except ImportError as error:
        raise BackendUnavailableError(
            f"{path}: reading such films needs PyAV: pip install 'vnca[train]'"
        ) from error
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise FileFormatError(f"{path}: there are no pictures in it")
            for frame in container.decode(video=0):
                yield frame.to_image()
    except (av.error.FFmpegError, ValueError) as error:
        raise FileFormatError(f"{path}: cannot be read as a film ({error})") from error
