from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import torch

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.engine import Compute, open_session
from vnca.features.vgg import VGG16
from vnca.painting.flat import (
    FIELDS,
    MotionField,
    depth_columns,
    flat_domain,
    grow_flat,
    picture,
    without_depth,
)
from vnca.rule import Rule, Scales
from vnca.training.config import SliceConfig, TextureConfig
from vnca.training.scenes.flat import FlatScene
from vnca.training.trainers import initial_rule, texture_trainer


@pytest.fixture(scope="module")
def flat_config(tiny_config: TextureConfig) -> TextureConfig:
    return replace(tiny_config, dimensions=2, motion_speed=0.5)


@pytest.fixture(scope="module")
def moving_config(flat_config: TextureConfig) -> TextureConfig:
    return replace(flat_config, rule=replace(flat_config.rule, velocity_prior=True))


def with_output(rule: Rule) -> Rule:
    output = np.random.default_rng(2).normal(0, 0.2, rule.output.shape).astype(np.float32)
    return replace(rule, output=output)


@pytest.mark.parametrize("backend", ["reference", "numpy", "native", "wgsl"])
def test_a_layer_is_the_plane_to_every_backend(rule: Rule, backend: str) -> None:
    """Written out with two-dimensional filters, a step is the same."""
    columns, rows, channels = 12, 9, rule.config.channels
    domain = flat_domain(columns, rows)
    before = np.random.default_rng(0).normal(0, 0.5, (columns, rows, channels)).astype(np.float32)
    state = domain.seed(channels)
    state[:-1] = before.reshape(-1, channels)[domain.places]
    certain = replace(rule, config=replace(rule.config, update_probability=1.0))
    told = np.zeros((len(domain), rule.config.conditioning_width), np.float32)
    try:
        session = open_session(certain.automaton(0), domain, told, Compute(backend))
    except BackendUnavailableError as error:
        pytest.skip(str(error))
    found = domain.scatter(
        np.asarray(session.read(session.run(session.upload(state), range(1))))[:-1], domain.box
    )[:, 0]

    def around(x: int, z: int) -> AnyArray:
        return np.roll(before, (-x, -z), (0, 1)).astype(np.float64)

    ones = (-1, 0, 1)
    smooth = {-1: 1, 0: 2, 1: 1}
    divisor = rule.config.sobel_divisor / 4  # a layer is met three times, with 1, 2 and 1
    right = sum(around(x, z) * x * smooth[z] for x in ones for z in ones) / divisor
    up = sum(around(x, z) * z * smooth[x] for x in ones for z in ones) / divisor
    weights = {0: -76, 1: 12, 2: 7}
    laplacian = sum(around(x, z) * weights[abs(x) + abs(z)] for x in ones for z in ones)
    seen = [before, right, 0 * right, up, laplacian / rule.config.laplacian_divisor]
    z = np.concatenate(seen, -1)
    hidden = np.maximum(z @ rule.hidden[:, : 5 * channels].T + rule.bias, 0)
    np.testing.assert_allclose(found, before + hidden @ rule.output.T, atol=2e-5)


def test_opposite_edges_fit_together(rule: Rule) -> None:
    grown = picture(next(grow_flat(rule, 24, 10, steps=8)), 3)
    assert grown.shape == (30, 72, 3)
    steps = [np.abs(np.diff(grown, axis=axis)).mean() for axis in (0, 1)]
    across = np.abs(grown[0] - grown[-1]).mean(), np.abs(grown[:, 0] - grown[:, -1]).mean()
    assert steps[0] > 1e-4
    for inside, over in zip(steps, across, strict=True):
        assert 0.5 * inside < over < 2 * inside


def test_a_picture_stands_upright(rule: Rule) -> None:
    """Row 0 is the highest cell, column 0 the leftmost, as a slice from the front shows them."""
    plain = replace(rule, decoder=None)
    layer = next(grow_flat(plain, 16, 16, steps=8))
    seen = picture(layer, 1)
    scene = FlatScene(16, SliceConfig(size=32, pixels_per_cell=2.0, supersampling=1), plain)
    cells = layer.colours[:, 0].transpose(1, 0, 2)
    upright, upside_down = (np.corrcoef(seen.flat, c.flat)[0, 1] for c in (cells[::-1], cells))
    assert upright > 0.7 > upside_down + 0.3
    state = torch.from_numpy(np.ones((len(scene.domain) + 1, 6), np.float32))
    state[:-1, 0] = torch.from_numpy(scene.domain.cells[:, 2] / 16 - 0.5)
    shown = scene.preview_views(state, 32)[0][..., 0]
    assert shown[2, 16] > shown[4, 16]  # 11 and 7 cells up in the layer


def test_same_seed_same_pictures_and_life_goes_on(rule: Rule) -> None:
    one, two = (
        [layer.colours for layer in islice(grow_flat(rule, 8, 8, steps=4, pause=3, seed=1), 2)]
        for _ in range(2)
    )
    np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(one[1], next(grow_flat(rule, 8, 8, steps=7, seed=1)).colours)


