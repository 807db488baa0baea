"""Along what strokes are told to run, and what painting makes of it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vnca
from vnca.core import AnyArray, Box
from vnca.core.errors import (
    BackendUnavailableError,
    FileFormatError,
    GridError,
    OptionError,
    TextError,
    VncaError,
)
from vnca.core.field import Field
from vnca.core.volume import Volume
from vnca.direction import Direction, Inputs, Moment
from vnca.direction.grammar import parsed_guide
from vnca.direction.guides import inwards, steering
from vnca.direction.guides.picture import strokes_stand
from vnca.engine.automaton import Automaton, Weights, stencil
from vnca.rule.model import Model

MODEL = Path(__file__).parents[1] / "data" / "painting" / "rule.safetensors"
CELLS = np.stack(np.meshgrid(*[np.arange(4, 8)] * 3, indexing="ij"), -1).reshape(-1, 3)
AT = np.stack(np.meshgrid(*[np.arange(12)] * 3, indexing="ij"), -1) - 5.5
"""Where cells of the smoke lie from its middle."""


def moment(
    frame: int = 1,
    *,
    velocity: AnyArray | None = None,
    matrix: AnyArray | None = None,
    up: Any = "z",
) -> Moment:
    density = (8 - np.abs(AT).max(-1)).astype(np.float32)
    moves = None if velocity is None else velocity.astype(np.float32)
    matrix = np.diag([0.5, 0.5, 0.5, 1]) if matrix is None else matrix
    smoke = Volume(density, moves, (0, 0, 0), matrix, frame)
    return Moment(smoke, Box((0, 0, 0), (12, 12, 12)), inputs=Inputs(up=up))


def asked(text: str, where: Moment | None = None) -> AnyArray:
    found = np.asarray(parsed_guide(text, "guide").at(where or moment(), CELLS.astype(np.int32)))
    assert found.shape == CELLS.shape
    lengths = np.linalg.norm(found, axis=1)
    assert ((np.abs(lengths - 1) < 1e-5) | (lengths == 0)).all() or text[0].isdigit()
    return found


def everywhere(*direction: float) -> AnyArray:
    return np.broadcast_to(np.array(direction) / np.linalg.norm(direction), CELLS.shape)


@pytest.mark.parametrize(
    ("text", "direction"),
    [
        ("x", (1, 0, 0)),
        ("z", (0, 0, 1)),
        ("0,1,1", (0, 1, 1)),
        ("-0.5, 0, 2e0", (-0.5, 0, 2)),
        ("(x)", (1, 0, 0)),
        ("cross(x, y)", (0, 0, 1)),
        ("cross(0,1,1, x)", (0, 1, -1)),
        ("1:x 3:y", (1, 0, 0)),
    ],
)
def test_axes_are_directions_of_the_world(text: str, direction: tuple[float, ...]) -> None:
    np.testing.assert_allclose(asked(text), everywhere(*direction), atol=1e-6)


def test_keys_turn_a_guide_over_frames() -> None:
    np.testing.assert_allclose(asked("1:x 3:y", moment(9)), everywhere(0, 1, 0), atol=1e-6)
    np.testing.assert_allclose(asked("1:x 3:y", moment(2)), everywhere(1, 1, 0) / 2**0.5, atol=1e-6)
    np.testing.assert_allclose(asked("hold 1:x 3:y", moment(2)), everywhere(1, 0, 0), atol=1e-6)


def test_directions_follow_the_axes_of_the_file_whatever_those_of_the_cells() -> None:
    swapped = np.zeros((4, 4))
    swapped[0, 1], swapped[1, 0], swapped[2, 2], swapped[3, 3] = 0.5, -0.5, 0.5, 1
    np.testing.assert_allclose(asked("x", moment(matrix=swapped)), everywhere(0, 1, 0), atol=1e-6)
    np.testing.assert_allclose(asked("y", moment(matrix=swapped)), everywhere(-1, 0, 0), atol=1e-6)
    # Of a file with y up, ours is (z, x, y).
    np.testing.assert_allclose(asked("y", moment(up="y")), everywhere(0, 0, 1), atol=1e-6)
    np.testing.assert_allclose(asked("x", moment(up="y")), everywhere(0, 1, 0), atol=1e-6)


def test_the_smoke_has_directions_of_itself() -> None:
    x, y, z = np.moveaxis(AT, -1, 0)
    turning = moment(velocity=np.stack([-y + 20, x, 0 * z], -1))
    np.testing.assert_allclose(asked("curl", turning), everywhere(0, 0, 1), atol=1e-5)
    rising = moment(velocity=np.stack([0 * x, 0 * x, 3 + 0 * x], -1))
    np.testing.assert_allclose(asked("velocity", rising), everywhere(0, 0, 1), atol=1e-6)
    # Density falls from the middle outwards, along the axis on which a cell is farthest.
    inwards = asked("gradient")
    at = AT[tuple(CELLS.T)]
    far = np.abs(at) == 1.5
    single = far.sum(axis=1) == 1
    np.testing.assert_array_equal(
        np.sign(inwards[single][far[single]]), -np.sign(at[single][far[single]])
    )
    assert (asked("curl", rising) == 0).all()
    with pytest.raises(GridError, match="frame 1: `guide`: the smoke has no velocity"):
        asked("curl")


@pytest.mark.parametrize(
    ("text", "at", "why"),
    [
        ("", 0, "expected a direction, got the end"),
        ("w", 0, "'w' is no direction; expected x, y, z, velocity, curl, gradient, curve"),
        ("density", 0, "'density' is no direction"),
        ("1,2", 3, "expected three numbers with commas"),
        ("0,0,0", 0, "of three zeros there is none"),
        ("x y", 2, "expected its end"),
        ("cross(x)", 0, "cross lacks 'second'"),
        ("cross(x, 'a')", 9, "expected a value"),
        ("curve(x)", 6, "expected a text in quotes"),
        ("1:x 1:y", 4, "keys have to be in order"),
        ("x:0..1", 1, "expected its end"),
        ("(x", 2, r"expected '\)'"),
    ],
)  # fmt: skip
def test_what_is_no_guide_is_told_with_its_character(text: str, at: int, why: str) -> None:
    with pytest.raises(TextError, match=why) as error:
        Direction(guide=text)
    assert error.value.at == at


def test_steering_turns_the_frame_of_the_picture_to_direction_and_surface() -> None:
    random = np.random.default_rng(0)
    along, inward = random.standard_normal((2, 50, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    special = np.array([[1, 0, 0], [-1, 0, 0], [0, 0, 0], [-1, 1e-9, 0], [0, 0, 1]])
    along = np.concatenate([along, special])
    inward = np.concatenate([inward, np.zeros((4, 3)), special[-1:]])
    found = steering(along, inward, 1.0, len(along)).astype(np.float64)
    eyes = np.broadcast_to(np.eye(3), found.shape)
    np.testing.assert_allclose(found @ found.transpose(0, 2, 1), eyes, atol=1e-5)
    np.testing.assert_allclose(np.linalg.det(found), 1, atol=1e-5)
    to_right = np.einsum("nij,nj->ni", found, along)[along.any(axis=1)]
    np.testing.assert_allclose(to_right, np.broadcast_to([1, 0, 0], to_right.shape), atol=1e-5)
    np.testing.assert_allclose(found[[50, 52]], eyes[:2], atol=1e-6)
    # What lies inwards is met straight on, as far as the direction lets it.
    turned = np.einsum("nij,nj->ni", found[:50], inward[:50])
    assert (turned[:, 1] > 0).mean() > 0.9
    assert np.abs(turned[:, 2]).max() < 0.1
    # Strokes that stand are laid along it too, and depth stays depth.
    upright = steering(along, inward, 1.0, len(along), standing=True).astype(np.float64)
    quarter = np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]])
    is_guided = along.any(axis=1)
    np.testing.assert_allclose(upright[is_guided], quarter @ found[is_guided], atol=1e-5)
    np.testing.assert_allclose(upright[~is_guided], eyes[~is_guided], atol=1e-6)
    np.testing.assert_allclose(steering(along, inward, 2.0, len(along)), 2 * found, atol=1e-4)
    halves = np.linspace(0.5, 1, len(along))
    np.testing.assert_allclose(
        steering(None, None, halves, len(along)), halves[:, None, None] * eyes, atol=1e-6
    )


def striped(*, across: bool, tilt: float = 0.0) -> AnyArray:
    """A picture of strokes, two pixels wide, that lie `across` it or stand."""
    down, right = np.indices((48, 60)) / 4.0
    waves = np.sin(2 * np.pi * ((down if across else right) + tilt * (down + right)))
    return np.repeat(0.5 + 0.4 * waves[..., None], 3, -1).astype(np.float32)


def test_strokes_of_a_picture_stand_or_lie() -> None:
    lying, standing = striped(across=True, tilt=0.1), striped(across=False, tilt=0.1)
    assert strokes_stand([standing])
    assert not strokes_stand([lying])
    assert not strokes_stand([lying, standing])
    assert not strokes_stand([])
    assert not strokes_stand([np.random.default_rng(0).random((48, 60, 3), np.float32)])
    assert not strokes_stand([np.full((1, 1, 3), 0.5, np.float32)])


def test_inwards_is_where_density_grows() -> None:
    found = inwards(moment(), np.array([[0, 6, 6], [6, 11, 6], [6, 6, 1]], np.int32))
    np.testing.assert_allclose(found, [[1, 0, 0], [0, -1, 0], [0, 0, 1]], atol=1e-6)


def test_strokes_run_along_the_nearest_curve(tmp_path: Path) -> None:
    file = tmp_path / "curves.txt"
    file.write_text("# a corner\n0 0 0\n0,0,10  # up\n\n1 -9 0\n1 0 0\n1 0 0\n1 9 9\n")
    guide = parsed_guide(f'curve("{file}")', "guide")
    cells = np.array([[0, 0, 4], [1, -12, 0], [2, 14, 14]], np.int32)
    np.testing.assert_allclose(
        guide.at(moment(), cells), [[0, 0, 1], unit(0, 1, 0), [0, 0.74, 0.67]], atol=0.15
    )
    assert [*guide.files(Inputs())] == [file]  # pyright: ignore[reportAttributeAccessIssue]


def unit(*direction: float) -> AnyArray:
    return np.array(direction) / np.linalg.norm(direction)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("0 0 0\n1 2\n", r"curve\.txt:2: expected x, y and z of a point, got '1 2'"),
        ("0 0 0\n\n1 2 nan\n", r"curve\.txt:3: expected"),
        ("1 2 3\n\n1 2 3\n", "a curve has two points or more, and there is none"),
        ("0 0 0\n" + "\n".join(f"{i} 0 0" for i in range(1, 10_001)), "more than 10000 points"),
    ],
)
def test_a_file_that_holds_no_curve_is_refused(tmp_path: Path, text: str, why: str) -> None:
    file = tmp_path / "curve.txt"
    file.write_text(text)
    with pytest.raises(FileFormatError, match=why):
        parsed_guide(f'curve("{file}")', "guide").require(Inputs())  # pyright: ignore


Painted = Callable[..., list[dict[str, Any]]]


def assert_same(ones: list[Any], others: list[Any]) -> None:
    for one, other in zip(ones, others, strict=True):
        for name in ("density", "Cd"):
            np.testing.assert_array_equal(one[name], other[name])


def test_size_1_and_a_guide_of_no_direction_change_nothing(
    painted: Painted, add_vectors: Callable[..., None]
) -> None:
    plain = painted()
    assert_same(plain, painted(pattern_size="frame:0..1->0.5..1"))
    add_vectors("still", (0, 0, 0))
    assert_same(plain, painted(guide="@still"))


@pytest.mark.parametrize(
    "options", [{"guide": "x"}, {"pattern_size": 1.5}, {"pattern_size": "x:0..4->0.5..2"}]
)
def test_a_guide_and_a_size_change_the_pattern(painted: Painted, options: dict[str, Any]) -> None:
    plain, changed = painted(refine=2), painted(refine=2, **options)
    for one, other in zip(plain, changed, strict=True):
        assert np.isfinite(other["Cd"]).all()
        assert np.abs(one["Cd"] - other["Cd"]).max() > 1e-4  # of few steps


def test_a_grid_of_vectors_guides(painted: Painted, add_vectors: Callable[..., None]) -> None:
    add_vectors("along", (0, 0, 3))
    assert_same(painted(guide="1:z"), painted(guide="@along"))
    add_vectors("across", (3, 0, 0))
    assert_same(painted(guide="x"), painted(guide="@across"))


def test_a_guide_lays_the_strokes_of_the_picture_along_itself(smoke: Path) -> None:
    """Strokes that stand need the guide turned by a quarter; without a guide they are let be."""
    lying, standing = (
        replace(Model.load(MODEL), style=(255 * striped(across=across)).astype(np.uint8))
        for across in (True, False)
    )

    def painting(model: Model, guide: str | None = None) -> list[AnyArray]:
        return [np.asarray(frame.colour) for frame in vnca.stylize(model, smoke, guide=guide)]

    for one, other in zip(painting(lying), painting(standing), strict=True):
        np.testing.assert_array_equal(one, other)
    guided = zip(painting(lying, guide="x"), painting(standing, guide="x"), strict=True)
    assert all(np.abs(one - other).max() > 1e-4 for one, other in guided)


def test_a_guide_that_frames_lack_is_told_before_the_first(
    painted: Painted, add_grid: Callable[..., None], add_vectors: Callable[..., None]
) -> None:
    with pytest.raises(GridError, match="no grid 'along' among"):
        painted(guide="@along")
    add_grid("mask", np.ones((9, 9, 9), np.float32))
    with pytest.raises(GridError, match="grid 'mask' holds numbers, expected vectors"):
        painted(guide="@mask")
    add_vectors("along", (0, 0, 1), frames=(1, 3))
    with pytest.raises(GridError, match="no grid 'along'"):
        painted(guide="@along")
    assert_same(painted(guide="z"), painted(guide="@along", missing="hold"))
    with pytest.raises(VncaError, match="no such file"):
        painted(guide='curve("nowhere.txt")')


def test_a_backend_that_cannot_steer_says_so_at_once(painted: Painted, smoke: Path) -> None:
    for options in ({"guide": "x"}, {"pattern_size": 2}):
        with pytest.raises(BackendUnavailableError, match="wgsl cannot run: it cannot steer"):
            painted(backend="wgsl", **options)
        in_memory = vnca.stylize(MODEL, smoke, backend="wgsl", **options)
        with pytest.raises(BackendUnavailableError, match="wgsl cannot run: it cannot steer"):
            next(in_memory)


@pytest.mark.parametrize("size", [0.4, 2.1, "0.2 * height", "1:0.5 3:3"])
def test_sizes_that_cannot_be_are_refused(painted: Painted, size: Any) -> None:
    with pytest.raises((OptionError, GridError), match=r"`pattern_size`.* 0.5 to 2"):
        painted(pattern_size=size)


def test_larger_patterns_take_shorter_steps() -> None:
    for size, substeps in ((1, 1), (0.5, 1), (2, 4), (1.5, 3), ("x:0..1->1..1.2", 2), ("@any", 4)):
        assert Direction(pattern_size=size).substeps == substeps
    weights = Weights(*(np.ones(3, np.float32) for _ in range(3)))
    automaton = Automaton(weights, stencil(), 0.5, seed=0)
    assert automaton.slowed(1) is automaton
    np.testing.assert_array_equal(automaton.slowed(4).weights.output, 0.25)
    np.testing.assert_array_equal(automaton.slowed(4).weights.hidden, 1)


def test_a_staggered_grid_is_read_where_its_components_lie() -> None:
    from vnca.direction.masks.grids import Stored

    values = Field.from_dense(
        np.indices((6, 6, 6)).transpose(1, 2, 3, 0).astype(np.float32), (0, 0, 0)
    )
    known = Field.from_dense(np.ones((6, 6, 6), bool), (0, 0, 0), outside=False)
    stored = Stored(values, known, 0.0, np.diag([0.5, 0.5, 0.5, 1]), is_staggered=True)
    at = np.array([[2, 3, 4]], np.int32)
    found = [float(each.at(moment(), at)[0]) for each in stored.components()]  # pyright: ignore
    assert found == pytest.approx([2.5, 3.5, 4.5])
