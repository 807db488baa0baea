"""Frames painted by tiles: the bits of frames painted as wholes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from vnca.core.errors import FileFormatError
from vnca.core.volume import Volume
from vnca.engine import Compute, native
from vnca.io.painted.parts import tiles_of
from vnca.io.parts import WholeSmoke
from vnca.painting import Painting, Roll, StylizeConfig
from vnca.painting.tiles import Tiling
from vnca.painting.tiles.roll import TiledRoll
from vnca.painting.tiles.state import TiledState
from vnca.painting.unfinished import Unfinished
from vnca.rule import Decoder, Rule, RuleConfig, Scales

pytestmark = pytest.mark.skipif(
    native.unavailable() is not None, reason="other backends round by how many cells there are"
)
MASKED = {
    "steps_per_frame": "height:0..1->0..4",
    "strength": "distance:0..3",
    "pattern_speed": "x:0..1->-1..2",
    "silhouette": "soft",
}
OUTLINED = {"edge": 1.5, "keep_mass": True, "strength": "age:0..2", "fire": 900.0}
DIRECTIONS: dict[str, dict[str, Any]] = {"none": {}, "masked": MASKED, "outlined": OUTLINED}


def frames(size: int, seed: int) -> list[Volume]:
    """A ball of noise that grows, turns and rises past the border of a box."""
    random = np.random.default_rng(seed)
    at = np.stack(np.meshgrid(*[np.arange(size) - size / 2] * 3, indexing="ij"), axis=-1)
    found = []
    for number in (1, 2, 4):
        away = np.linalg.norm(at - [0, 0, 2 * number], axis=-1)
        density = np.clip(size / 4 + number - away, 0, 1) * random.uniform(0, 1, away.shape)
        turning = np.stack([-at[..., 1], at[..., 0], np.full(away.shape, 5.0)], axis=-1)
        velocity = turning * 0.2 * (density > 0)[..., None]
        arrays = density.astype(np.float32), velocity.astype(np.float32)
        found.append(Volume(*arrays, (-5, 3, number - 9), np.eye(4), number))
    return found


def rule_of(seed: int, *, decoder: bool, transport: bool, domain: Any) -> Rule:
    random = np.random.default_rng(seed)
    config = RuleConfig(channels=5, hidden=8, transport=transport, domain=domain)
    rule = Rule.initial(config, Scales(density=0.5, velocity=2.0, gamma=0.7), seed=seed)
    if decoder:
        rule = replace(rule, decoder=Decoder.initial(5, seed=seed))
    output = random.normal(0, 0.1, rule.output.shape).astype(np.float32)
    return replace(rule, output=output)


def roll_of(rule: Rule, smoke: list[Volume], refine: int, layered: bool, **options: Any) -> Roll:
    box = smoke[0].box.union(smoke[-1].box)
    layers = ("other=height:0..1",) if layered else ()
    config = StylizeConfig(warmup=3, **{"steps_per_frame": 2, **options}, layers=layers)
    roll = Roll(rule, config, box, Compute("native", threads=1))
    if layered:
        other = replace(rule, output=-rule.output)
        roll = replace(roll, layers=(replace(roll, rule=other, config=replace(config, layers=())),))
    return roll.refined(refine)


def require_same(whole: Painting, tiled: TiledRoll, smoke: WholeSmoke, state: TiledState) -> None:
    edge, roll = tiled.tiling.edge * tiled.roll.finer, tiled.roll
    box = whole.smoke.box
    mass = tiled.mass(smoke, state)
    every = list(tiles_of(box, edge))
    some = {0, len(every) // 3, len(every) // 2, len(every) - 1}
    for tile in (every[at].intersection(box) for at in some):
        part = tiled.painting(smoke, state, tile, mass)
        assert part.smoke.box == box
        pairs = [
            (whole.density_field, part.density_field),
            (whole.colour_field, part.colour_field),
        ]
        if roll.config.burns:
            assert whole.emission is not None
            assert part.emission is not None
            pairs.append((whole.emission, part.emission))
        for expected, found in pairs:
            np.testing.assert_array_equal(found.dense(tile), expected.dense(tile))


def sorted_state(state: Any) -> tuple[Any, Any]:
    cells, values = (np.concatenate(each) for each in zip(*state.pieces(), strict=True))
    order = np.lexsort(cells.T)
    return cells[order], values[order]


@settings(
    max_examples=4,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(
    edge=st.sampled_from([8, 16, 24]),
    halo=st.one_of(st.none(), st.integers(1, 6)),
    threads=st.integers(1, 3),
    seed=st.integers(0, 99),
    decoder=st.booleans(),
    transport=st.booleans(),
    refine=st.sampled_from([1, 1, 2]),
    layered=st.booleans(),
    direction=st.sampled_from(sorted(DIRECTIONS)),
    domain=st.sampled_from(["active", "active", "box"]),
)
@example(16, 2, 2, 1, True, True, 2, True, "masked", "active")
@example(24, None, 1, 2, False, True, 2, False, "outlined", "active")
def test_tiles_have_the_bits_of_wholes(
    tmp_path: Path,
    edge: int,
    halo: int | None,
    threads: int,
    seed: int,
    decoder: bool,
    transport: bool,
    refine: int,
    layered: bool,
    direction: str,
    domain: str,
) -> None:
    smoke = frames(16, seed)
    rule = rule_of(seed, decoder=decoder, transport=transport, domain=domain)
    roll = roll_of(rule, smoke, refine, layered, **DIRECTIONS[direction])
    threaded = replace(roll, compute=Compute("native", threads=threads))
    tiled = TiledRoll(threaded, Tiling(edge, halo), tmp_path, lambda _: None)
    before, state = roll.start(), tiled.start()
    for frame in smoke:
        painting = roll.paint(frame.refined(roll.grid), before)
        before = painting.state
        held = WholeSmoke(frame)
        state = tiled.advance(held, state)
        assert (state.steps_done, state.frame) == (before.steps_done, before.frame)
        for one, other in zip((state, *state.layers), (before, *before.layers), strict=True):
            for found, expected in zip(sorted_state(one), sorted_state(other), strict=True):
                np.testing.assert_array_equal(found, expected)
        require_same(painting, tiled, held, state)


def test_a_frame_without_smoke_ends_the_state(tmp_path: Path) -> None:
    smoke = frames(16, 3)
    nothing = replace(smoke[1], density=np.zeros_like(smoke[1].density))
    rule = rule_of(3, decoder=False, transport=True, domain="active")
    roll = roll_of(rule, smoke, 1, layered=False)
    tiled = TiledRoll(roll, Tiling(8, 2), tmp_path, lambda _: None)
    before, state = roll.start(), tiled.start()
    for frame, count in zip((smoke[0], nothing, smoke[2]), (True, False, True), strict=True):
        before = roll.paint(frame, before).state
        state = tiled.advance(WholeSmoke(frame), state)
        assert (len(state) > 0) is count
        assert (len(state), state.steps_done) == (len(before), before.steps_done)


def test_fast_smoke_is_carried_from_far(tmp_path: Path) -> None:
    """Farther than tiles and what is read around them at first."""
    smoke = [replace(f, velocity=9 * (f.velocity + 1)) for f in frames(16, 4)]  # type: ignore[operator]
    rule = rule_of(4, decoder=False, transport=True, domain="active")
    roll = roll_of(rule, smoke, 1, layered=False)
    tiled = TiledRoll(roll, Tiling(8, 3), tmp_path, lambda _: None)
    before, state = roll.start(), tiled.start()
    for frame in smoke:
        before = roll.paint(frame, before).state
        state = tiled.advance(WholeSmoke(frame), state)
        for found, expected in zip(sorted_state(state), sorted_state(before), strict=True):
            np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("layered", [False, True])
def test_either_way_goes_on_with_what_the_other_left(tmp_path: Path, layered: bool) -> None:
    smoke = frames(16, 5)
    rule = rule_of(5, decoder=False, transport=True, domain="active")
    roll = roll_of(rule, smoke, 1, layered, strength="age:0..2")
    tiled = TiledRoll(roll, Tiling(8, 2), tmp_path, lambda _: None)
    path = tmp_path / "state.safetensors"
    whole = roll.paint(smoke[0], roll.start()).state
    Unfinished({}, (), whole).save(path)
    begun = Unfinished.load(path, {}, roll, lambda s: TiledState.of_stored(s, tmp_path)).state
    tiles = tiled.advance(WholeSmoke(smoke[1]), begun)
    Unfinished({}, (), tiles).save(path)
    again = Unfinished.load(path, {}, roll).state
    expected = roll.paint(smoke[2], roll.paint(smoke[1], whole).state)
    found = roll.paint(smoke[2], again)
    np.testing.assert_array_equal(found.density, expected.density)
    np.testing.assert_array_equal(found.colour, expected.colour)


def test_a_state_whose_cells_are_out_of_order_is_refused(tmp_path: Path) -> None:
    smoke = frames(16, 6)
    rule = rule_of(6, decoder=False, transport=True, domain="active")
    roll = roll_of(rule, smoke, 1, layered=False)
    state = roll.paint(smoke[0], roll.start()).state
    path = tmp_path / "state.safetensors"
    Unfinished({}, (), replace(state, cells=state.cells[::-1])).save(path)
    with pytest.raises(FileFormatError, match="damaged"):
        Unfinished.load(path, {}, roll, lambda s: TiledState.of_stored(s, tmp_path))
