"""Films (MP4 for looking at, GIF and WebP for pages), and contact sheets of their pictures."""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from fractions import Fraction
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from vnca.core import AnyArray, FloatArray
from vnca.core.colour import luminance, srgb_to_linear
from vnca.core.errors import BackendUnavailableError, OptionError, OutputError, ShapeError
from vnca.core.files import whole_file
from vnca.io.picture import to_srgb8

# Colour description codes of ITU-T H.273.
_BT709 = 1
_SRGB_TRANSFER = 13


class FilmWriter:
    """A film written frame by frame; it appears under its name when the block succeeds.

    The suffix decides: `.mp4` is H.264 and streams; `.gif` and `.webp` loop, and hold their
    frames in memory until the end. The same frames give the same file.

        with FilmWriter(Path("smoke.mp4"), fps=24) as film:
            film.add(frame)

    Args:
        path: Where the film appears.
        fps: Frames a second.

    Raises:
        OptionError: If the suffix or the frame rate cannot work.
        BackendUnavailableError: On entering the block, if MP4 is asked for without PyAV.
        OutputError: If the file cannot be written, or no frame was added.
    """

    def __init__(self, path: str | Path, fps: float) -> None:
        self.path = Path(path)
        suffix = self.path.suffix.lower()
        if suffix not in _ENCODERS:
            raise OptionError(f"{path}: expected a film name ending in .mp4, .gif or .webp")
        if not 0 < fps <= 1000:
            raise OptionError(f"{path}: expected a frame rate above 0 and up to 1000, got {fps}")
        if suffix == ".gif" and fps > 50:
            raise OptionError(f"{path}: GIF plays at most 50 frames a second, got {fps}")
        self._fps = Fraction(fps).limit_denominator(1001)
        self._make_encoder = _ENCODERS[suffix]
        self._size: tuple[int, int] | None = None
        self._file: AbstractContextManager[Path] | None = None
        self._encoder: _Encoder | None = None

    def __enter__(self) -> "FilmWriter":
        self._file = whole_file(self.path)
        with self._leaving_no_film():
            self._encoder = self._make_encoder(self._file.__enter__(), self._fps)
        return self

    def add(self, frame: AnyArray) -> None:
        """Append a frame: linear RGB, `[row, column, 3]`, of the size of the first.

        Raises:
            ShapeError: If it is of another shape.
        """
        assert self._encoder is not None, "add() belongs inside the with block"
        frame = np.asarray(frame)
        if frame.ndim != 3 or frame.shape[2] != 3 or 0 in frame.shape:
            raise ShapeError(f"{self.path}: expected frames [row, column, 3], got {frame.shape}")
        size = frame.shape[:2]
        self._size = self._size or size
        if size != self._size:
            raise ShapeError(f"{self.path}: expected every frame {self._size}, got {size}")
        self._encoder.add(to_srgb8(frame))

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        assert self._file is not None
        assert self._encoder is not None
        if kind is not None:
            self._encoder.abandon()
            # Not the caller's own error: an OSError of theirs would be blamed on the film.
            self._file.__exit__(_UnfinishedError, _UnfinishedError(), None)
            return
        with self._leaving_no_film():
            if self._size is None:
                self._encoder.abandon()
                raise OutputError(f"{self.path}: a film needs at least one frame, got none")
            self._encoder.finish()
        self._file.__exit__(None, None, None)

    @contextmanager
    def _leaving_no_film(self) -> Iterator[None]:
        """On an error, remove the temporary file, and raise the error as `whole_file` would."""
        assert self._file is not None
        try:
            yield
        except BaseException as error:
            self._file.__exit__(type(error), error, error.__traceback__)
            raise


class _UnfinishedError(Exception):
    pass


class _Encoder(Protocol):
    """One film format; frames are 8-bit sRGB `[row, column, 3]`."""

    def add(self, frame: NDArray[np.uint8]) -> None: ...

    def finish(self) -> None: ...

    def abandon(self) -> None: ...


