import dataclasses
import math
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from vnca import painting as roll_module
from vnca.core import Box, FloatArray, IntArray
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import OptionError
from vnca.core.volume import Volume
from vnca.engine import Compute, Job, Session, StepSession
from vnca.engine.automaton import Automaton, changing_rows, hash_cells
from vnca.engine.domain import Domain
from vnca.io.velocity import extrapolated
from vnca.painting import Painting, Roll, StylizeConfig, stylize
from vnca.painting import shown as shown_module
from vnca.painting.frames import read_ahead
from vnca.rule import Decoder, Rule, RuleConfig, Scales
from vnca.rule.paint import SAMPLES, Between, colours, density_factors

RULE = Rule.initial(RuleConfig(channels=4, hidden=3), Scales(), seed=0)
BOX = Box((-10, -10, -10), (20, 20, 20))


def counting_step(
    state: FloatArray, rows: IntArray, neighbours: IntArray, priors: FloatArray, *_: object
) -> FloatArray:
    """A rule in which a cell counts in its red channel how often it changed, in hundredths."""
    assert neighbours.shape == (27, len(state) - 1)
    assert priors.shape == (len(state) - 1, 7)
    state = state.copy()
    state[rows, 0] += 0.01
    return state


@contextmanager
def computed_by(step: Callable[..., FloatArray]) -> Iterator[None]:
    """While the step of the native backend is another."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(roll_module, "open_session", partial(_session, step))
        yield


def _session(
    step: Callable[..., FloatArray],
    automaton: Automaton,
    domain: Domain,
    told: Any,
    *_: object,
    **__: object,
) -> Session:
    job = Job(automaton, domain, told, Compute(), differentiable=False)
    return StepSession.open(job, draw=_draw, update=step)


def _draw(hashes: IntArray, **options: Any) -> IntArray:
    return changing_rows(hashes.view(np.uint32), **options)


@pytest.fixture(autouse=True)
def counting() -> Iterator[None]:
    with computed_by(counting_step):
        yield


def ball(frame: int, centre: tuple[int, int, int] = (0, 0, 0), origin: int = 0) -> Volume:
    cells = np.stack(np.meshgrid(*[np.arange(7)] * 3, indexing="ij"), axis=-1) - 3
    density = (np.linalg.norm(cells, axis=-1) < 3).astype(np.float32)
    x, y, z = (c + origin - 3 for c in centre)
    return Volume(density, None, (x, y, z), np.eye(4), frame)


def nothing(frame: int) -> Volume:
    return Volume(np.zeros((0, 0, 0), np.float32), None, (0, 0, 0), np.eye(4), frame)


def rolled(frames: list[Volume], box: Box = BOX, **options: float | str) -> list[Painting]:
    config = StylizeConfig(**{"warmup": 6, "steps_per_frame": 2, **options})  # type: ignore[arg-type]
    return list(stylize(frames, RULE, config, box=box))


def at(painting: Painting, cell: tuple[int, int, int]) -> float:
    x, y, z = (c - o for c, o in zip(cell, painting.smoke.origin, strict=True))
    return float(painting.colour[x, y, z, 0])


def changes(cell: tuple[int, int, int], *, steps: int) -> int:
    """How often a cell changes in the first steps of a sequence."""
    hashes = hash_cells(np.array([cell], np.int32))
    options = {"seed": 0, "probability": RULE.config.update_probability}
    return sum(len(changing_rows(hashes, step=step, **options)) for step in range(steps))  # type: ignore[arg-type]


def test_a_cell_keeps_its_state_while_the_smoke_moves_over_it() -> None:
    still, moved = rolled([ball(0), ball(1, (2, 0, 0))], steps_per_frame=8)
    stayed = rolled([ball(0), ball(1)], steps_per_frame=8)[1]
    assert at(still, (1, 0, 0)) < at(moved, (1, 0, 0))
    assert at(moved, (1, 0, 0)) == at(stayed, (1, 0, 0))


def test_the_painting_is_anchored_in_index_space_whatever_box_the_file_covers() -> None:
    tight = ball(0)
    padded = Volume(np.pad(tight.density, 5), None, (-8, -8, -8), np.eye(4), 0)
    a, b = rolled([tight])[0], rolled([padded])[0]
    np.testing.assert_array_equal(a.colour[tight.density > 0], b.colour[padded.density > 0])


def test_a_frame_without_smoke_passes_through_and_the_painting_starts_afresh() -> None:
    first, empty, again = rolled([ball(0), nothing(1), ball(2)])
    assert empty.density.size == 0
    assert empty.colour.shape == (0, 0, 0, 3)
    assert np.isfinite(again.colour).all()
    assert abs(at(first, (0, 0, 0)) - at(again, (0, 0, 0))) < 0.05


def test_strengths_fade_colour_and_density_separately() -> None:
    plain = rolled([ball(0)], strength=0.0, density_strength=0.0)[0]
    np.testing.assert_array_equal(plain.colour, 1)
    np.testing.assert_array_equal(plain.density, plain.smoke.density)
    half, full = rolled([ball(0)], strength=0.5)[0], rolled([ball(0)])[0]
    np.testing.assert_allclose(half.colour, 0.5 + 0.5 * full.colour, rtol=1e-6)


def test_smoke_never_appears_where_there_was_none() -> None:
    painting = rolled([ball(0)])[0]
    assert not painting.density[painting.smoke.density == 0].any()


def test_same_seed_same_painting_and_another_seed_another() -> None:
    a, b = rolled([ball(0)]), rolled([ball(0)])
    np.testing.assert_array_equal(a[0].colour, b[0].colour)
    assert not np.array_equal(a[0].colour, rolled([ball(0)], seed=1)[0].colour)


def test_a_roll_goes_on_from_the_state_a_painting_left() -> None:
    frames = [ball(0), ball(1, (2, 0, 0)), nothing(2), ball(3)]
    whole = rolled(frames)
    roll = Roll(RULE, StylizeConfig(warmup=6, steps_per_frame=2), BOX)
    for before, after in pairwise(whole):
        again = roll.paint(after.smoke, before.state)
        np.testing.assert_array_equal(again.colour, after.colour)
        assert again.state.steps_done == after.state.steps_done


def test_a_frame_made_ready_beforehand_is_painted_the_same() -> None:
    roll = Roll(RULE, StylizeConfig(warmup=6, steps_per_frame=2), BOX)
    frames = [ball(0), nothing(1), ball(2, (2, 0, 0))]
    state = roll.start()
    for smoke, ready in zip(frames, [roll.ready(smoke) for smoke in frames], strict=True):
        painting, right = roll.paint(ready, state), roll.paint(smoke, state)
        np.testing.assert_array_equal(painting.colour, right.colour)
        np.testing.assert_array_equal(painting.state.values, right.state.values)
        state = painting.state


def test_neighbours_are_forgotten_before_colour_is_continued(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They are the largest array there is, and what follows makes others of the same order."""
    domains: list[weakref.ref[Domain]] = []
    around_smoke = Domain.around_smoke

    def around(*arguments: Any, **options: Any) -> Domain:
        domain = around_smoke(*arguments, **options)
        domains.append(weakref.ref(domain))
        return domain

    def continued(*arguments: Any) -> Any:
        assert domains.pop()() is None
        return extrapolated(*arguments)

    monkeypatch.setattr(Domain, "around_smoke", around)
    monkeypatch.setattr(shown_module, "extrapolated", continued)
    rolled([ball(0), ball(1)])
    assert not domains


