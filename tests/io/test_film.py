"""Films that other readers can play, and contact sheets of pictures."""

import os
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
from PIL import Image, ImageSequence

from vnca.core.colour import linear_to_srgb, srgb_to_linear
from vnca.core.errors import BackendUnavailableError, OptionError, OutputError, ShapeError
from vnca.io.film import FilmWriter, contact_sheet

SUFFIXES = [".mp4", ".gif", ".webp"]
COLOURS = [(0.8, 0.1, 0.1), (0.1, 0.7, 0.2), (0.1, 0.2, 0.9), (0.5, 0.5, 0.5)]
ENCODE = """
import sys, numpy as np
from pathlib import Path
from vnca.io.film import FilmWriter
rows, columns = np.mgrid[:384, :144]
with FilmWriter(Path(sys.argv[1]), 24) as film:
    for k in range(6):
        waves = np.sin((rows * 0.3 + columns * 0.2 + k)[..., None] + np.arange(3))
        film.add(0.3 + 0.2 * waves + 0.05 * np.random.default_rng(k).random((384, 144, 3)))
"""
RED, GREEN = np.zeros((2, 10, 20, 3), np.float32)
RED[..., 0] = 1
GREEN[..., 1] = 1


def flat(colour, rows=48, columns=64) -> np.ndarray:
    return np.broadcast_to(srgb_to_linear(colour), (rows, columns, 3))


def write(path, frames, fps=24.0) -> None:
    with FilmWriter(path, fps) as film:
        for frame in frames:
            film.add(frame)


def read(path) -> tuple[list[np.ndarray], Fraction]:
    """Frames as sRGB in [0, 1], and frames a second."""
    if path.suffix == ".mp4":
        av = pytest.importorskip("av")
        with av.open(str(path)) as container:
            rate = container.streams.video[0].average_rate
            return [f.to_ndarray(format="rgb24") / 255 for f in container.decode(video=0)], rate
    with Image.open(path) as film:
        frames, time = [], 0
        for frame in ImageSequence.Iterator(film):
            frames.append(np.asarray(frame.convert("RGB")) / 255)
            time += frame.info.get("duration", 0)
        return frames, Fraction(1000 * len(frames), time or 1)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_film_shows_its_frames_in_order_and_in_colour(tmp_path, suffix) -> None:
    path = tmp_path / f"film{suffix}"
    write(path, map(flat, COLOURS), fps=20)
    frames, rate = read(path)
    assert rate == 20
    assert len(frames) == len(COLOURS)
    for frame, colour in zip(frames, COLOURS, strict=True):
        assert frame.shape == (48, 64, 3)
        np.testing.assert_allclose(frame[24, 32], colour, atol=0.02)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_film_of_one_frame_of_odd_size_is_a_film(tmp_path, suffix) -> None:
    path = tmp_path / f"film{suffix}"
    ramp = np.linspace(0, 1, 33)[None, :, None] * np.ones((17, 1, 3))
    write(path, [srgb_to_linear(ramp)])
    (frame,), _ = read(path)
    np.testing.assert_allclose(frame[:17, :33], ramp, atol=0.05)
    assert frame.shape == ((18, 34, 3) if suffix == ".mp4" else (17, 33, 3))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_same_frames_make_the_same_file(tmp_path, suffix) -> None:
    rng = np.random.default_rng(0)
    frames = [rng.random((32, 32, 3)) for _ in range(4)]
    for name in ("a", "b"):
        write(tmp_path / f"{name}{suffix}", frames)
    a, b = ((tmp_path / f"{name}{suffix}").read_bytes() for name in ("a", "b"))
    assert a == b


def test_a_film_does_not_depend_on_what_was_in_memory_before(tmp_path) -> None:
    films = [tmp_path / "a.mp4", tmp_path / "b.mp4", tmp_path / "c.mp4"]
    for film, filling in zip(films, ("0", "85", "170"), strict=True):
        filled = {**os.environ, "MALLOC_PERTURB_": filling}  # Of the C library of GNU.
        subprocess.run([sys.executable, "-c", ENCODE, str(film)], env=filled, check=True)
    assert len({film.read_bytes() for film in films}) == 1


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("error", [OSError("their own"), KeyboardInterrupt()], ids=type)
def test_a_film_that_was_broken_off_leaves_nothing_behind(tmp_path, suffix, error) -> None:
    path = tmp_path / f"film{suffix}"
    path.write_bytes(b"an older film")

    def frames():
        yield flat(COLOURS[0])
        raise error

    with pytest.raises(type(error)) as caught:
        write(path, frames())
    assert caught.value is error
    assert path.read_bytes() == b"an older film"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_film_without_frames_is_refused(tmp_path, suffix) -> None:
    with pytest.raises(OutputError, match="at least one frame"):
        write(tmp_path / f"film{suffix}", [])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_film_that_cannot_be_written_says_so(tmp_path, suffix) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="cannot be written"):
        write(tmp_path / "file" / f"film{suffix}", [flat(COLOURS[0])])


