from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from vnca.core import Box
from vnca.core.errors import GridError
from vnca.core.volume import Volume
from vnca.rule import Rule, RuleConfig, Scales, density_scale
from vnca.rule.conditioning import normalised_velocity
from vnca.training.config import SmokeConfig, ViewConfig
from vnca.training.scenes.smoke import (
    DENSEST,
    SPEEDS,
    STRONGEST,
    SmokeScene,
    smoke_bounds,
    velocity_scale,
    view_width,
)
from vnca.training.trainers import choose_scales

MOVING = Rule.initial(RuleConfig(channels=4, hidden=2), Scales(velocity=2.0), seed=0)


def scene(smoke: Volume, view: ViewConfig | None = None, **scales: float) -> SmokeScene:
    rule = Rule.initial(RuleConfig(channels=4, hidden=2), Scales(**scales), seed=0)
    return SmokeScene(smoke, rule, view or ViewConfig(size=32))


def augmented(smoke: Volume, rule: Rule = MOVING) -> SmokeScene:
    return SmokeScene(smoke, rule, ViewConfig(size=32), augment=True)


def test_the_density_that_counts_as_one_ignores_empty_cells_and_a_few_bright_ones() -> None:
    density = np.zeros((10, 10, 20), np.float32)
    density[:, :, :10] = 2
    density[0, 0, 0] = 1000
    assert density_scale(density) == 2
    assert density_scale(np.zeros((2, 2, 2), np.float32)) == 1


def test_the_velocity_that_counts_as_one_is_the_rms_speed_in_the_smoke() -> None:
    density = np.zeros((4, 4, 4), np.float32)
    density[:2] = 1
    velocity = np.zeros((4, 4, 4, 3), np.float32)
    velocity[0] = (3, 0, 4)
    velocity[3] = 100  # outside of the smoke
    smoke = Volume(density, velocity, (0, 0, 0), np.eye(4), 1)
    assert velocity_scale(smoke) == pytest.approx(5 / np.sqrt(2))
    assert velocity_scale(replace(smoke, velocity=None)) == 1
    assert velocity_scale(replace(smoke, velocity=0 * velocity)) > 0


def test_a_given_gamma_and_the_units_of_the_file_are_kept_apart(tiny_smoke: Volume) -> None:
    config = SmokeConfig(view=ViewConfig(gamma=0.25))
    assert choose_scales(tiny_smoke, config).gamma == 0.25
    bright = replace(tiny_smoke, density=50 * tiny_smoke.density)
    plain, scaled = (choose_scales(s, SmokeConfig()) for s in (tiny_smoke, bright))
    assert scaled.density == pytest.approx(50 * plain.density)
    assert scaled.gamma == pytest.approx(plain.gamma, rel=1e-4)


def test_the_smoke_is_framed_by_the_cells_that_count(tiny_smoke: Volume) -> None:
    assert smoke_bounds(tiny_smoke, 1.0) == Box((-2, 5, 8), (8, 15, 18))
    faint = np.zeros((5, 5, 5), np.float32)
    faint[0, 0, 0], faint[1, 2, 3] = 1e-3, 1
    assert smoke_bounds(replace(tiny_smoke, density=faint, velocity=None), 1.0) == Box(
        (-2, 6, 10), (-1, 7, 11)
    )


def test_a_frame_without_smoke_cannot_be_trained_on(tiny_smoke: Volume) -> None:
    with pytest.raises(GridError, match="no smoke"):
        scene(replace(tiny_smoke, density=0 * tiny_smoke.density))


def test_a_state_of_zeros_looks_grey_and_as_dense_as_the_smoke(tiny_smoke: Volume) -> None:
    there = scene(tiny_smoke, gamma=0.6)
    view = there.look(there.seed(4), there.camera(30, 10))
    seen = view.opacity > 0.5
    assert 0.3 < float(seen.float().mean()) < 0.9
    grey = (view.colour / view.opacity[..., None])[seen]
    torch.testing.assert_close(grey, torch.full_like(grey, 0.2140), atol=1e-3, rtol=0)


