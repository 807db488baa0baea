"""Velocity on other cells than the density's: what is linear in the world stays so."""

import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vnca.core import AnyArray, Index
from vnca.core.errors import GridError
from vnca.core.volume import Volume
from vnca.io import EXTRAPOLATED_CELLS, read_smoke, write_smoke
from vnca.io.painted import write_painted
from vnca.io.smoke_format import UNITS_METADATA, SmokeFormat
from vnca.io.vdb import Grid, Transform, open_vdb, write_vdb
from vnca.io.vdb.layout import encode_string
from vnca.io.vdb_velocity import listed_vectors, velocity_headers

METRES = SmokeFormat(velocity_units="m/s", fps=10)
FINE, COARSE = (np.diag([size, size, size, 1.0]) for size in (0.5, 1.0))
SHAPE, ORIGIN = (5, 6, 7), (10, -3, 2)
SIDES = st.tuples(*[st.sampled_from([0.25, 0.4, 0.5, 1.0, 1.7, -0.6])] * 3)


def grid(name: str, values: AnyArray, matrix: AnyArray, origin: Index, **options: Any) -> Grid:
    active = options.pop("active", np.ones(values.shape[:3], np.bool_))
    values = values.astype(np.float32)
    transform = Transform.from_matrix(matrix)
    return Grid.from_dense(name, values, active, origin, transform=transform, **options)


def smoke(matrix: AnyArray = FINE) -> Grid:
    return grid("density", np.ones(SHAPE), matrix, ORIGIN)


def places(matrix: AnyArray, shape: Index = SHAPE, origin: Index = ORIGIN) -> AnyArray:
    """World coordinates `[x, y, z, 3]` of cells' centres."""
    cells = np.stack(np.indices(shape), axis=-1) + np.array(origin)
    return cells @ matrix[:3, :3].T + matrix[:3, 3]


def wind(at: AnyArray) -> AnyArray:
    """Metres per second; linear in each direction."""
    return at @ np.array([[0.5, -1, 0.25], [0.75, 0.5, 1], [-0.5, 0.25, 1]]) + (3, -2, 1)


def around(matrix: AnyArray, density: AnyArray = FINE) -> tuple[Index, Index]:
    """Shape and origin of a box of a grid's cells with two more on all sides of the density."""
    to_its = np.linalg.solve(matrix, density)
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    ends = (corners * SHAPE + np.array(ORIGIN)) @ to_its[:3, :3].T + to_its[:3, 3]
    lower, upper = np.floor(ends.min(axis=0)) - 2, np.ceil(ends.max(axis=0)) + 3
    x, y, z = (int(low) for low in lower)
    i, j, k = (int(cells) for cells in upper - lower)
    return (i, j, k), (x, y, z)


def saved(path: Path, *grids: Grid) -> Path:
    write_vdb(path, grids)
    return path


def velocity(path: Path, format: SmokeFormat) -> AnyArray:
    found = read_smoke(path, format).velocity
    assert found is not None
    return found


def rotation(axis: int, angle: float) -> AnyArray:
    matrix, (a, b) = np.eye(4), [other for other in range(3) if other != axis]
    matrix[a, a] = matrix[b, b] = np.cos(angle)
    matrix[a, b] = -np.sin(angle)
    matrix[b, a] = -matrix[a, b]
    return matrix