class _Mp4:
    """H.264 in 4:2:0, which needs even sizes: an odd edge is repeated once."""

    def __init__(self, path: Path, fps: Fraction) -> None:
        try:
            import av
            import av.error
        except ImportError as error:
            raise BackendUnavailableError(
                f"{path.suffix} films need PyAV: pip install 'vnca[train]' "
                "(GIF and WebP films work without it)"
            ) from error
        if "libx264" not in av.codecs_available:
            raise BackendUnavailableError(
                "the installed PyAV has no H.264 encoder; write a .webp or .gif film instead"
            )
        self._av = av
        self._fps = fps
        self._stream: Any = None
        options = {"movflags": "+faststart", "fflags": "+bitexact"}
        with self._output_errors():
            self._container = av.open(str(path), "w", format="mp4", options=options)

    def add(self, frame: NDArray[np.uint8]) -> None:
        rows, columns = frame.shape[:2]
        even = np.pad(frame, ((0, rows % 2), (0, columns % 2), (0, 0)), mode="edge")
        with self._output_errors():
            if self._stream is None:
                self._stream = self._open_stream(*even.shape[:2])
            picture = self._av.VideoFrame.from_ndarray(even, format="rgb24").reformat(
                format="yuv420p", dst_colorspace="ITU709", interpolation="BICUBIC"
            )
            self._container.mux(self._stream.encode(picture))

    def finish(self) -> None:
        with self._output_errors():
            self._container.mux(self._stream.encode(None))
            self._container.close()

    def abandon(self) -> None:
        with suppress(self._av.error.FFmpegError):
            self._container.close()

    def _open_stream(self, rows: int, columns: int) -> Any:
        # The number of threads shapes the stream; a fixed one makes machines agree. Macroblock
        # trees do not help that: with AVX-512, x264 reads memory for them that it never wrote.
        options = {"crf": "16", "preset": "medium", "threads": "4", "mbtree": "0"}
        stream = self._container.add_stream("libx264", rate=self._fps, options=options)
        stream.width, stream.height, stream.pix_fmt = columns, rows, "yuv420p"
        context = stream.codec_context
        context.colorspace = context.color_primaries = _BT709
        context.color_trc = _SRGB_TRANSFER
        return stream

    @contextmanager
    def _output_errors(self) -> Iterator[None]:
        try:
            yield
        except self._av.error.FFmpegError as error:
            raise OutputError(f"film: the encoder failed ({error})") from error


class _Gif:
    """One palette for the whole film, so that still parts stay still."""

    _SAMPLED_FRAMES = 16

    def __init__(self, path: Path, fps: Fraction) -> None:
        self._path, self._fps = path, fps
        self._frames: list[Image.Image] = []

    def add(self, frame: NDArray[np.uint8]) -> None:
        self._frames.append(Image.fromarray(frame))

    def finish(self) -> None:
        every = -(-len(self._frames) // self._SAMPLED_FRAMES)
        sampled = np.concatenate([np.asarray(frame) for frame in self._frames[::every]])
        palette = Image.fromarray(sampled).quantize(256)
        frames = [frame.quantize(palette=palette) for frame in self._frames]
        _save(frames, self._path, "GIF", _durations(len(frames), self._fps, unit=10), optimize=True)

    def abandon(self) -> None:
        self._frames.clear()


class _WebP(_Gif):
    def finish(self) -> None:
        durations = _durations(len(self._frames), self._fps, unit=1)
        _save(self._frames, self._path, "WEBP", durations, quality=88)


_ENCODERS = {".mp4": _Mp4, ".gif": _Gif, ".webp": _WebP}
SUFFIXES = tuple(_ENCODERS)


def usual_suffix() -> str:
    """That of a film nobody named: `.mp4` where PyAV is installed, else `.webp`."""
    return ".mp4" if find_spec("av") else ".webp"


def _durations(count: int, fps: Fraction, *, unit: int) -> list[int]:
    """Milliseconds each frame is shown, in whole units, without drifting from the frame rate."""
    ticks = [round(k * 1000 / (fps * unit)) for k in range(count + 1)]
    return [unit * (b - a) for a, b in pairwise(ticks)]


def _save(
    frames: list[Image.Image], path: Path, name: str, durations: list[int], **options: Any
) -> None:
    first, *others = frames
    first.save(
        path,
        format=name,
        save_all=True,
        append_images=others,
        # Pillow takes a list only for an animation, which one frame is not.
        duration=durations if others else durations[0],
        loop=0,
        **options,
    )


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
