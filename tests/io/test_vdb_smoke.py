"""Grids that would fill the memory although their files are small."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from vnca.errors import GridError
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
def test_cells_far_apart_are_one_clear_line_and_no_allocation(
    distance: int, tmp_path: Path
) -> None:
    write_vdb(tmp_path / "a.vdb", [two_cells(distance)])
    tracemalloc.start()
    with pytest.raises(GridError, match=r"a\.vdb: grid 'density': 2 active cells are scattered"):
        read_vdb_smoke(tmp_path / "a.vdb", SmokeFormat())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10e6


def test_a_grid_of_one_huge_tile_is_one_clear_line(tmp_path: Path) -> None:
    grid = two_cells(8)
    tile = Tiles(
        np.array([[4096, 0, 0]], np.int32), np.array([4096], np.int32), np.ones(1, "f4"),
        np.ones(1, bool),
    )  # fmt: skip
    grid.tree = grid.tree._replace(tiles=tile)
    write_vdb(tmp_path / "a.vdb", [grid])
    with pytest.raises(GridError, match="scattered"):
        read_vdb_smoke(tmp_path / "a.vdb", SmokeFormat())


def test_sparse_smoke_in_a_large_box_is_read(tmp_path: Path) -> None:
    write_vdb(tmp_path / "a.vdb", [two_cells(256)])
    with open_vdb(tmp_path / "a.vdb") as file:
        _, _, box = read_density(file, SmokeFormat())
    assert box == ((0, 0, 0), (257, 257, 257))
    assert read_vdb_smoke(tmp_path / "a.vdb", SmokeFormat()).density.sum() == 2


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
    with pytest.raises(GridError, match=rf"a\.vdb: no velocity among {listed}.*--velocity-grid"):
        read_vdb_smoke(path, SmokeFormat())
    assert read_vdb_smoke(path, SmokeFormat(velocity_grid="none")).density.sum() == 8