@settings(
    deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(SIDES, st.integers(0, 2), st.floats(-3, 3), st.tuples(*[st.floats(-20, 20)] * 3))
def test_wind_in_metres_is_the_same_wind_whatever_cells_it_is_stored_in(
    tmp_path: Path, sides: tuple[float, ...], axis: int, angle: float, shift: tuple[float, ...]
) -> None:
    matrix = rotation(axis, angle) @ np.diag([*sides, 1.0])
    matrix[:3, 3] = shift
    shape, origin = around(matrix)
    stored = grid("vel", wind(places(matrix, shape, origin)), matrix, origin)
    found = velocity(saved(tmp_path / "s.vdb", smoke(), stored), METRES)
    np.testing.assert_allclose(found, wind(places(FINE)) / (10 * 0.5), rtol=1e-4, atol=1e-4)


def test_metres_are_turned_into_the_cells_of_a_turned_density(tmp_path: Path) -> None:
    turned = rotation(2, 0.3) @ np.diag([0.5, -0.25, 1.0, 1.0])
    shape, origin = around(COARSE, turned)
    stored = grid("vel", wind(places(COARSE, shape, origin)), COARSE, origin)
    found = read_smoke(saved(tmp_path / "s.vdb", smoke(turned), stored), METRES)
    matrix = found.index_to_world
    at = places(matrix, found.box.shape, found.origin)
    expected = wind(at) @ np.linalg.inv(matrix[:3, :3]).T / 10
    np.testing.assert_allclose(found.velocity, expected, rtol=1e-4, atol=1e-4)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "told", "factor"),
    [
        ({}, False, 1),
        ({"velocity_units": "mantaflow", "fps": 25, "time_scale": 0.5}, False, 0.05),
        ({"velocity_units": "m/s", "fps": 7}, True, 1),
    ],
)
def test_units_of_cells_are_of_the_cells_of_the_velocity(
    tmp_path: Path, options: dict[str, Any], told: bool, factor: float
) -> None:
    stretched = np.diag([1.0, 2.0, 0.5, 1.0])
    shape, origin = around(stretched)
    metadata = {UNITS_METADATA: "cells/frame"} if told else {}
    moving = np.broadcast_to([1.0, -2.0, 4.0], (*shape, 3))
    stored = grid("vel", moving, stretched, origin, metadata=metadata)
    path = saved(tmp_path / "s.vdb", smoke(), stored)
    expected = np.broadcast_to(factor * np.array([2, -8, 4]), (*SHAPE, 3))
    np.testing.assert_allclose(velocity(path, SmokeFormat(**options)), expected, rtol=1e-6)
    up_y = velocity(path, SmokeFormat(**options, up_axis="y"))
    np.testing.assert_allclose(up_y[0, 0, 0], expected[0, 0, 0][[2, 0, 1]], rtol=1e-6)


def on_faces(matrix: AnyArray, shape: Index, origin: Index) -> AnyArray:
    """Each component of the wind on the lower faces of its cells."""
    return np.stack(
        [
            wind(places(matrix, shape, origin) - 0.5 * matrix[:3, axis])[..., axis]
            for axis in range(3)
        ],
        axis=-1,
    )


@pytest.mark.parametrize(
    ("grid_class", "staggered"), [("staggered", None), ("unknown", True), ("fog volume", True)]
)
@pytest.mark.parametrize("scalars", [False, True])
def test_staggered_velocity_lies_on_the_faces_of_its_own_cells(
    tmp_path: Path, grid_class: str, staggered: bool | None, scalars: bool
) -> None:
    shape, origin = around(COARSE)
    values = on_faces(COARSE, shape, origin)
    parts = [("vel.x", values[..., 0]), ("vel.y", values[..., 1]), ("vel.z", values[..., 2])]
    grids = [
        grid(name, part, COARSE, origin, grid_class=grid_class)
        for name, part in (parts if scalars else [("vel", values)])
    ]
    path = saved(tmp_path / "s.vdb", smoke(), *grids)
    found = velocity(path, replace(METRES, staggered=staggered))
    np.testing.assert_allclose(found, wind(places(FINE)) / 5, rtol=1e-5, atol=1e-5)
    centres = velocity(path, replace(METRES, staggered=False))
    assert np.abs(centres - found).max() > 0.01


@pytest.mark.parametrize("staggered", [None, True, False])
def test_components_on_places_of_their_own_lie_there(
    tmp_path: Path, staggered: bool | None
) -> None:
    """As Houdini writes faces: each component in a grid that is half a cell lower on its axis."""
    shape, origin = around(COARSE)
    values = on_faces(COARSE, shape, origin)
    parts = []
    for axis in range(3):
        moved = COARSE.copy()
        moved[axis, 3] = -0.5
        parts.append(grid(f"vel.{'xyz'[axis]}", values[..., axis], moved, origin))
    path = saved(tmp_path / "s.vdb", smoke(), *parts)
    found = velocity(path, replace(METRES, staggered=staggered))
    np.testing.assert_allclose(found, wind(places(FINE)) / 5, rtol=1e-5, atol=1e-5)


