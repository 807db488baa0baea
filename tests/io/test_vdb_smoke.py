"""Grids whose cells lie far apart, or would fill the memory although their files are small."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from vnca.core import Box
from vnca.core.errors import GridError
from vnca.io import read_smoke
from vnca.io.smoke_format import SmokeFormat
from vnca.io.vdb import Grid, Metadata, Tiles, Transform, Tree, open_vdb, write_vdb
from vnca.io.vdb_smoke import read_density, read_vdb_smoke


def two_cells(distance: int) -> Grid:
    """A grid with two active cells, as far apart along every axis."""
    origins = np.array([[0, 0, 0], [distance] * 3], np.int32)
    active = np.zeros((2, 512), bool)
    active[:, 0] = True
    no_tiles = Tiles(
        np.empty((0, 3), np.int32), np.empty(0, np.int32), np.empty(0, "f4"), np.empty(0, bool)
    )
    tree = Tree(np.float32(0), origins, active, active.astype(np.float32), no_tiles)
    return Grid("density", "float", Transform.uniform(1), tree, Metadata())


@pytest.mark.parametrize("distance", [2**31 - 8, 2**20, 600])
def test_cells_far_apart_take_what_they_take_side_by_side(distance: int, tmp_path: Path) -> None:
    peaks = []
    for apart in (8, distance):
        write_vdb(tmp_path / "a.vdb", [two_cells(apart), wind(apart)])
        tracemalloc.start()
        smoke = read_smoke(tmp_path / "a.vdb", SmokeFormat())
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert smoke.box == ((0, 0, 0), (apart + 1,) * 3)
        assert smoke.density_field.values.sum() == 2
        velocity = smoke.velocity_field
        assert velocity is not None
        at = np.array([[0, 0, 4], [0, 0, 5], [apart] * 3, [apart, apart, apart - 4]])
        np.testing.assert_array_equal(velocity.gather(at)[:, 2], [3, 0, 3, 3])
    assert peaks[1] < 1.1 * peaks[0]
    if distance > 600:
        with pytest.raises(GridError, match=r"frame 0: scattered over cells \(0, 0, 0\) to"):
            smoke.density  # noqa: B018


def wind(distance: int) -> Grid:
    grid = two_cells(distance)
    values = grid.tree.leaf_values[..., None] * np.array([0, 0, 3], np.float32)
    no_tiles = grid.tree.tiles._replace(values=np.empty((0, 3), "f4"))
    tree = grid.tree._replace(leaf_values=values, tiles=no_tiles, background=np.zeros(3, "f4"))
    return Grid("velocity", "vec3s", grid.transform, tree, Metadata())


def tiles(origin: int, edge: int, value: object) -> Tiles:
    values = np.array([value], np.float32)
    return Tiles(
        np.full((1, 3), origin, np.int32), np.array([edge], np.int32), values, np.ones(1, bool)
    )


def test_a_grid_of_one_huge_tile_is_one_clear_line(tmp_path: Path) -> None:
    grid = two_cells(8)
    grid.tree = grid.tree._replace(tiles=tiles(4096, 4096, 1))
    write_vdb(tmp_path / "a.vdb", [grid])
    with pytest.raises(GridError, match=r"68719476738 active cells in .* are too many to hold"):
        read_vdb_smoke(tmp_path / "a.vdb", SmokeFormat())


@pytest.mark.parametrize("edge", [8, 128])
def test_tiles_of_density_are_smoke(edge: int, tmp_path: Path) -> None:
    grid = two_cells(512)
    grid.tree = grid.tree._replace(tiles=tiles(128, edge, 0.5))
    write_vdb(tmp_path / "a.vdb", [grid])
    density = read_smoke(tmp_path / "a.vdb", SmokeFormat()).density_field
    assert density.values.sum() == 2 + edge**3 / 2
    assert density.dense(Box((128,) * 3, (128 + edge,) * 3)).min() == 0.5


def test_a_tile_of_wind_blows_where_the_smoke_is_however_large_it_is(tmp_path: Path) -> None:
    smoke, air = two_cells(4088), wind(4088)
    air.tree = air.tree._replace(
        leaf_origins=air.tree.leaf_origins[:0],
        leaf_values=air.tree.leaf_values[:0],
        leaf_active=air.tree.leaf_active[:0],
        tiles=tiles(0, 4096, (0, 0, 3)),
    )
    write_vdb(tmp_path / "a.vdb", [smoke, air])
    velocity = read_smoke(tmp_path / "a.vdb", SmokeFormat()).velocity_field
    assert velocity is not None
    assert velocity.values.nbytes < 1e6
    at = np.array([[0, 0, 0], [7, 7, 7], [4088, 4088, 4080]])
    np.testing.assert_array_equal(velocity.gather(at), [[0, 0, 3]] * 3)


def test_sparse_smoke_in_a_large_box_becomes_an_array_when_it_is_asked_for(tmp_path: Path) -> None:
    write_vdb(tmp_path / "a.vdb", [two_cells(256)])
    with open_vdb(tmp_path / "a.vdb") as file:
        _, _, box = read_density(file, SmokeFormat())
    assert box == ((0, 0, 0), (257, 257, 257))
    assert read_smoke(tmp_path / "a.vdb", SmokeFormat()).density.sum() == 2


def test_a_velocity_that_may_lie_where_nothing_is_found_is_not_taken_for_none(
    tmp_path: Path,
) -> None:
    path, active = tmp_path / "a.vdb", np.ones((2, 2, 2), bool)
    grids = [
        Grid.from_dense(
            name, np.ones(shape, dtype), active, (0, 0, 0), transform=Transform.uniform(1)
        )
        for name, shape, dtype in (
            ("density", (2, 2, 2), "f4"),
            ("odd", (2, 2, 2), "f8"),
            ("vel", (2, 2, 2, 3), "f4"),
        )
    ]
    write_vdb(path, grids)
    data = path.read_bytes().replace(b"Tree_double_5_4_3", b"Tree_points_5_4_3")
    path.write_bytes(data)
    assert read_vdb_smoke(path, SmokeFormat()).velocity is not None
    path.write_bytes(data[:20] + b"\0" + data[21:])  # as a stream
    listed = r"density \(float\), odd \(points\), 1 more that cannot be found behind it"
    with pytest.raises(GridError, match=rf"a\.vdb: no velocity among {listed}.*`velocity_grid`"):
        read_vdb_smoke(path, SmokeFormat())
    assert read_vdb_smoke(path, SmokeFormat(velocity_grid="none")).density.values.sum() == 8