def test_frames_are_read_one_at_a_time() -> None:
    read: list[int] = []

    def frames() -> Iterator[Volume]:
        for number in range(5):
            read.append(number)
            yield ball(number)

    config = StylizeConfig(warmup=0, steps_per_frame=1)
    paintings = stylize(frames(), RULE, config, box=BOX)
    next(paintings)
    assert read == [0]


def test_reading_ahead_keeps_order_reads_one_ahead_and_passes_errors_on() -> None:
    def fail() -> int:
        raise KeyError("frame 2")

    results = read_ahead([lambda: 0, lambda: 1, fail])
    assert next(results) == 0
    assert next(results) == 1
    with pytest.raises(KeyError, match="frame 2"):
        next(results)
    assert list(read_ahead([])) == []


def test_what_was_read_ahead_and_is_not_taken_is_handed_over() -> None:
    left: list[int] = []
    results = read_ahead([lambda: 0, lambda: 1, lambda: 2], unwanted=left.append)
    assert next(results) == 0
    results.close()
    assert left == [1]


def test_options_out_of_range_are_named() -> None:
    with pytest.raises(OptionError, match="`density_strength`"):
        StylizeConfig(density_strength=1.5)
    with pytest.raises(OptionError, match="`steps_per_frame`"):
        dataclasses.replace(StylizeConfig(), steps_per_frame=-1)


@pytest.mark.parametrize("dilation", [0, 2])
def test_cells_are_active_as_far_from_the_smoke_as_the_rule_was_trained_with(dilation: int) -> None:
    config = dataclasses.replace(RULE.config, dilation=dilation)
    rule = dataclasses.replace(RULE, config=config)
    smoke = Volume(np.pad(ball(0).density, 4), None, (0, 0, 0), np.eye(4), 0)
    (painting,) = stylize([smoke], rule, StylizeConfig(), box=smoke.box)
    lived = np.zeros(smoke.density.shape, bool)
    lived[tuple(painting.state.cells.T)] = True
    near = ndimage.maximum_filter(smoke.density > 0.5, 2 * dilation + 1)
    np.testing.assert_array_equal(lived, near)


def plain_step(state: FloatArray, *_: object) -> FloatArray:
    """A rule that paints all cells in one dark red."""
    state = state.copy()
    state[:-1, :3] = -0.1, -0.4, -0.5
    return state