def test_beyond_what_is_stored_velocity_is_continued_a_few_cells(tmp_path: Path) -> None:
    shape, origin = around(COARSE)
    active = np.zeros(shape, np.bool_)
    active[:3] = True  # up to x = origin + 2 metres
    constant = np.broadcast_to([2.0, 0, 0], (*shape, 3))
    stored = grid("vel", constant, COARSE, origin, active=active)
    long = grid("density", np.ones((20, *SHAPE[1:])), FINE, ORIGIN)
    along = velocity(saved(tmp_path / "s.vdb", long, stored), METRES)[:, 0, 0, 0]
    # Between the last centre and the next one, its velocity counts alone.
    known = int(np.sum(places(FINE, (20, 1, 1))[:, 0, 0, 0] < origin[0] + 3))
    assert 0 < known < 20 - EXTRAPOLATED_CELLS
    np.testing.assert_allclose(along[: known + EXTRAPOLATED_CELLS], 0.4, rtol=1e-6)
    assert not along[known + EXTRAPOLATED_CELLS :].any()


def test_resting_smoke_on_other_cells_may_store_no_velocity(tmp_path: Path) -> None:
    shape, origin = around(COARSE)
    nothing = np.zeros(shape, np.bool_)
    stored = grid("vel", np.ones((*shape, 3)), COARSE, origin, active=nothing)
    assert not velocity(saved(tmp_path / "s.vdb", smoke(), stored), METRES).any()


def test_what_is_painted_finer_keeps_its_motion_when_it_is_read(tmp_path: Path) -> None:
    """Its density is refined, its velocity is the one of the source."""
    volume = Volume(np.ones((6, 6, 6), np.float32), None, (0, 0, 0), np.eye(4), 1)
    moving = np.broadcast_to(np.float32([1, 2, 3]), (6, 6, 6, 3)).copy()
    write_smoke(tmp_path / "source.vdb", replace(volume, velocity=moving))
    fine = read_smoke(tmp_path / "source.vdb", SmokeFormat()).refined(2)
    write_painted(
        tmp_path / "painted.vdb",
        tmp_path / "source.vdb",
        SmokeFormat(),
        density=fine.density,
        colour=np.ones((*fine.density.shape, 3), np.float32),
        box=fine.box,
        refine=2,
    )
    again = read_smoke(tmp_path / "painted.vdb", SmokeFormat())
    np.testing.assert_allclose(again.velocity, fine.velocity, rtol=1e-6)  # type: ignore[arg-type]


def far(matrix: AnyArray) -> list[Grid]:
    return [grid("vel", np.ones((3, 3, 3, 3)), matrix, (900, 0, 0))]


def different(matrix: AnyArray) -> list[Grid]:
    shape, origin = around(matrix)
    coarser = np.diag([2.0, 2.0, 2.0, 1.0])
    parts = (("vel.x", matrix), ("vel.y", matrix), ("vel.z", coarser))
    return [grid(name, np.ones(shape), its, origin) for name, its in parts]


def spoiled(matrix: AnyArray) -> list[Grid]:
    shape, origin = around(matrix)
    values = np.ones((*shape, 3))
    values[4, 4, 4, 1] = np.nan
    return [grid("vel", values, matrix, origin)]


def countless(_: AnyArray) -> list[Grid]:
    minute = np.diag([1e-3, 1e-3, 1e-3, 1.0])
    active = np.zeros((9, 9, 9), np.bool_)
    active[0, 0, 0] = active[-1, -1, -1] = True
    first = grid("vel.x", np.ones((9, 9, 9)), minute, (4990, -1510, 990), active=active)
    last = Grid.from_dense(
        "vel.x", np.ones((9, 9, 9), np.float32), active, (7000, 1000, 4000), like=first
    )
    both = first.tree._replace(
        leaf_origins=np.concatenate([first.tree.leaf_origins, last.tree.leaf_origins]),
        leaf_active=np.concatenate([first.tree.leaf_active, last.tree.leaf_active]),
        leaf_values=np.concatenate([first.tree.leaf_values, last.tree.leaf_values]),
    )
    return [Grid(f"vel.{axis}", "float", first.transform, both, first.metadata) for axis in "xyz"]


