from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from vnca.core import FloatArray
from vnca.core.errors import OptionError
from vnca.engine import open_session
from vnca.painting.block import Block, block_domain, border_jump, grow, sample_block
from vnca.rule import Rule
from vnca.rule.paint import SAMPLES


@pytest.fixture(scope="module")
def plain(rule: Rule) -> Rule:
    return replace(rule, decoder=None)


@pytest.fixture(scope="module")
def block(plain: Rule) -> FloatArray:
    return next(grow(plain, 16, steps=12, seed=5)).colours


def test_a_block_holds_colours_that_can_be_shown(block: FloatArray) -> None:
    assert block.shape == (16, 16, 16, 3)
    assert block.dtype == np.float32
    assert block.min() >= 0
    assert block.max() <= 1
    assert block.std() > 0.01


def test_the_block_tiles_without_a_jump_at_its_border(block: FloatArray) -> None:
    assert border_jump(block) == pytest.approx(1, abs=0.1)
    cut = np.concatenate([block[:8] * 0.2, block[8:]])
    assert border_jump(cut) > 1.2


def test_the_automaton_does_not_know_where_the_border_is(rule: Rule) -> None:
    """With all cells changing in every step, a shifted beginning gives a shifted block."""
    always = replace(rule.config, update_probability=1.0)
    domain = block_domain(8)
    random = np.random.default_rng(0)
    dense = random.normal(0, 0.2, (8, 8, 8, always.channels)).astype(np.float32)

    automaton = replace(rule, config=always).automaton(seed=0)
    session = open_session(automaton, domain, np.zeros((len(domain), 7), np.float32))

    def rolled(start: FloatArray) -> FloatArray:
        state = np.append(start[tuple(domain.cells.T)], np.zeros((1, always.channels), "f"), 0)
        return domain.scatter(session.run(state, range(4))[:-1], domain.box)

    shifted = rolled(np.roll(dense, (3, 5, 1), (0, 1, 2)))
    np.testing.assert_allclose(shifted, np.roll(rolled(dense), (3, 5, 1), (0, 1, 2)), atol=1e-5)


def test_same_seed_same_block_and_another_seed_another(rule: Rule) -> None:
    one, two, other = (next(grow(rule, 8, steps=6, seed=s)).colours for s in (1, 1, 2))
    np.testing.assert_array_equal(one, two)
    assert not np.array_equal(one, other)


def test_a_block_lives_on_in_even_steps(rule: Rule) -> None:
    first, second, third = (b.colours for b in islice(grow(rule, 8, steps=4, pause=3), 3))
    assert not np.array_equal(first, second)
    np.testing.assert_array_equal(second, next(grow(rule, 8, steps=7)).colours)
    np.testing.assert_array_equal(third, next(grow(rule, 8, steps=10)).colours)
    still, same = (b.colours for b in islice(grow(rule, 8, steps=4), 2))
    np.testing.assert_array_equal(still, same)


def test_sampling_agrees_with_scipy_also_far_outside(block: FloatArray) -> None:
    points = np.random.default_rng(0).uniform(-50, 50, (500, 3))
    expected = np.stack(
        [map_coordinates(block[..., c], points.T, order=1, mode="grid-wrap") for c in range(3)], -1
    )
    np.testing.assert_allclose(sample_block(block, points), expected, atol=1e-5)
    cells = np.argwhere(np.ones((16, 16, 16)))
    np.testing.assert_array_equal(sample_block(block, cells), block.reshape(-1, 3))


@pytest.mark.parametrize("size", [0, 7, 10**6])
def test_blocks_that_cannot_be_grown_are_refused(rule: Rule, size: int) -> None:
    with pytest.raises(OptionError, match="expected from"):
        next(grow(rule, size, steps=1))


def test_a_block_without_a_decoder_is_read_between_its_cells(block: FloatArray) -> None:
    held = Block(block)
    points = np.random.default_rng(0).uniform(-20, 20, (40, 3))
    np.testing.assert_array_equal(held.at(points), sample_block(block, points))
    np.testing.assert_array_equal(held.refined(1), block)
    finer = held.refined(2)
    assert finer.shape == (32, 32, 32, 3)
    at = np.array([[0.25, 3.75, 7.25]])
    np.testing.assert_allclose(finer[1, 8, 15], sample_block(block, at)[0], atol=1e-6)


def test_a_decoder_is_asked_wherever_a_block_is_looked_at(rule: Rule, plain: Rule) -> None:
    """Also across its border, and between its cells it shows more than they do."""
    decoded = next(grow(rule, 8, steps=8))
    centres = np.indices((8, 8, 8)).reshape(3, -1).T
    shown, cells = decoded.at(centres), next(grow(plain, 8, steps=8)).at(centres)
    assert np.abs(shown - cells).max() > 0.05
    np.testing.assert_allclose(decoded.at(centres + 8), shown, atol=1e-5)
    points = np.random.default_rng(0).uniform(0, 8, (50, 3))
    assert np.abs(decoded.at(points) - sample_block(decoded.colours, points)).max() > 0.05


@pytest.mark.parametrize("factor", [1, 2, 5])
def test_a_finer_grid_holds_the_means_of_the_parts_of_cells(rule: Rule, factor: int) -> None:
    decoded = next(grow(rule, 8, steps=8))
    finer = decoded.refined(factor)
    assert finer.shape == (8 * factor,) * 3 + (3,)
    samples = SAMPLES[factor]
    cell = np.array([2, 7 * factor, 5 * factor + factor - 1])
    offsets = (np.indices((samples,) * 3).reshape(3, -1).T + 0.5) / samples
    found = decoded.at((cell + offsets) / factor - 0.5)
    np.testing.assert_allclose(finer[tuple(cell)], found.mean(0), atol=2e-5)


def test_a_wide_point_is_a_mean(rule: Rule) -> None:
    decoded = next(grow(rule, 8, steps=8))
    points = np.random.default_rng(0).uniform(0, 8, (400, 3))
    assert decoded.at(points, 4.0).std(0).max() < decoded.at(points).std(0).min()


def test_other_refinements_are_refused(rule: Rule) -> None:
    with pytest.raises(OptionError, match="`refine` 9: must be from 1 to 8"):
        next(grow(rule, 8, steps=1)).refined(9)