def test_a_full_disk_is_blamed_on_the_film(tmp_path, monkeypatch) -> None:
    def save(*_args, **_options) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", save)
    with pytest.raises(OutputError, match=r"film\.webp: cannot be written .*space"):
        write(tmp_path / "film.webp", [flat(COLOURS[0])])
    assert not list(tmp_path.iterdir())


def test_frames_of_changing_size_are_refused(tmp_path) -> None:
    with pytest.raises(ShapeError, match="every frame"):
        write(tmp_path / "film.webp", [flat(COLOURS[0]), flat(COLOURS[0], 10, 10)])
    with pytest.raises(ShapeError, match="frames"):
        write(tmp_path / "film.webp", [np.zeros((4, 4))])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "fps"), [("a.avi", 24), ("a.mp4", 0), ("a.gif", 60)])
def test_impossible_films_are_refused_before_anything_is_rendered(tmp_path, name, fps) -> None:
    with pytest.raises(OptionError, match=r"expected|at most"):
        FilmWriter(tmp_path / name, fps)


def test_gif_keeps_time_although_it_counts_in_hundredths(tmp_path) -> None:
    write(tmp_path / "film.gif", [flat(COLOURS[k % 4], 8, 8) for k in range(48)], fps=24)
    frames, rate = read(tmp_path / "film.gif")
    assert len(frames) == 48
    assert rate == 24


def test_still_parts_of_a_gif_stand_still(tmp_path) -> None:
    ramp = np.tile(linear_to_srgb(np.linspace(0, 1, 64))[None, :, None], (64, 1, 3))
    frames = []
    for k, colour in enumerate(COLOURS):
        frame = srgb_to_linear(ramp)
        frame[:8, :8] = srgb_to_linear(colour) * (1 + k / 10)
        frames.append(frame)
    write(tmp_path / "film.gif", frames)
    found, _ = read(tmp_path / "film.gif")
    for frame in found[1:]:
        np.testing.assert_allclose(frame[32:], found[0][32:], atol=0.04)


def test_without_pyav_the_message_says_what_to_install(tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(BackendUnavailableError, match=r"vnca\[train\]"):
        write(tmp_path / "film.mp4", [flat(COLOURS[0])])
    assert not list(tmp_path.iterdir())
    write(tmp_path / "film.gif", [flat(COLOURS[0])])


def test_pictures_stand_in_rows_with_gaps_between() -> None:
    sheet = contact_sheet([[RED, GREEN], [GREEN]], gap=4, background=(0, 0, 1))
    assert sheet.shape == (4 + 10 + 4 + 10 + 4, 4 + 20 + 4 + 20 + 4, 3)
    np.testing.assert_array_equal(sheet[4:14, 4:24], RED)
    np.testing.assert_array_equal(sheet[4:14, 28:48], GREEN)
    np.testing.assert_array_equal(sheet[18:28, 4:24], GREEN)
    assert (sheet[18:28, 28:48] == [0, 0, 1]).all()
    assert (sheet[:, :4] == [0, 0, 1]).all()
    assert (sheet[-4:] == [0, 0, 1]).all()


def test_smaller_pictures_are_centred_among_larger_ones() -> None:
    sheet = contact_sheet([[GREEN[:6, :8]], [RED]], gap=2)
    np.testing.assert_array_equal(sheet[2:8, 8:16], GREEN[:6, :8])
    assert (sheet[2:8, :8] == 1).all()


@pytest.mark.parametrize(("background", "ink"), [(1.0, 0.0), (0.0, 1.0)])
def test_captions_are_legible_on_any_background_and_stay_below_their_picture(
    background, ink
) -> None:
    wide = np.tile(RED, (1, 4, 1))
    options = {"gap": 4, "background": (background,) * 3}
    sheet = contact_sheet([[wide, wide]], [["frame 30", ""]], **options)
    np.testing.assert_array_equal(sheet[4:14, 4:84], wide)
    left, right = sheet[14:-4, 4:84], sheet[14:-4, 88:168]
    assert np.abs(left - ink).min() < 0.05
    assert (right == background).all()
    assert (sheet[:, 84:88] == background).all()


def test_a_caption_too_long_is_cut_to_its_cell() -> None:
    long = contact_sheet([[RED, RED]], [["a very long caption indeed", "b"]])
    assert long.shape[1] == contact_sheet([[RED, RED]]).shape[1]


@pytest.mark.parametrize(
    ("images", "captions"),
    [([], None), ([[None]], None), ([[RED]], [["a", "b"]]), ([[RED]], [])],
)
def test_sheets_that_do_not_add_up_are_refused(images, captions) -> None:
    with pytest.raises(OptionError, match="contact sheet"):
        contact_sheet(images, captions)


def test_pictures_with_alpha_are_refused() -> None:
    with pytest.raises(ShapeError, match="contact sheet"):
        contact_sheet([[np.zeros((4, 4, 4))]])
