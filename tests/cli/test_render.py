from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from vnca.io.vdb import Grid, open_vdb, write_vdb

Vnca = Callable[..., Any]
SIZE = ("--rows", 32, "--columns", 40)


@pytest.fixture
def render(vnca: Vnca, smoke: Path, tmp_path: Path) -> Callable[..., Path]:
    """Renders the smoke to a file of a name, with more options."""

    def run(name: str, *options: object) -> Path:
        outcome = vnca("render", smoke, "--out", tmp_path / "seen" / name, *SIZE, *options)
        assert outcome.code == 0, outcome.err
        return tmp_path / "seen" / name

    return run


def pictures(film: Path) -> int:
    with Image.open(film) as image:
        assert image.size == (40, 32)
        return int(getattr(image, "n_frames", 1))


def pixels(path: Path) -> Any:
    with Image.open(path) as image:
        return np.asarray(image, np.float32) / 255


def test_a_film_has_a_picture_a_frame(render: Callable[..., Path]) -> None:
    assert pictures(render("film.gif")) == 3
    assert pictures(render("some.webp", "--frames", "1-2")) == 2


def test_a_film_in_mp4_can_be_decoded(render: Callable[..., Path]) -> None:
    av = pytest.importorskip("av")
    with av.open(str(render("film.mp4", "--film-fps", 12))) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
        assert film.streams.video[0].average_rate == 12
    assert [frame.shape for frame in frames] == [(32, 40, 3)] * 3
    assert max(frame.max() for frame in frames) > 150


def test_a_turntable_walks_around_while_a_frame_is_held(render: Callable[..., Path]) -> None:
    assert pictures(render("turn.gif", "--turntable", 4)) == 12


def test_painted_files_tell_how_fast_their_smoke_is(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path
) -> None:
    """The blur of a film of painted files is that of their units, or of those that are given."""

    def seen(name: str, folder: Path, *options: object) -> Any:
        out = tmp_path / "seen" / name
        done = vnca("render", folder, "-o", out, "--frames", 2, *SIZE, *options)
        assert done.code == 0, done.err
        return pixels(out)

    for path in smoke.glob("*.vdb"):  # simulated files say their units, which would count
        with open_vdb(path) as file:
            grids = [header.read() for header in file.grids.values()]
        for grid in grids:
            grid.metadata.pop("velocity_units", None)
        write_vdb(path, grids)
    quick = ("--warmup", 2, "--steps-per-frame", 1)
    sharp = []
    for scale in (1, 8):
        folder = tmp_path / f"painted{scale}"
        units = ("--velocity-units", "m/s", "--velocity-scale", scale)
        done = vnca("stylize", model, smoke, "--out", folder, *quick, *units, "--refine", 2)
        assert done.code == 0, done.err
        sharp.append(seen("sharp.png", folder))
    slow, fast = (
        np.abs(seen("blurred.png", tmp_path / f"painted{scale}", "--shutter", 1) - still).mean()
        for scale, still in zip((1, 8), sharp, strict=True)
    )
    assert fast > 2 * slow
    given = ("--shutter", 1, "--velocity-units", "m/s", "--velocity-scale", 8)
    asked = seen("asked.png", tmp_path / "painted1", *given)
    assert np.abs(asked - sharp[0]).mean() > 2 * slow


def test_a_preview_is_blurred_as_the_film_of_its_files(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path
) -> None:
    how = ("--shutter", 0.5, *SIZE)
    quick = ("--warmup", 2, "--steps-per-frame", 1, "--velocity-scale", 3)
    film = tmp_path / "preview.webp"
    done = vnca("stylize", model, smoke, "-o", tmp_path / "p", *quick, "--preview", film, *how)
    assert done.code == 0, done.err
    later = vnca("render", tmp_path / "p", "--out", tmp_path / "film.webp", *how)
    assert later.code == 0, later.err
    assert film.read_bytes() == (tmp_path / "film.webp").read_bytes()


def test_options_of_a_velocity_are_refused_where_nothing_is_blurred(
    vnca: Vnca, smoke: Path, tmp_path: Path
) -> None:
    out = tmp_path / "film.webp"
    done = vnca("render", smoke, "--out", out, *SIZE, "--time-scale", 0.4)
    assert done.code == 2
    assert done.err.strip() == "vnca: --time-scale: changes nothing where --shutter is 0"
    done = vnca("render", smoke, "--out", out, *SIZE, "--shutter", 0.5, "--velocity-grid", "none")
    assert done.code == 2
    assert "frame 1: no velocity, which --shutter needs" in done.err
    assert not out.exists()


def test_pictures_are_numbered_like_their_frames(render: Callable[..., Path]) -> None:
    folder = render("frame_####.png").parent
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["frame_0001.png", "frame_0002.png", "frame_0003.png"]