def test_the_painting_shows_from_where_it_is_on_the_smoke(tiny_smoke: Volume) -> None:
    """Left half red, seen from the front; red on the right, seen from the back."""
    there = scene(tiny_smoke, gamma=5.0)
    state = there.seed(4)
    is_left = torch.from_numpy(there.domain.cells[:, 0] < 3)
    state[:-1, 0] = torch.where(is_left, 0.5, -0.5)
    for azimuth, red_side in ((0, 0), (180, 1)):
        view = there.look(state, there.camera(azimuth, 0))
        halves = view.colour[..., 0].split(16, dim=1)
        assert halves[red_side].mean() > 10 * halves[1 - red_side].mean()


def test_cells_live_near_the_smoke_or_in_its_whole_box(tiny_smoke: Volume) -> None:
    seen = []
    for domain in ("active", "box"):
        config = RuleConfig(channels=4, hidden=2, domain=domain)  # type: ignore[arg-type]
        rule = Rule.initial(config, Scales(), seed=0)
        there = SmokeScene(tiny_smoke, rule, ViewConfig(size=32))
        is_box = len(there.domain) == np.prod(there.domain.box.shape)
        assert is_box == (domain == "box")
        state = there.seed(4)
        camera = there.camera(0, 0)
        seen.append(there.look(state, camera).opacity)
    torch.testing.assert_close(*seen)


def test_half_of_the_views_see_thinner_smoke_where_asked(tiny_smoke: Volume) -> None:
    there = scene(tiny_smoke, ViewConfig(size=32, thinnest=0.1), gamma=2.0)
    random = np.random.default_rng(0)
    drawn = np.array([there.viewpoint(random).thinness for _ in range(400)])
    thin = drawn[drawn < 1]
    assert 160 < len(thin) < 240
    assert 0.1 <= thin.min() < 0.12
    # As many below the geometric middle as above it.
    assert 0.4 < (thin < np.sqrt(0.1)).mean() < 0.6
    always = scene(tiny_smoke, gamma=2.0)
    assert {always.viewpoint(random).thinness for _ in range(20)} == {1.0}


def test_thinner_smoke_is_as_with_a_smaller_gamma(tiny_smoke: Volume) -> None:
    there, thin = scene(tiny_smoke, gamma=2.0), scene(tiny_smoke, gamma=0.2)
    state, background = there.seed(4), torch.zeros(3)
    view = there.viewpoint(np.random.default_rng(0))
    seen = there.pictures(state, view._replace(thinness=0.1), background)
    expected = thin.pictures(state, view._replace(thinness=1.0), background)
    for ours, theirs in zip(seen, expected, strict=True):
        torch.testing.assert_close(ours, theirs)
    assert float(seen[1].mean()) < 0.7 * float(there.pictures(state, view, background)[1].mean())


def lying(smoke: Volume, way: int) -> Volume:
    """The same smoke of the world, with index axes exchanged and mirrored."""
    order = [(2, 0, 1), (1, 0, 2)][way]
    density = smoke.density.transpose(order)[:, ::-1]
    assert smoke.velocity is not None
    velocity = smoke.velocity.transpose(*order, 3)[:, ::-1][..., order] * np.array(
        [1, -1, 1], np.float32
    )
    turn = np.eye(4)[:, (*order, 3)]
    turn[:, 1] *= -1
    matrix = smoke.index_to_world @ turn
    matrix[:3, 3] -= matrix[:3, 1] * (density.shape[1] - 1)
    return Volume(density.copy(), velocity.copy(), (0, 0, 0), matrix, smoke.frame)


