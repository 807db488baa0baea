"""The same smoke in every view: whatever its cells are, and however it was painted."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageSequence

from vnca.core import AnyArray, Index
from vnca.core.colour import srgb_to_linear
from vnca.core.volume import Volume
from vnca.io import write_smoke
from vnca.io.provenance import read_provenance
from vnca.io.vdb import Grid, Transform, write_vdb

Vnca = Callable[..., Any]
PLACE = (
    *("--rows", 32, "--columns", 32, "--field-of-view", 0),
    *("--elevation", 0, "--light", 0),
)
CAMERA = (*PLACE, "--background", "#000000")
SPACING, THICKNESS, DENSITY = 0.25, 4, 0.2
GAMMA = 0.7 / 0.9
"""Of the model made up for these tests: extinction of density 1 in the file, per cell."""


def opacity(picture: Path, at: tuple[int, int] = (16, 16)) -> float:
    """Of white smoke before black."""
    with Image.open(picture) as image:
        first = next(iter(ImageSequence.Iterator(image))).convert("RGB")
    return float(srgb_to_linear(np.asarray(first, np.float32) / 255)[at].mean())


@pytest.fixture
def slab(tmp_path: Path) -> Path:
    """Two frames of even smoke, four cells thick from front to back."""
    density = np.full((12, THICKNESS, 12), DENSITY, np.float32)
    for frame in (1, 2):
        matrix = np.diag([SPACING] * 3 + [1.0])
        write_smoke(
            tmp_path / f"slab/slab_{frame:04d}.vdb", Volume(density, None, (5, 0, 3), matrix, frame)
        )
    return tmp_path / "slab"


@pytest.mark.parametrize("gamma", [None, 0.3])
def test_preview_render_and_refined_paintings_are_equally_opaque(
    vnca: Vnca, model: Path, slab: Path, tmp_path: Path, gamma: float | None
) -> None:
    asked = () if gamma is None else ("--gamma", gamma)
    expected = 1 - np.exp(-(GAMMA if gamma is None else gamma / 0.9) * DENSITY * THICKNESS)
    seen = []
    for refine in (1, 2, 3):
        out, film = tmp_path / f"painted{refine}", tmp_path / f"{refine}.gif"
        painting = ("--refine", refine, "--warmup", 2, "--steps-per-frame", 1)
        plain = ("--strength", 0, "--density-strength", 0)
        options = (*painting, *plain, "--preview", film, *CAMERA, *asked)
        assert vnca("stylize", model, slab, "--out", out, *options).code == 0
        for name, again in (("told", ()), ("asked", ("--gamma", gamma or 0.7))):
            picture = tmp_path / f"{name}{refine}.png"
            show = ("--out", picture, "--frames", 1, *CAMERA, *again)
            assert vnca("render", out, *show).code == 0
            seen.append(opacity(picture))
        seen.append(opacity(film))
    np.testing.assert_allclose(seen, expected, atol=0.01)


def test_a_given_gamma_wins_over_what_the_file_tells(
    vnca: Vnca, model: Path, slab: Path, tmp_path: Path
) -> None:
    plain = ("--strength", 0, "--density-strength", 0, "--gamma", 5)
    assert vnca("stylize", model, slab, "--out", tmp_path / "painted", *plain).code == 0
    picture = tmp_path / "thin.png"
    show = ("--out", picture, "--frames", 1, *CAMERA, "--gamma", 0.1)
    assert vnca("render", tmp_path / "painted", *show).code == 0
    thin = 1 - np.exp(-0.1 / 0.9 * DENSITY * THICKNESS)
    assert opacity(picture) == pytest.approx(thin, abs=0.01)


def test_painted_files_tell_how_they_were_painted(
    vnca: Vnca, model: Path, slab: Path, tmp_path: Path
) -> None:
    options = ("--refine", 2, "--seed", 7, "--strength", 0.5, "--warmup", 2)
    assert vnca("stylize", model, slab, "--out", tmp_path / "painted", *options).code == 0
    told = read_provenance(tmp_path / "painted" / "slab_0002.vdb")
    assert told is not None
    assert told.extinction == pytest.approx(GAMMA / SPACING)
    assert (told.gamma, told.up_axis) == (0.7, "z")
    expected = {"model": "run", "style": "night.png", "seed": 7, "strength": 0.5, "refine": 2}
    assert told.facts.items() >= expected.items()
    assert isinstance(told.facts["version"], str)


def test_a_painting_of_a_file_with_y_up_stands_upright_in_render(
    vnca: Vnca, model: Path, tmp_path: Path
) -> None:
    """As in the preview, which knows what it was painted from."""
    tall = np.zeros((6, 20, 6), np.float32)  # y
    tall[1:5, 1:19, 1:5] = 1
    folder = tmp_path / "sim" / "d"
    folder.mkdir(parents=True)
    np.savez_compressed(folder / "001.npz", x=tall.transpose(2, 1, 0))
    options = ("--strength", 0, "--warmup", 2, "--preview", tmp_path / "film.gif", *CAMERA)
    assert vnca("stylize", model, folder, "--out", tmp_path / "painted", *options).code == 0
    show = ("--out", tmp_path / "seen.png", *CAMERA)
    assert vnca("render", tmp_path / "painted", *show).code == 0
    for picture in (tmp_path / "seen.png", tmp_path / "film.gif"):
        assert opacity(picture, at=(3, 16)) > 0.5
        assert opacity(picture, at=(16, 3)) < 0.1


def shape() -> AnyArray:
    """A body without any symmetry."""
    density = np.zeros((14, 10, 12), np.float32)
    density[1:13, 2:8, 1:5] = 0.6
    density[2:5, 3:6, 5:11] = 1.0
    density[9:11, 6:9, 5:8] = 0.3
    return density


def write(folder: Path, density: AnyArray, matrix: AnyArray, origin: Index = (0, 0, 0)) -> Path:
    grid = Grid.from_dense(
        "density", density, density > 0, origin, transform=Transform.from_matrix(matrix)
    )
    write_vdb(folder / "s_0001.vdb", [grid])
    return folder


def picture(vnca: Vnca, source: Path, *options: object) -> AnyArray:
    path = source / "seen.png"
    assert vnca("render", source, "--out", path, *PLACE, "--transparent", *options).code == 0
    with Image.open(path) as image:
        return np.asarray(image, np.float32) / 255


UPRIGHT = np.diag([0.1, 0.1, 0.1, 1.0])
ANGLES = ("--azimuth", 25, "--elevation", 15)


def axes(*columns: Sequence[float], at: Sequence[float] = (0, 0, 0)) -> AnyArray:
    """Cells whose axes go along these vectors, the first centred on `at`; tenths of a length."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = 0.1 * np.transpose(columns), 0.1 * np.array(at)
    return matrix


