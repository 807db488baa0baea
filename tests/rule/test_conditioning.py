import dataclasses

import numpy as np
import pytest

from vnca.core import AnyArray, Box
from vnca.core.colour import linear_to_srgb
from vnca.core.errors import GridError, OptionError, ShapeError
from vnca.core.lattice import Lattice, Region
from vnca.core.volume import Volume
from vnca.engine.domain import Domain
from vnca.recipe.texture import without_prior_weights
from vnca.rule import Rule, RuleConfig, Scales, conditioning
from vnca.rule.conditioning import (
    Conditioning,
    normalised_velocity,
    priors,
    register_conditioning,
)
from vnca.rule.paint import colours, density_factors

SHAPE = (4, 2, 3)


@pytest.fixture
def known(monkeypatch: pytest.MonkeyPatch) -> None:
    """An input of our own, which other tests do not know."""
    monkeypatch.setattr(conditioning, "_KNOWN", dict(conditioning._KNOWN))
    register_conditioning(Conditioning.of_field("heat", scale=10))


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
    told = normalised_velocity(velocity, rule())
    expected = [[0, 0, 0], [1.5, 0, 0], [0, -2, 0], [1.2, 0, -1.6], [1.2, 1.6, 0]]
    np.testing.assert_allclose(told, expected, rtol=1e-6)
    assert told.dtype == np.float32


def test_a_velocity_as_large_as_a_file_can_hold_is_told_as_any_other() -> None:
    huge = np.array([[3e38, 0, 0], [0, -1e25, 0]], np.float32)
    told = normalised_velocity(huge, rule())
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


def told_heat(config: RuleConfig, **fields: AnyArray) -> AnyArray:
    volume = dataclasses.replace(smoke(), fields=fields)
    domain = Domain.from_mask(np.ones(SHAPE, bool), volume.origin)
    return priors(domain, volume, Rule.initial(config, Scales(density=0.5), seed=0))


def test_inputs_are_told_in_the_order_that_the_rule_lists_them(known: None) -> None:
    heat = np.arange(np.prod(SHAPE), dtype=np.float32).reshape(SHAPE)
    told = told_heat(RuleConfig(conditioning=("heat", "density")), heat=heat)
    assert told.shape == (heat.size, 2)
    domain = Domain.from_mask(np.ones(SHAPE, bool), smoke().origin)
    np.testing.assert_allclose(domain.scatter(told[:, 0], domain.box), heat / 10)
    np.testing.assert_allclose(domain.scatter(told[:, 1], domain.box), smoke().density / 0.5)
    config = RuleConfig(conditioning=("heat", "velocity"), velocity_prior=False)
    assert (config.inputs, config.columns("velocity")) == (5 * 12 + 4, None)
    assert config.columns("heat") == slice(0, 1)
    assert not told_heat(config, heat=heat)[:, 1:].any()


def test_an_input_that_cannot_be_told_is_named(known: None) -> None:
    config = RuleConfig(conditioning=("heat",))
    with pytest.raises(GridError, match="frame 1: the rule is conditioned on heat, and the smoke"):
        told_heat(config)
    with pytest.raises(GridError, match="frame 1: conditioning heat: not all finite"):
        told_heat(config, heat=np.full(SHAPE, np.nan, np.float32))
    with pytest.raises(ShapeError, match=r"conditioning heat: expected \(24, 1\) .* \(24, 2\)"):
        told_heat(config, heat=np.zeros((*SHAPE, 2), np.float32))


def test_a_list_of_inputs_that_cannot_be_is_refused(known: None) -> None:
    with pytest.raises(OptionError, match=r"`conditioning` wind: expected some of position.*heat"):
        RuleConfig(conditioning=("density", "wind"))
    with pytest.raises(OptionError, match="`conditioning` heat, heat: expected each of them once"):
        RuleConfig(conditioning=("heat", "heat"))
    with pytest.raises(OptionError, match="`name` density: expected another than position"):
        register_conditioning(Conditioning.of_field("density"))
    with pytest.raises(OptionError, match="`scale` 0"):
        Conditioning.of_field("heat", scale=0)
    with pytest.raises(OptionError, match="`width` 0"):
        Conditioning.of_field("heat", width=0)


def test_a_texture_gives_a_rule_its_patterns_whatever_that_is_conditioned_on(known: None) -> None:
    texture = rule(position_prior=False)
    begun = without_prior_weights(texture, ("heat",))
    assert begun.config.conditioning == ("heat",)
    np.testing.assert_array_equal(begun.hidden[:, :60], texture.hidden[:, :60])
    assert begun.hidden.shape == (texture.config.hidden, 61)
    assert not begun.hidden[:, 60].any()
