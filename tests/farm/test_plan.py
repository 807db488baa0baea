"""What a painting takes: cells counted in headers, and what follows from what a cell costs."""

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vnca.core import Box
from vnca.core.field import Field
from vnca.core.volume import Volume
from vnca.engine.domain import Domain
from vnca.farm.count import Count, active_cells, around, counted
from vnca.farm.exchange import exchanged
from vnca.farm.plan import Costs, Line, planned
from vnca.io import SmokeFormat, read_smoke, write_smoke
from vnca.io.sequence import Frame, find_frames
from vnca.io.vdb import open_vdb
from vnca.painting import Roll, StylizeConfig
from vnca.recipe import SILENT
from vnca.recipe.sequence import sequence_region
from vnca.rule import Rule, RuleConfig, Scales

DATA = Path(__file__).parent.parent / "data"
FORMAT = SmokeFormat()


@pytest.mark.parametrize("name", ["plume_sphere_0030.vdb", "painting/plume_0006.vdb"])
def test_active_cells_are_known_without_their_values(name: str) -> None:
    with open_vdb(DATA / name) as file:
        for header in file.grids.values():
            known, whole = header.read_active(), header.read()
            assert known.active_voxels == whole.active_voxels
            assert known.active_box() == whole.active_box()
            box = whole.active_box()
            if not box.is_empty:
                assert np.array_equal(known.to_dense(box)[1], whole.to_dense(box)[1])


@pytest.mark.parametrize("kind", ["active", "box"])
def test_cells_are_counted_as_they_are_painted(
    tiny_smoke: Volume, tmp_path: Path, kind: str
) -> None:
    """All that is stored counts as smoke here, so that the bound is reached."""
    for number in (1, 2):
        density = np.where(tiny_smoke.density > 0.1, tiny_smoke.density, 0).astype(np.float32)
        moved = replace(tiny_smoke, density=density, origin=(0, 3 * number, 0), frame=number)
        write_smoke(tmp_path / f"ball_{number}.vdb", moved)
    sequence = find_frames(tmp_path)
    region = sequence_region(sequence, FORMAT, SILENT)
    config = RuleConfig(channels=6, hidden=8, domain=kind)  # type: ignore[arg-type]
    rule = Rule.initial(config, Scales(), seed=0)
    roll = Roll(rule, StylizeConfig(), region.box)
    counts = counted(sequence, FORMAT, region, config.dilation, config.domain)
    for frame, count in zip(sequence, counts, strict=True):
        smoke = read_smoke(frame.path, FORMAT, lattice=region.lattice)
        assert count.cells == len(roll.ready(smoke).domain)
        assert count.smoke == np.count_nonzero(smoke.density)


def test_of_real_smoke_the_count_is_a_bound() -> None:
    path = DATA / "plume_sphere_0030.vdb"
    active = active_cells(Frame(30, path), FORMAT)
    density = read_smoke(path, FORMAT).density_field
    box = density.box.grown(1)
    painted = Domain.around_smoke(density, threshold=0.01, dilation=1, box=box)
    bound = int(around(active.cells, 1).values.sum())
    assert len(painted) <= bound
    assert 0 < active.copied < path.stat().st_size
    assert active.half


def test_formats_without_a_tree_are_read(tiny_smoke: Volume, tmp_path: Path) -> None:
    (tmp_path / "d").mkdir()
    values = tiny_smoke.density.transpose(2, 1, 0)[..., None]
    np.savez_compressed(tmp_path / "d" / "001.npz", x=values)
    frame = find_frames(tmp_path)[0]
    active = active_cells(frame, SmokeFormat(velocity_grid="none"))
    assert int(active.cells.values.sum()) == np.count_nonzero(values)
    assert active[1:] == (1, 0, False)


@pytest.mark.parametrize(("tile", "halo"), [(8, 1), (8, 8), (16, 3), (24, 8)])
def test_what_tiles_exchange_is_what_lies_in_their_ghost_zones(tile: int, halo: int) -> None:
    """Of a box that is full, where the share of each brick is known exactly."""
    sides = (32, 24, 48)
    full = Field.from_dense(np.ones(sides, bool), (0, 0, 0), outside=False)
    found = exchanged(full, tile, halo)
    tiles = [*itertools.product(*(range(0, side, tile) for side in sides))]
    box = Box((0, 0, 0), sides)
    ghosts, largest, messages = 0, 0, 0
    for low in tiles:
        x, y, z = low
        own = Box(low, (x + tile, y + tile, z + tile))
        inside = math.prod(own.intersection(box).shape)
        zone = math.prod(own.grown(halo).intersection(box).shape) - inside
        ghosts, largest = ghosts + zone, max(largest, inside + zone)
        messages += sum(
            max(abs(a - b) for a, b in zip(low, to, strict=True)) == tile for to in tiles
        )
    assert found.tiles == len(tiles)
    assert found.cells == math.prod(sides)
    assert found.ghosts == ghosts
    assert found.largest == largest
    assert found.messages == messages


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks_tell_each_other_only_what_others_keep(ranks: int) -> None:
    full = Field.from_dense(np.ones((32, 24, 48), bool), (0, 0, 0), outside=False)
    alone, shared = exchanged(full, 8, 3), exchanged(full, 8, 3, ranks)
    assert exchanged(full, 8, 3, 1).ghosts == 0
    assert 0 < shared.ghosts < alone.ghosts == alone.around == shared.around
    assert shared.messages <= ranks * (ranks - 1)
    assert shared.cells / ranks <= shared.busiest <= 1.2 * shared.cells / ranks


COSTS = Costs(Line(20.0, 0.6), Line(1.0, 0.5), Line(10, 3))


def test_a_plan_adds_up() -> None:
    counts = [Count(frame, 5, cells, 7) for frame, cells in ((1, 10), (2, 20), (3, 20), (4, 30))]
    whole = planned(counts, COSTS, memory=160)
    seconds = 20 + 6 + 6 + 11 + 11 + 16
    assert whole.seconds == whole.elapsed == seconds
    assert whole.memory == 160
    assert whole.disk == 4 * 10 + 3 * 80 + 4 * 7
    two = planned(counts, COSTS, memory=160, machines=2, chunk=2, preroll=1)
    assert two.elapsed == max(20 + 6 + 17, 20 + 12 + 11 + 27)
    exact = planned(counts, COSTS, memory=160, machines=2, chunk=2, preroll=None)
    assert exact.elapsed == seconds


def test_a_line_goes_through_two_costs_and_never_falls() -> None:
    assert Line.through([10, 20], [7, 12]) == Line(2.0, 0.5)
    assert Line.through([10, 20], [7, 5]).at(100) == 7
    assert Line.through([10, 20], [1, 100]).least == 0