def test_pictures_of_frames_below_zero_are_in_the_order_of_their_frames(
    render: Callable[..., Path], smoke: Path
) -> None:
    for number, name in ((1, "ball_-0010"), (2, "ball_-0009"), (3, "ball_0000")):
        (smoke / f"ball_{number:04d}.vdb").rename(smoke / f"{name}.vdb")
    folder = render("frame_##.png", "--frames", "-10--9,0").parent
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["frame_-09.png", "frame_-10.png", "frame_00.png"]


def test_one_frame_is_one_picture(render: Callable[..., Path]) -> None:
    image = pixels(render("one.png", "--frames", "2"))
    assert image.shape == (32, 40, 3)
    # Smoke without a colour grid is white.
    assert image[16, 20].min() > 0.5
    assert image[0, 0].max() < 0.1


def test_the_background_is_the_one_asked_for(render: Callable[..., Path]) -> None:
    image = pixels(render("one.png", "--frames", "2", "--background", "#ff8000", "--light", 0))
    np.testing.assert_allclose(image[0, 0], [1, 128 / 255, 0], atol=0.01)


def test_the_background_of_lit_smoke_is_darker_in_the_corners(render: Callable[..., Path]) -> None:
    image = pixels(render("one.png", "--frames", "2", "--background", "#ff8000"))
    assert 0.5 < image[0, 0, 0] < 0.9
    assert image[0, 20, 0] > image[0, 0, 0] + 0.05
    assert image[..., 2].max(1)[0] == 0


def test_the_light_comes_from_where_it_is_asked_to(render: Callable[..., Path]) -> None:
    options = ("--frames", "2", "--gamma", 5, "--transparent")
    left, right = (
        pixels(render(f"{at}.png", *options, "--light-azimuth", at))[..., 0] for at in (-90, 90)
    )
    assert left[:, :20].mean() > 1.1 * left[:, 20:].mean()
    assert right[:, 20:].mean() > 1.1 * right[:, :20].mean()


def test_shadows_stay_on_the_smoke_while_the_camera_turns(render: Callable[..., Path]) -> None:
    """The light of a turntable stands: the back is as dark as the front is bright."""
    film = render(
        "turn.webp", "--frames", "2", "--gamma", 5, "--light-azimuth", 0, "--turntable", 2
    )
    with Image.open(film) as pictures:
        seen = []
        for number in range(2):
            pictures.seek(number)
            seen.append(np.asarray(pictures.convert("L"), np.float32)[12:20, 16:24].mean())
    assert seen[0] > 1.2 * seen[1]


def test_a_transparent_picture_has_only_smoke_in_it(render: Callable[..., Path]) -> None:
    image = pixels(render("one.png", "--frames", "2", "--transparent", "--gamma", 5))
    assert image.shape == (32, 40, 4)
    assert image[0, 0, 3] == 0
    assert image[16, 20, 3] > 0.9


def test_a_strip_puts_frames_side_by_side(render: Callable[..., Path]) -> None:
    image = pixels(render("strip.png", "--strip", 2))
    assert image.shape[1] >= 80
    halves = np.array_split(image, 2, axis=1)
    assert all(half.max() > 0.5 for half in halves)


def test_a_higher_gamma_makes_smoke_more_opaque(render: Callable[..., Path]) -> None:
    thin, thick = (
        pixels(render(f"{gamma}.png", "--frames", "2", "--transparent", "--gamma", gamma))
        for gamma in (0.05, 0.5)
    )
    assert thick[16, 20, 3] > 2 * thin[16, 20, 3]


def test_smoke_is_drawn_in_the_colours_of_its_grid(
    render: Callable[..., Path], smoke: Path
) -> None:
    for path in smoke.iterdir():
        with open_vdb(path) as file:
            density = file.grids["density"].read()
            box = density.active_box()
            _, active = density.to_dense(box)
            red = np.zeros((*box.shape, 3), np.float32)
            red[..., 0] = 1
            paint = Grid.from_dense("paint", red, active, box.lower, like=density)
            write_vdb(path, [*file.grids.values(), paint])
    options = ("--frames", "2", "--gamma", 5, "--light", 0)
    painted = pixels(render("red.png", *options, "--colour-grid", "paint"))[16, 20]
    assert painted[0] > 0.9
    assert painted[1:].max() < 0.1
    assert pixels(render("white.png", *options))[16, 20].min() > 0.9


@pytest.mark.parametrize("has_grid", [True, False])
def test_a_frame_without_smoke_is_background(
    vnca: Vnca, render: Callable[..., Path], smoke: Path, has_grid: bool
) -> None:
    path = smoke / "ball_0001.vdb"
    with open_vdb(path) as file:
        density = file.grids["density"].read()
        nothing = np.zeros((0, 0, 0), np.float32)
        empty = Grid.from_dense("density", nothing, nothing == 0, (0, 0, 0), like=density)
        write_vdb(path, [empty] if has_grid else [])
    folder = render("frame_#.png", "--light", 0).parent
    assert pixels(folder / "frame_1.png").max() < 0.1
    assert pixels(folder / "frame_2.png").max() > 0.5