@pytest.mark.parametrize(
    ("grids", "words"),
    [
        (far, "velocity grid 'vel' has no value near the smoke.*`velocity_grid` none"),
        (different, r"grids 'vel\.x' and 'vel\.z' differ in their voxels.*`velocity_grid` none"),
        (spoiled, "grid 'vel': 1 of .* values are NaN"),
        (
            countless,
            r"grid 'vel\.x' has more cells where the smoke is than \d+.*`velocity_grid` none",
        ),
    ],
)
def test_what_cannot_be_resampled_is_one_line_that_names_the_way_out(
    tmp_path: Path, grids: Callable[[AnyArray], list[Grid]], words: str
) -> None:
    path = saved(tmp_path / "s.vdb", smoke(), *grids(COARSE))
    with pytest.raises(GridError, match=words) as caught:
        read_smoke(path, METRES)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
    assert read_smoke(path, SmokeFormat(velocity_grid="none")).velocity is None


def named(folder: Path, *names: str) -> Path:
    """A file of grids; a name that ends in `!` is one of vectors."""
    active = np.ones((2, 2, 2), np.bool_)
    write_vdb(
        folder / "s.vdb",
        [
            Grid.from_dense(
                name.removesuffix("!"),
                np.ones((2, 2, 2, 3) if name.endswith("!") else (2, 2, 2), np.float32),
                active,
                (0, 0, 0),
                transform=Transform.uniform(1),
            )
            for name in ("density", *names)
        ],
    )
    return folder / "s.vdb"


def found(path: Path, velocity_grid: str | None = None) -> list[str]:
    with open_vdb(path) as file:
        return [h.name for h in velocity_headers(file, SmokeFormat(velocity_grid=velocity_grid))]


def three(shared: str, axes: str = "xyz") -> list[str]:
    return [shared + axis for axis in axes]


@pytest.mark.parametrize("name", ["velocity", "vel", "v"])
def test_velocity_is_found_in_any_case_and_with_any_separator(tmp_path: Path, name: str) -> None:
    for spelt in (name, name.capitalize(), name.upper()):
        assert found(named(tmp_path, f"{spelt}!", "Cd!")) == [spelt]
        for separator in (".", "_", ""):
            for axes in ("xyz", "XYZ", "uvw", "UVW"):
                parts = three(spelt + separator, axes)
                assert found(named(tmp_path, *reversed(parts), "fuel")) == parts


def test_exact_names_come_first_in_their_order(tmp_path: Path) -> None:
    assert found(named(tmp_path, "Velocity!", "vel_x", "vel_y", "vel_z", "v!")) == ["v"]
    assert found(named(tmp_path, "v!", "vel!", "velocity!")) == ["velocity"]
    assert found(named(tmp_path, "Velocity!", *three("vel."))) == three("vel.")


@pytest.mark.parametrize(
    "names",
    [
        ("Velocity!", *three("vel_")),
        ("Velocity!", "Vel!"),
        (*three("vel_"), *three("v")),
        (*three("vel"), *three("vel", "XYZ")),
    ],
)
def test_of_two_that_could_be_it_both_are_named_and_either_can_be_chosen(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    path = named(tmp_path, *names)
    choices = [name.removesuffix("!") for name in names if name[-1] in "!xX"]
    assert len(choices) == 2
    with pytest.raises(GridError, match=f"choose with `velocity_grid` from {', '.join(choices)}$"):
        found(path)
    for choice in choices:
        assert found(path, choice)[0] == choice


def test_a_name_that_is_asked_for_may_be_any(tmp_path: Path) -> None:
    path = named(tmp_path, "wind!", *three("Gust_", "XYZ"), "velocity!")
    assert found(path, "wind") == found(path, "Wind") == ["wind"]
    assert found(path, "gust") == found(path, "Gust_X") == three("Gust_", "XYZ")
    assert found(path, "none") == []
    with pytest.raises(GridError, match=r"no velocity 'breeze'; choose .* wind \(vec3s\)"):
        found(path, "breeze")


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("vel_x", "vel_z"), "velocity 'vel' lacks the scalar grid vel_y; leave"),
        (("VelocityY",), "velocity 'Velocity' lacks the scalar grid VelocityX, VelocityZ"),
        (("vel.x", "vel.y", "vel.z!"), r"lacks the scalar grid vel\.z"),
    ],
)
def test_a_component_that_is_missing_is_named(
    tmp_path: Path, names: tuple[str, ...], words: str
) -> None:
    with pytest.raises(GridError, match=words):
        found(named(tmp_path, *names))


