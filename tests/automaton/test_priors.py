import dataclasses

import numpy as np

from vnca.automaton.domain import Domain
from vnca.automaton.paint import colours, density_factors
from vnca.automaton.priors import priors, told_velocity
from vnca.automaton.rule import Rule, RuleConfig, Scales
from vnca.colour import linear_to_srgb
from vnca.lattice import Lattice, Region
from vnca.typing import Box
from vnca.volume import Volume

SHAPE = (4, 2, 3)


def smoke() -> Volume:
    random = np.random.default_rng(0)
    return Volume(
        random.random(SHAPE).astype(np.float32),
        random.normal(size=(*SHAPE, 3)).astype(np.float32),
        (5, -2, 0),
        np.eye(4),
        1,
    )


def rule(**switches: bool) -> Rule:
    return Rule.initial(RuleConfig(**switches), Scales(density=0.5, velocity=2.0), seed=0)  # type: ignore[arg-type]


def test_cells_are_told_position_density_and_velocity() -> None:
    volume = smoke()
    domain = Domain.from_mask(np.ones(SHAPE, bool), volume.origin)
    values = domain.scatter(priors(domain, volume, rule()), domain.box)
    np.testing.assert_allclose(values[:, 0, 0, 0], [-0.75, -0.25, 0.25, 0.75])
    np.testing.assert_allclose(values[0, :, 0, 1], [-0.5, 0.5])
    np.testing.assert_allclose(values[0, 0, :, 2], [-2 / 3, 0, 2 / 3], atol=1e-7)
    np.testing.assert_allclose(values[..., 3], volume.density / 0.5)
    assert volume.velocity is not None
    np.testing.assert_allclose(values[..., 4:], volume.velocity / 2)


def placed(box: Box, to_world: np.ndarray) -> Rule:
    return dataclasses.replace(rule(), place=Region(Lattice(to_world), box))


def test_cells_have_their_position_where_the_rule_was_trained_whatever_box_they_live_in() -> None:
    volume = smoke()
    domain = Domain.from_mask(np.ones(SHAPE, bool), volume.origin)
    expected = priors(domain, volume, rule())
    trained = placed(domain.box, volume.index_to_world)
    larger = dataclasses.replace(domain, box=domain.box.grown(9))
    np.testing.assert_array_equal(priors(larger, volume, trained), expected)
    assert not np.array_equal(priors(larger, volume, rule()), expected)
    # On other cells of the same world, and finer ones, too.
    moved = np.diag([0.5, 0.5, 0.5, 1.0])
    moved[:3, 3] = 1, 2, 3
    box = Box((8, -8, -6), (16, -4, 0))  # of cells half as large, at the same place
    trained = placed(box, moved)
    np.testing.assert_allclose(
        priors(larger, volume, trained)[:, 2], expected[:, 2] - 1 / 6, atol=1e-6
    )
    fine = volume.refined(2)
    finer = Domain.from_mask(np.ones(fine.density.shape, bool), fine.origin)
    told = priors(finer, fine, placed(domain.box, volume.index_to_world))
    plain = priors(finer, fine, rule())
    np.testing.assert_allclose(told[:, :3], plain[:, :3], atol=1e-6)


def test_cells_beyond_where_the_rule_was_trained_are_told_to_be_at_its_border() -> None:
    volume = smoke()
    domain = Domain.from_mask(np.ones(SHAPE, bool), volume.origin)
    told = priors(domain, volume, placed(Box((6, -2, 0), (7, 0, 3)), volume.index_to_world))
    columns = domain.scatter(told, domain.box)[:, 0, 0, 0]
    np.testing.assert_allclose(columns, [-1, 0, 1, 1])


def test_a_rule_is_told_the_same_on_a_finer_grid_in_steps_that_last_less() -> None:
    coarse = rule(position_prior=False)
    volume = smoke()
    volume = dataclasses.replace(
        volume, density=np.full_like(volume.density, 0.3), velocity=np.full((*SHAPE, 3), 1.5)
    )
    told = []
    for factor in (1, 3):
        fine = volume.refined(factor)
        domain = Domain.from_mask(fine.density > 0, fine.origin)
        told.append(priors(domain, fine, coarse.refined(factor))[0])
    np.testing.assert_allclose(told[1], told[0], rtol=1e-6)
    config, scales = coarse.refined(3).config, coarse.refined(3).scales
    assert config.steps_per_frame == 3 * coarse.config.steps_per_frame
    # Three cells absorb what one did.
    assert 3 * scales.gamma == coarse.scales.gamma


def test_cells_outside_the_smoke_are_told_that_there_is_none() -> None:
    volume = smoke()
    domain = Domain.from_mask(np.ones((1, 1, 1), bool), (100, 0, 0))
    assert not priors(domain, volume, rule(position_prior=False)).any()


def test_a_prior_that_is_switched_off_and_a_velocity_that_is_missing_are_zero() -> None:
    volume = smoke()
    domain = Domain.from_mask(np.ones(SHAPE, bool), volume.origin)
    off = priors(
        domain, volume, rule(position_prior=False, density_prior=False, velocity_prior=False)
    )
    assert off.shape == (len(domain), 7)
    assert not off.any()
    still = priors(domain, dataclasses.replace(volume, velocity=None), rule())
    assert not still[:, 4:].any()


def test_a_density_in_other_units_cannot_blow_a_state_up() -> None:
    volume = smoke()
    huge = dataclasses.replace(volume, density=volume.density * 1e6)
    domain = Domain.from_mask(np.ones(SHAPE, bool), volume.origin)
    assert np.abs(priors(domain, huge, rule())).max() <= 4


def test_fast_smoke_is_told_where_it_goes_and_no_speed_beyond_the_limit() -> None:
    velocity = np.array([[0, 0, 0], [3, 0, 0], [0, -4, 0], [30, 0, -40], [3e9, 4e9, 0]], np.float32)
    told = told_velocity(velocity, rule())
    expected = [[0, 0, 0], [1.5, 0, 0], [0, -2, 0], [1.2, 0, -1.6], [1.2, 1.6, 0]]
    np.testing.assert_allclose(told, expected, rtol=1e-6)
    assert told.dtype == np.float32


def test_a_velocity_as_large_as_a_file_can_hold_is_told_as_any_other() -> None:
    huge = np.array([[3e38, 0, 0], [0, -1e25, 0]], np.float32)
    told = told_velocity(huge, rule())
    np.testing.assert_allclose(told, [[2, 0, 0], [0, -2, 0]], rtol=1e-6)


def test_the_seed_shows_middle_grey_and_leaves_density_alone() -> None:
    state = np.zeros((2, 12), dtype=np.float32)
    np.testing.assert_allclose(linear_to_srgb(colours(state)), 0.5, atol=1e-6)
    np.testing.assert_array_equal(density_factors(state), 1)


def test_colour_and_density_stay_in_range_whatever_the_state() -> None:
    state = np.random.default_rng(1).normal(scale=10, size=(50, 12)).astype(np.float32)
    assert colours(state).min() >= 0
    assert colours(state).max() <= 1
    factors = density_factors(state)
    assert (factors.min(), factors.max()) == (0.5, 1.5)
    assert np.all(density_factors(state, strength=0) == 1)