def test_mirrored_and_exchanged_axes_show_the_same_body(vnca: Vnca, tmp_path: Path) -> None:
    body = shape()
    upright = picture(vnca, write(tmp_path / "plain", body, UPRIGHT), *ANGLES)
    mirrored = write(
        tmp_path / "mirrored", body[::-1], axes((-1, 0, 0), (0, 1, 0), (0, 0, 1), at=(13, 0, 0))
    )
    exchanged = write(
        tmp_path / "exchanged", body.transpose(2, 0, 1), axes((0, 0, 1), (1, 0, 0), (0, 1, 0))
    )
    moved = write(
        tmp_path / "moved", body, axes((1, 0, 0), (0, 1, 0), (0, 0, 1), at=(7, -9, 2)), (-7, 9, -2)
    )
    lying = write(
        tmp_path / "lying", body.transpose(1, 2, 0), axes((1, 0, 0), (0, 1, 0), (0, 0, 1))
    )
    assert upright[..., 3].max() > 0.3
    for source, options in (
        (mirrored, ()),
        (exchanged, ()),
        (moved, ()),
        (lying, ("--up-axis", "y")),
    ):
        seen = picture(vnca, source, *ANGLES, *options)
        np.testing.assert_allclose(seen, upright, atol=2 / 255, err_msg=source.name)


def test_a_body_that_is_turned_in_the_world_is_turned_in_the_picture(
    vnca: Vnca, tmp_path: Path
) -> None:
    body = shape()
    straight = picture(vnca, write(tmp_path / "straight", body, UPRIGHT))
    turn = axes((0, 0, 1), (0, 1, 0), (-1, 0, 0))
    turned = picture(vnca, write(tmp_path / "turned", body, turn))
    np.testing.assert_allclose(turned, np.rot90(straight), atol=2 / 255)
    assert np.abs(straight - np.rot90(straight)).max() > 0.3


def test_uneven_voxels_show_the_body_as_it_is_in_the_world(vnca: Vnca, tmp_path: Path) -> None:
    """Each slice of a body four times, or once where cells are four times as high."""
    flat = shape()
    even = write(tmp_path / "even", flat.repeat(4, axis=2), UPRIGHT)
    high = axes((1, 0, 0), (0, 1, 0), (0, 0, 4), at=(0, 0, 1.5))
    # γ is per edge of a cube as large as a cell.
    uneven = write(tmp_path / "uneven", flat, high)
    cubes = picture(vnca, even, "--gamma", 1)
    seen = picture(vnca, uneven, "--gamma", float(np.cbrt(4)))
    assert np.abs(cubes - seen).mean() < 0.03
    # As high as it is, and no more.
    assert np.abs(cubes[..., 3].any(1).sum() - seen[..., 3].any(1).sum()) <= 2


@pytest.mark.parametrize("size", [1e-12, 1e9])
def test_a_world_of_any_size_shows_the_same(vnca: Vnca, tmp_path: Path, size: float) -> None:
    upright = picture(vnca, write(tmp_path / "plain", shape(), UPRIGHT), *ANGLES)
    matrix = np.diag([size] * 3 + [1.0])
    matrix[:3, 3] = 1e4 * size
    seen = picture(vnca, write(tmp_path / "other", shape(), matrix), *ANGLES)
    np.testing.assert_allclose(seen, upright, atol=2 / 255)


def test_frames_whose_origin_moves_stand_still(vnca: Vnca, tmp_path: Path) -> None:
    """As their transforms say: the film is the same as that of frames that do not move."""
    films = []
    for drift in (0, 3):
        folder = tmp_path / f"drift{drift}"
        for frame in range(1, 4):
            away = drift * frame
            matrix = axes((1, 0, 0), (0, 1, 0), (0, 0, 1), at=(-away, 0, 2 * away))
            grid = Grid.from_dense(
                "density",
                shape(),
                shape() > 0,
                (away, 0, -2 * away),
                transform=Transform.from_matrix(matrix),
            )
            write_vdb(folder / f"s_{frame:04d}.vdb", [grid])
        assert (
            vnca("render", folder, "--out", folder / "strip.png", "--strip", 3, *CAMERA).code == 0
        )
        with Image.open(folder / "strip.png") as image:
            films.append(np.asarray(image, np.float32) / 255)
    np.testing.assert_allclose(*films, atol=2 / 255)