class Frustum(Transform):
    """A map of OpenVDB's that is not linear, as a file has it."""

    def encode(self) -> bytes:
        behind = struct.pack("<8d", 0, 0, 0, 1, 1, 1, 0.5, 1) + super().encode()
        return encode_string(b"NonlinearFrustumMap") + behind


@pytest.mark.parametrize("names", [("vel!",), ("Velocity!",), ("vel.x", "vel.y", "vel.z")])
def test_a_velocity_in_a_frustum_is_refused_by_its_name(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    path = named(tmp_path, *names, "wind!")
    with open_vdb(path) as file:
        grids = [header.read() for header in file.grids.values()]
    for grid in grids[1:-1]:
        grid.transform = Frustum(grid.transform.map_type, grid.transform.numbers)
    write_vdb(path, grids)
    first = names[0].removesuffix("!")
    line = (
        rf"s\.vdb: velocity grid '{first}' has a NonlinearFrustumMap, .*; choose another with "
        "`velocity_grid`, or leave it out with `velocity_grid` none$"
    )
    for asked in (None, first):
        with pytest.raises(GridError, match=line):
            found(path, asked)
        with pytest.raises(GridError, match=line):
            read_smoke(path, SmokeFormat(velocity_grid=asked))
    for chosen, has_velocity in (("wind", True), ("none", False)):
        smoke = read_smoke(path, SmokeFormat(velocity_grid=chosen))
        assert (smoke.velocity is not None) is has_velocity


@pytest.mark.parametrize("name", ["vel", "V", "velocity"])
def test_a_velocity_of_an_unknown_type_is_refused_by_its_name(tmp_path: Path, name: str) -> None:
    path = named(tmp_path, f"{name}!", "wind!")
    data = path.read_bytes()
    at = data.index(b"Tree_vec3s")
    path.write_bytes(data[:at] + data[at:].replace(b"Tree_vec3s", b"Tree_vec3h", 1))
    line = (
        rf"s\.vdb: grid '{name}' is of type vec3h, which cannot be read as velocity; "
        "choose another with `velocity_grid`, or leave it out with `velocity_grid` none$"
    )
    for asked in (None, name):
        with pytest.raises(GridError, match=line):
            read_smoke(path, SmokeFormat(velocity_grid=asked))
    assert found(path, "wind") == ["wind"]
    assert read_smoke(path, SmokeFormat(velocity_grid="none")).velocity is None


def test_a_velocity_of_a_known_type_is_found_beside_one_of_an_unknown(tmp_path: Path) -> None:
    path = named(tmp_path, "velocity!", "vel!")
    data = path.read_bytes()
    path.write_bytes(data.replace(b"Tree_vec3s", b"Tree_vec3h", 1))
    assert found(path) == ["vel"]


def test_other_grids_are_no_velocity_but_are_listed(tmp_path: Path) -> None:
    path = named(tmp_path, "Cd!", *three("wind."), "fuel", "axis_x", "x", "y", "z")
    assert found(path) == []
    with open_vdb(path) as file:
        assert listed_vectors(file) == "Cd (vec3s), wind.x with wind.y and wind.z"
    with open_vdb(named(tmp_path, "heat")) as file:
        assert listed_vectors(file) == ""


@pytest.mark.parametrize("axes", ["uvw", "UVW"])
def test_bare_u_v_and_w_may_be_coordinates_of_a_texture_and_have_to_be_chosen(
    tmp_path: Path, axes: str
) -> None:
    path = named(tmp_path, *axes)
    assert found(path) == []
    with open_vdb(path) as file:
        assert listed_vectors(file) == "{} with {} and {}".format(*axes)
    assert found(path, axes[0]) == [*axes]
    assert found(named(tmp_path, *axes, "vel!")) == ["vel"]
    with open_vdb(named(tmp_path, *axes[:2], "w!")) as file:
        assert listed_vectors(file) == "w (vec3s)"
