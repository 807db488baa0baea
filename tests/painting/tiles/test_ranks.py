"""Frames whose tiles ranks share: the bits of frames painted by one program."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.painting.tiles.test_tiled import MASKED, OUTLINED, frames, roll_of, rule_of, sorted_state

from vnca.core import Box
from vnca.core.volume import Volume
from vnca.engine import Compute, device, native
from vnca.io.parts import WholeSmoke
from vnca.painting.tiles import Tiling, shared_edge
from vnca.painting.tiles.deal import dealt, shared
from vnca.painting.tiles.kept import Keeping, Kept
from vnca.painting.tiles.near import Near
from vnca.painting.tiles.roll import TiledRoll
from vnca.painting.tiles.state import TiledState
from vnca.painting.unfinished import Unfinished
from vnca.ranks import Ranks
from vnca.ranks.threads import together

needs_native = pytest.mark.skipif(
    native.unavailable() is not None, reason="other backends round by how many cells there are"
)


def tiles_of_line(count: int) -> list[Box]:
    return [Box((8 * at, 0, 0), (8 * at + 8, 8, 8)) for at in range(count)]


def test_tiles_are_dealt_by_their_work() -> None:
    weights = [1.0, 1, 1, 1, 9, 1, 1, 1]
    ranks = dealt(tiles_of_line(8), weights, 3)
    assert sorted(set(ranks)) == [0, 1, 2]
    work = np.bincount(ranks, weights)
    assert work.max() <= 9 + 3
    assert dealt(tiles_of_line(8), np.ones(8).tolist(), 4) == [0, 0, 1, 1, 2, 2, 3, 3]
    assert dealt(tiles_of_line(2), [1, 1], 7) == [0, 1]
    assert dealt([], [], 2) == []


def test_tiles_of_a_rank_lie_together() -> None:
    tiles = [Box((x, y, 0), (x + 8, y + 8, 8)) for x in range(0, 32, 8) for y in range(0, 32, 8)]
    ranks = dealt(tiles, np.ones(16).tolist(), 4)
    for rank in range(4):
        own = [tile for tile, of in zip(tiles, ranks, strict=True) if of == rank]
        whole = own[0]
        for tile in own:
            whole = whole.union(tile)
        assert whole.shape == (16, 16, 8)


def test_every_rank_gets_some_tiles() -> None:
    edge = shared_edge(8e9, 10_000_000, 4, grid=1, finer=1)
    assert 10_000_000 / edge**3 >= 4 * 4
    assert shared_edge(8e9, 1000, 4, grid=1, finer=1) == 32


def test_ranks_share_cores_and_gpus(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vnca.engine.tensors.count_gpus", lambda: 2)
    monkeypatch.setattr("os.cpu_count", lambda: 8)
    monkeypatch.setattr(native, "default_threads", lambda: 8)

    def work(ranks: Ranks) -> Compute:
        return shared(Compute(device="cuda"), ranks)

    found = together(3, work)
    assert [each.device for each in found] == ["cuda:0", "cuda:1", "cuda:0"]
    assert {each.threads for each in found} == {2}
    assert device.shared_device("cuda:1", 0) == "cuda:1"
    assert shared(Compute("native"), together(1, lambda ranks: ranks)[0]).threads is None


def test_cells_of_others_are_fetched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vnca.painting.tiles.near.BRICKS_AT_ONCE", 3)
    at = np.stack(np.meshgrid(*[np.arange(32)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = at[np.random.default_rng(0).random(len(at)) < 0.1].astype(np.int32)
    values = np.random.default_rng(1).normal(size=(len(cells), 2)).astype(np.float32)

    def kept(own: Any, order: int) -> Kept:
        keeping = Keeping(tmp_path, 2)
        bricks = np.unique(cells[own] >> 3, axis=0)[::order]
        for brick in bricks:
            some = own & (cells >> 3 == brick).all(axis=1)
            keeping.add(cells[some], values[some])
        return keeping.kept()

    everything = kept(np.ones(len(cells), bool), 1)

    def work(ranks: Ranks) -> None:
        own = (cells[:, 0] // 16 + cells[:, 1] // 16) % ranks.size == ranks.rank
        box = Box((8 * ranks.rank, 0, 5), (8 * ranks.rank + 19, 21, 17))
        near = Near(ranks, kept(own, 1), [box], 16)
        found = near.filled(kept(own, -1))
        for got, expected in zip(found.within(box), everything.within(box), strict=True):
            np.testing.assert_array_equal(got, expected)
        assert not near.touches(Box((90, 0, 0), (99, 9, 9)))

    together(3, work)


@needs_native
@pytest.mark.parametrize(
    ("size", "options", "refine", "layered", "halo", "kind"),
    [
        *((size, {}, 1, False, None, "active") for size in (1, 2, 3, 4, 7)),
        (3, MASKED, 2, True, 2, "active"),
        (2, OUTLINED, 1, False, 3, "box"),
    ],
    ids=["1", "2", "3", "4", "7", "masked", "outlined"],
)
def test_ranks_have_the_bits_of_one(
    tmp_path: Path,
    size: int,
    options: dict[str, Any],
    refine: int,
    layered: bool,
    halo: int | None,
    kind: str,
) -> None:
    smoke = frames(16, 11)
    # Fast enough that some of it comes from beyond what is fetched at first.
    smoke[1] = replace(smoke[1], velocity=4 * smoke[1].velocity)  # type: ignore[operator]
    rule = rule_of(11, decoder=not refine > 1, transport=True, domain=kind)
    roll = roll_of(rule, smoke, refine, layered, **options)
    tiling = Tiling(8 * refine, halo)
    alone = TiledRoll(roll, tiling, tmp_path, lambda _: None)
    expected = rolled(alone, smoke)

    def work(ranks: Ranks) -> Any:
        return rolled(TiledRoll(roll, tiling, tmp_path, lambda _: None, ranks), smoke)

    found, *_ = together(size, work)
    for (state, mass), (other, other_mass) in zip(found, expected, strict=True):
        assert mass == other_mass
        pairs = zip((state, *state.layers), (other, *other.layers), strict=True)
        for one, whole in pairs:
            assert (len(one), one.steps_done, one.frame) == (
                *(len(whole), whole.steps_done, whole.frame),
            )
            for got, wanted in zip(sorted_state(one), sorted_state(whole), strict=True):
                np.testing.assert_array_equal(got, wanted)


def rolled(tiled: TiledRoll, smoke: list[Volume]) -> list[tuple[TiledState, Any]]:
    state, left = tiled.start(), []
    for frame in smoke:
        held = WholeSmoke(frame)
        state = tiled.advance(held, state)
        mass = tiled.mass(held, state)
        left.append((state.gathered(tiled.folder, tiled.ranks), mass))
    return left


@needs_native
def test_other_ranks_go_on_with_what_some_left(tmp_path: Path) -> None:
    smoke = frames(16, 5)
    rule = rule_of(5, decoder=False, transport=True, domain="active")
    roll = roll_of(rule, smoke, 1, True, strength="age:0..2")
    path = tmp_path / "state.safetensors"

    def resumed(of: int) -> Callable[[Ranks], Any]:
        def work(ranks: Ranks) -> Any:
            tiled = TiledRoll(roll, Tiling(8, 2), tmp_path, lambda _: None, ranks)
            state = tiled.start()
            if of:
                taken = lambda stored: TiledState.of_stored(stored, tmp_path, ranks)  # noqa: E731
                state = Unfinished.load(path, {}, roll, taken).state
            state = tiled.advance(WholeSmoke(smoke[of]), state)
            return state.gathered(tmp_path, ranks)

        return work

    for of, size in ((0, 3), (1, 2), (2, 4)):
        Unfinished({}, (), together(size, resumed(of))[0]).save(path)
    found = Unfinished.load(path, {}, roll).state
    before = roll.start()
    for frame in smoke:
        before = roll.paint(frame, before).state
    for one, other in zip((found, *found.layers), (before, *before.layers), strict=True):
        for got, wanted in zip(sorted_state(one), sorted_state(other), strict=True):
            np.testing.assert_array_equal(got, wanted)