@pytest.mark.parametrize("way", [0, 1])
@pytest.mark.parametrize("azimuth", [0, 50])
def test_views_are_of_the_world_however_cells_are_counted(
    tiny_smoke: Volume, way: int, azimuth: float
) -> None:
    """A mirrored, turned or uneven grid shows the same smoke in the same slot."""
    shape = (12, 14, 10)
    density = np.zeros(shape, np.float32)
    density[2:10, 3:12, 1:6], density[5:7, 5:9, 5:9] = 1, 1  # no symmetry
    flat = Volume(density, np.full((*shape, 3), (0.5, 0.2, -0.3), np.float32), (0, 0, 0),
                  tiny_smoke.index_to_world, 1)  # fmt: skip
    one, other = scene(flat, gamma=2.0), scene(lying(flat, way), gamma=2.0)
    views = [s.look(s.seed(4), s.camera(azimuth, 20)) for s in (one, other)]
    assert float(views[0].opacity.mean()) > 0.2
    torch.testing.assert_close(views[0].opacity, views[1].opacity, atol=1e-3, rtol=0)
    viewpoints = [s.viewpoint(np.random.default_rng(1)) for s in (one, other)]
    motions = [
        s.motion(s.seed(4), viewpoint, 32)
        for s, viewpoint in zip((one, other), viewpoints, strict=True)
    ]
    torch.testing.assert_close(motions[0][0], motions[1][0], atol=1e-3, rtol=1e-3)


def test_smoke_on_uneven_cells_is_as_high_and_as_opaque_as_in_the_world(tiny_smoke: Volume) -> None:
    flat = replace(tiny_smoke, density=np.ones((8, 8, 8), np.float32), velocity=None)
    uneven = replace(flat, index_to_world=np.diag([0.1, 0.1, 0.4, 1.0]))
    high = scene(uneven, gamma=0.2)
    view = high.look(high.seed(4), high.camera(0, 0))
    seen = view.opacity > 0.1
    rows, columns = (int(seen.any(axis).sum()) for axis in (1, 0))
    assert 3.5 < rows / columns < 4.5
    # Eight cells of 0.1, where γ is per edge of a cube as large as a cell.
    edge = np.cbrt(0.1 * 0.1 * 0.4)
    assert float(view.opacity.max()) == pytest.approx(1 - np.exp(-0.2 * 0.8 / edge), rel=0.05)
    assert view_width(uneven.box, uneven.index_to_world) > view_width(flat.box, flat.index_to_world)


def angles(there: SmokeScene, count: int = 40) -> set[tuple[float, float]]:
    """Azimuths and elevations that training looks from."""
    random = np.random.default_rng(0)
    cameras: list[Any] = [there.viewpoint(random).camera for _ in range(count)]
    return {(camera.azimuth, camera.elevation) for camera in cameras}