@pytest.mark.parametrize("size", [(4, 64), (2**13, 2**12)])
def test_layers_that_cannot_be_are_refused(size: tuple[int, int]) -> None:
    with pytest.raises(OptionError, match="layer of"):
        flat_domain(*size)


@pytest.mark.parametrize("name", FIELDS)
def test_fields_tile_and_move_as_fast_as_asked(name: str) -> None:
    velocity = MotionField.named(name).velocity(20, 30, 0.7)
    speed = np.linalg.norm(velocity, axis=-1)
    assert velocity.shape == (20, 1, 30, 3)
    assert not velocity[..., 1].any()
    assert speed.max() == pytest.approx(0 if name == "still" else 0.7)
    for axis in (0, 2):
        inside = np.abs(np.diff(velocity, axis=axis)).max()
        over = np.abs(velocity.take(0, axis) - velocity.take(-1, axis)).max()
        assert over <= 1.01 * inside + 1e-6


def test_circular_goes_around_the_middle_against_the_clock() -> None:
    velocity = MotionField.named("circular").velocity(16, 16, 1.0)[:, 0]
    assert velocity[11, 8, 2] > 0.5  # to the right of the middle: up
    assert velocity[8, 11, 0] < -0.5  # above it: to the left


def test_vectors_of_a_file_lie_where_they_are_seen() -> None:
    vectors = np.zeros((2, 4, 2), np.float32)
    vectors[0, :, 1] = 3.0  # the upper half goes up
    velocity = MotionField("file", vectors).velocity(16, 16, 0.5)[:, 0]
    assert velocity[:, 12, 2] == pytest.approx(0.5)
    assert velocity[:, 4, 2] == pytest.approx(0, abs=0.05)


def test_an_unknown_field_is_refused() -> None:
    with pytest.raises(OptionError, match="`motion_field` sideways: expected one of still, right"):
        MotionField.named("sideways")


def test_the_target_is_in_pixels_to_the_right_and_down(moving_config: TextureConfig) -> None:
    rule = replace(initial_rule(moving_config), decoder=None)
    velocity = MotionField.named("up").velocity(16, 16, 0.5)
    slices = SliceConfig(size=64, pixels_per_cell=4.0, zoom=1.0, supersampling=2)
    scene = FlatScene(16, slices, rule, velocity=velocity)
    view = scene.viewpoint(np.random.default_rng(0))
    target, opacity = scene.motion(scene.seed(6), view, 32)
    # 16 cells are 32 pixels: half a cell is one.
    torch.testing.assert_close(target, torch.tensor([0.0, -1.0]).expand(32, 32, 2))
    assert (opacity == 1).all()


def test_cells_are_told_the_motion(moving_config: TextureConfig) -> None:
    rule = initial_rule(moving_config)
    assert rule.scales == Scales(velocity=0.5)
    velocity = MotionField.named("left").velocity(16, 16, 0.5)
    scene = FlatScene(16, moving_config.slice, rule, velocity=velocity)
    expected = torch.tensor([0, 0, 0, 0, -1.0, 0, 0]).expand(256, 7)
    torch.testing.assert_close(scene.priors, expected)


def test_training_learns_nothing_of_depth_and_something_of_the_rest(
    moving_config: TextureConfig, style: FloatArray, vgg: VGG16
) -> None:
    trainer = texture_trainer(style, moving_config, vgg, motion_field=MotionField.named("circular"))
    before = trainer.rule()
    terms = [progress.terms for progress in trainer.run()]
    assert trainer.teaches_motion
    assert not any("motion" in found for found in terms[:1])  # zeros have nothing to move
    after, depth = trainer.rule(), depth_columns(6)
    assert not after.hidden[:, depth].any()
    assert (after.hidden[:, :12] != before.hidden[:, :12]).any()
    assert (after.hidden[:, 30:] != before.hidden[:, 30:]).any()


def test_a_flat_texture_that_stands_still_is_not_taught_motion(
    flat_config: TextureConfig, style: FloatArray, vgg: VGG16
) -> None:
    trainer = texture_trainer(style, flat_config, vgg)
    assert not trainer.teaches_motion
    trainer.improve()
    assert len(trainer.scene.domain) == flat_config.block**2


def test_a_rule_that_is_told_another_motion_paints_another_picture(
    moving_config: TextureConfig,
) -> None:
    rule = with_output(initial_rule(moving_config))
    still, moved = (
        next(grow_flat(rule, 8, 8, steps=6, velocity=velocity)).colours
        for velocity in (None, MotionField.named("up").velocity(8, 8, 0.5))
    )
    assert np.abs(still - moved).max() > 1e-3


def test_depth_has_no_weight(rule: Rule) -> None:
    flat = without_depth(rule)
    changed = np.flatnonzero((flat.hidden != rule.hidden).any(0))
    np.testing.assert_array_equal(changed, np.arange(12, 18))
