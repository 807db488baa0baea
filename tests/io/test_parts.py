"""Parts of frames: what the whole has there."""

from pathlib import Path

import numpy as np
import pytest

from vnca.core import Box
from vnca.core.errors import GridError
from vnca.core.lattice import Lattice
from vnca.core.volume import Volume
from vnca.io import SmokeFormat, open_source, read_smoke, write_smoke
from vnca.io.parts import VdbSmoke, WholeSmoke, open_parts, smoke_cells
from vnca.io.vdb import Grid, Transform, open_vdb, write_vdb

CACHE = Path(__file__).parents[1] / "data" / "plume_sphere_0030.vdb"
BLENDER = SmokeFormat(velocity_units="mantaflow", time_scale=0.4)


def lattice_of(path: Path, format: SmokeFormat) -> Lattice:
    return Lattice.of(read_smoke(path, format).index_to_world, str(path))


def require_alike(path: Path, format: SmokeFormat, boxes: list[Box]) -> None:
    lattice = lattice_of(path, format)
    whole = read_smoke(path, format, frame=7, lattice=lattice)
    file = open_source(path)
    assert file is not None
    with file:
        parts = open_parts(path, format, frame=7, lattice=lattice, file=file)
        assert isinstance(parts, VdbSmoke)
        assert (parts.box, parts.frame) == (whole.box, 7)
        for box in boxes:
            part = parts.part(box)
            assert part.box == whole.box
            np.testing.assert_array_equal(part.index_to_world, whole.index_to_world)
            fields = [(part.density_field, whole.density_field)]
            if whole.velocity_field is not None:
                assert part.velocity_field is not None
                fields.append((part.velocity_field, whole.velocity_field))
            fields += [(part.named_fields[n], f) for n, f in whole.named_fields.items()]
            for found, expected in fields:
                np.testing.assert_array_equal(found.dense(box), expected.dense(box))
            inside = whole.density_field.dense(box).any()
            assert parts.holds(box) or not inside
            assert len(part.density_field.bricks) <= len(whole.density_field.bricks)
        parts.require(parts.seen)


def test_parts_of_blenders_smoke_are_those_of_the_whole() -> None:
    lower, upper = read_smoke(CACHE, BLENDER).box
    middle = [(low + high) // 2 for low, high in zip(lower, upper, strict=True)]
    x, y, z = middle
    boxes = [
        Box((x - 3, y - 5, z), (x + 9, y + 1, z + 8)),
        Box((x, y, z - 30), (x + 16, y + 16, z - 14)),
        Box(lower, (x, y, z)),
    ]
    require_alike(CACHE, BLENDER, boxes)
    lattice = lattice_of(CACHE, BLENDER)
    with open_vdb(CACHE) as file:
        parts = open_parts(CACHE, BLENDER, frame=1, lattice=lattice, file=file)
        part = parts.part(boxes[1])
    whole = read_smoke(CACHE, BLENDER)
    assert len(part.density_field.bricks) < 0.5 * len(whole.density_field.bricks)


@pytest.mark.parametrize("turn", [[0, 1, 2], [2, 0, 1], [1, 0, 2]])
def test_parts_lie_right_whatever_the_axes(tmp_path: Path, tiny_smoke: Volume, turn: list) -> None:
    """Exchanged, and with mirrored cells."""
    write_smoke(tmp_path / "plain.vdb", tiny_smoke)
    matrix = np.eye(4)
    matrix[:3, :3] = 0.1 * np.eye(3)[turn] * [1, -1, 1]
    with open_vdb(tmp_path / "plain.vdb") as file:
        grids = [file.read(name) for name in file.names]
    for grid in grids:
        grid.transform = Transform.from_matrix(matrix)
    write_vdb(tmp_path / "turned.vdb", grids)
    box = read_smoke(tmp_path / "turned.vdb").box
    x, y, z = box.lower
    parts = [Box((x + 2, y, z + 1), (x + 9, y + 6, z + 5)), box]
    require_alike(tmp_path / "turned.vdb", SmokeFormat(), parts)


def test_active_tiles_are_in_parts_too(tmp_path: Path) -> None:
    tiles = Path(__file__).parents[1] / "data"
    found = []
    for path in sorted(tiles.glob("*.vdb")):
        with open_vdb(path) as file:
            if any(len(file.read(n).tree.tiles.edges) for n in file.names if n == "density"):
                found.append(path)
    for path in found:
        require_alike(path, SmokeFormat(), [read_smoke(path).box])


def test_smoke_on_other_cells_is_read_as_a_whole(tmp_path: Path, tiny_smoke: Volume) -> None:
    path = tmp_path / "ball.vdb"
    write_smoke(path, tiny_smoke)
    apart = Lattice(np.diag([0.07, 0.07, 0.07, 1.0]))
    with open_vdb(path) as file:
        parts = open_parts(path, SmokeFormat(), frame=1, lattice=apart, file=file)
    assert isinstance(parts, WholeSmoke)
    whole = read_smoke(path, lattice=apart, frame=1)
    box = Box((0, 5, 10), (9, 12, 17))
    part = parts.part(box)
    assert (part.box, parts.frame) == (whole.box, 1)
    np.testing.assert_array_equal(part.density_field.dense(box), whole.density_field.dense(box))
    assert part.velocity_field is not None
    assert parts.part(box, motion=False).velocity_field is None


def test_density_below_zero_is_refused_once_all_of_it_was_read(tmp_path: Path) -> None:
    values = np.ones((16, 8, 8), np.float32)
    values[:8] = -0.5
    transform = Transform.from_matrix(np.eye(4))
    grid = Grid.from_dense("density", values, values != 0, (0, 0, 0), transform=transform)
    path = tmp_path / "below.vdb"
    write_vdb(path, [grid])
    with open_vdb(path) as file:
        lattice = Lattice(np.eye(4))
        parts = open_parts(path, SmokeFormat(), frame=1, lattice=lattice, file=file)
        for x in (0, 8):
            parts.part(Box((x, 0, 0), (x + 8, 8, 8)))
        with pytest.raises(GridError, match=r"density goes from -0\.5 to 1"):
            parts.require(parts.seen)


def test_headers_tell_how_much_smoke_there_is(tmp_path: Path, tiny_smoke: Volume) -> None:
    write_smoke(tmp_path / "ball.vdb", tiny_smoke)
    count = int((tiny_smoke.density > 0).sum())
    assert smoke_cells(tmp_path / "ball.vdb", SmokeFormat()) == count
    assert smoke_cells(tmp_path / "none.vdb", SmokeFormat()) == 0