def faint(colour_dilation: int, **options: float) -> Painting:
    """A ball of that red in a box of smoke too faint to be painted."""
    density = np.maximum(np.pad(ball(0).density, 6), np.float32(1e-4))
    smoke = Volume(density, None, (0, 0, 0), np.eye(4), 0)
    config = StylizeConfig(warmup=1, **options)  # type: ignore[arg-type]
    roll = Roll(RULE, config, smoke.box, colour_dilation=colour_dilation)
    with computed_by(plain_step):
        return roll.paint(smoke, roll.start())


def test_faint_smoke_has_the_colour_of_the_painting_beside_it_and_is_white_farther_away() -> None:
    painting = faint(colour_dilation=3)
    red = srgb_to_linear(np.array([0.4, 0.1, 0.0]))
    lived = np.zeros(painting.density.shape, bool)
    lived[tuple(painting.state.cells.T)] = True
    reached = lived
    for _ in range(3):
        reached = np.logical_or.reduce(
            [np.roll(reached, step, axis) for axis in range(3) for step in (-1, 0, 1)]
        )
    assert lived.sum() < reached.sum() < reached.size
    np.testing.assert_allclose(painting.colour[reached] - red, 0, atol=1e-6)
    np.testing.assert_array_equal(painting.colour[~reached], 1)
    # Only what lives changes the density.
    np.testing.assert_array_equal(painting.density[~lived], painting.smoke.density[~lived])


def test_dilated_colour_fades_with_the_painting() -> None:
    half, full = faint(colour_dilation=2, strength=0.5), faint(colour_dilation=2)
    np.testing.assert_allclose(half.colour, 0.5 + 0.5 * full.colour, rtol=1e-6)
    np.testing.assert_array_equal(faint(colour_dilation=2, strength=0.0).colour, 1)


def test_cells_of_the_whole_box_live_on_however_far_the_smoke_jumps() -> None:
    there = (12, 5, 0)
    frames = [ball(0), nothing(1), ball(2, there)]
    active, box = (rolled(frames, domain=domain)[-1] for domain in ("active", "box"))
    stayed = rolled([ball(0)] * 3, domain="box")[-1]
    assert at(active, there) < at(box, there)
    assert at(box, (12, 5, 0)) == pytest.approx(
        srgb_to_linear(np.array(0.5 + 0.01 * changes(there, steps=12)))
    )
    assert len(box.state.cells) == len(stayed.state.cells) == math.prod(BOX.grown(1).shape)


def test_faint_smoke_is_painted_where_the_whole_box_lives() -> None:
    faint = dataclasses.replace(ball(0), density=np.full((7, 7, 7), 1e-4, np.float32))
    assert (rolled([faint], domain="active")[0].colour == 1).all()
    assert (rolled([faint], domain="box")[0].colour != 1).all()


def test_cells_live_where_they_did_in_training_unless_asked_otherwise() -> None:
    boxed = dataclasses.replace(RULE, config=dataclasses.replace(RULE.config, domain="box"))
    for rule, asked, kind in (
        *((RULE, None, "active"), (RULE, "box", "box")),
        *((boxed, None, "box"), (boxed, "active", "active")),
    ):
        roll = Roll(rule, StylizeConfig(domain=asked), BOX)  # type: ignore[arg-type]
        assert roll.domain_kind == kind


def decoded(*, seed: int = 3) -> Rule:
    return dataclasses.replace(RULE, decoder=Decoder.initial(4, seed=seed, units=8))


@pytest.mark.parametrize("refine", [1, 2, 3, 8])
def test_a_decoder_paints_the_means_of_the_parts_of_cells(refine: int) -> None:
    rule, smoke = decoded(), ball(0)
    with computed_by(plain_step):
        (painting,) = stylize([smoke], rule, StylizeConfig(warmup=1), box=BOX, refine=refine)
    assert painting.smoke.box == smoke.box.refined(refine)
    assert painting.coarse is not None
    assert painting.coarse.box == smoke.box
    assert len(painting.state.cells) < 500, "the automaton's cells are those of the smoke"
    domain = Domain(painting.state.cells, BOX.grown(1))
    cell, part = np.array([1, -2, 0]), np.array([refine - 1, 0, refine // 2])
    samples = SAMPLES[refine]
    offsets = (np.indices((samples,) * 3).reshape(3, -1).T + 0.5) / samples
    points = cell + (part + offsets) / refine - 0.5
    seen = Between(rule).at(painting.state.values, *domain.corners(points))
    at = tuple(cell * refine + part - painting.smoke.origin)
    np.testing.assert_allclose(painting.colour[at], colours(seen).mean(0), atol=1e-5)
    expected = painting.smoke.density[at] * density_factors(seen).mean()
    np.testing.assert_allclose(painting.density[at], expected, rtol=1e-5)


def test_strengths_act_on_what_a_decoder_paints() -> None:
    config = StylizeConfig(warmup=1, strength=0.0, density_strength=0.0)
    with computed_by(plain_step):
        (painting,) = stylize([ball(0)], decoded(), config, box=BOX, refine=2)
    assert (painting.colour == 1).all()
    np.testing.assert_array_equal(painting.density, painting.smoke.density)