def test_training_looks_from_all_around_unless_told_otherwise(tiny_smoke: Volume) -> None:
    azimuths, elevations = zip(*angles(scene(tiny_smoke, ViewConfig(elevation=20))), strict=True)
    assert len({azimuth // 90 for azimuth in azimuths}) == 4
    assert -20 <= min(elevations) < 0 < max(elevations) <= 20


def test_training_looks_from_the_azimuths_given_and_no_other(tiny_smoke: Volume) -> None:
    few = ViewConfig(azimuths=(0, 90, -30), elevation=0)
    assert angles(scene(tiny_smoke, few)) == {(0, 0), (90, 0), (-30, 0)}
    single = ViewConfig(azimuths=(45,), elevation=0)
    assert angles(scene(tiny_smoke, single)) == {(45, 0)}


def test_a_look_is_differentiable_in_what_is_shown_only(tiny_smoke: Volume) -> None:
    there = scene(tiny_smoke, gamma=0.5)
    state = there.seed(6).requires_grad_()
    view = there.look(state, there.camera(0, 0))
    view.over([0.1, 0.2, 0.3]).sum().backward()
    assert state.grad is not None
    moved = state.grad.abs().sum(0)
    assert bool((moved[:4] > 0).all())
    assert not moved[4:].any()


def test_an_augmentation_turns_all_of_the_velocity_alike_and_adds_to_it(tiny_smoke: Volume) -> None:
    base = augmented(tiny_smoke)
    before = base.velocity.clone(), base.priors.clone()
    turned, other = base.augmented(3), base.augmented(5)
    # Among cells, velocities differ as they did, turned and scaled.
    own, new = (s.velocity.numpy().astype(float) for s in (base, turned))
    affine, *_ = np.linalg.lstsq(np.c_[own, np.ones(len(own))], new, rcond=None)
    np.testing.assert_allclose(np.c_[own, np.ones(len(own))] @ affine, new, atol=1e-4)
    factor = np.cbrt(np.linalg.det(affine[:3]))
    assert SPEEDS[0] <= factor <= SPEEDS[1]
    np.testing.assert_allclose(affine[:3] @ affine[:3].T, factor**2 * np.eye(3), atol=1e-4)
    assert 0 < np.linalg.norm(affine[3]) <= STRONGEST * MOVING.scales.velocity
    assert torch.equal(base.augmented(3).velocity, turned.velocity)
    assert not torch.allclose(other.velocity, turned.velocity)
    assert torch.equal(base.velocity, before[0])
    assert torch.equal(base.priors, before[1])


def test_at_even_slots_the_smoke_moves_slower_or_faster(
    tiny_smoke: Volume,
) -> None:
    base = augmented(tiny_smoke)
    speed, speeds = (s.velocity.norm(dim=-1) for s in (base, base.augmented(4)))
    factors = speeds[speed > 0] / speed[speed > 0]
    torch.testing.assert_close(factors, factors[:1].expand_as(factors))
    assert SPEEDS[0] <= float(factors[0]) <= SPEEDS[1]
    torch.testing.assert_close(base.augmented(4).velocity, base.velocity * factors[0])


def test_the_velocity_and_density_conditioned_on_are_not_those_seen(tiny_smoke: Volume) -> None:
    base = augmented(tiny_smoke)
    turned = base.augmented(3)
    told = torch.from_numpy(normalised_velocity(turned.velocity.numpy(), MOVING))
    assert torch.equal(turned.priors[:, 4:], told)
    assert torch.equal(turned.priors[:, :3], base.priors[:, :3])
    thin, dense = base.priors[:, 3], turned.priors[:, 3]
    torch.testing.assert_close(dense, thin * (dense.max() / thin.max()))
    assert 1 / DENSEST <= dense.max() / thin.max() <= DENSEST
    assert torch.equal(turned._density, base._density)


def test_no_more_density_is_told_in_training_than_in_painting(tiny_smoke: Volume) -> None:
    """What is denser than the limit is made denser or thinner before it is limited."""
    steep = replace(tiny_smoke, density=tiny_smoke.density**4 * 6)
    base = augmented(steep)
    seen = base._density
    assert seen.max() > 5
    for slot in range(12):
        told = base.augmented(slot).priors[:, 3]
        assert told.max() <= 4
        thin = told < 4
        factor = (told / seen)[thin & (seen > 0)]
        torch.testing.assert_close(factor, factor[:1].expand_as(factor))
        torch.testing.assert_close(told, (factor[0] * seen).clamp_max(4))
    assert not augmented(steep, without_density()).augmented(3).priors[:, 3].any()


def without_density() -> Rule:
    return Rule.initial(replace(MOVING.config, density_prior=False), MOVING.scales, seed=0)


def test_a_rule_without_the_velocity_prior_has_none_when_augmented(tiny_smoke: Volume) -> None:
    deaf = Rule.initial(replace(MOVING.config, velocity_prior=False), Scales(), seed=0)
    turned = augmented(tiny_smoke, deaf).augmented(3)
    assert turned.velocity.any()
    assert not turned.priors[:, 4:].any()


def test_without_augmentation_all_slots_are_the_same(tiny_smoke: Volume) -> None:
    calm = scene(tiny_smoke)
    assert calm.augmented(3) is calm


def test_nothing_is_augmented_where_nothing_moves(tiny_smoke: Volume) -> None:
    still = augmented(replace(tiny_smoke, velocity=None))
    assert still.augmented(3) is still
