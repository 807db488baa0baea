from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from vnca.io.mesh import read_mesh
from vnca.rule import Decoder, Rule, RuleConfig, Scales
from vnca.rule.paint import Between
from vnca.training.config import SliceConfig
from vnca.training.scenes.texture import BlockScene, mesh_views

PLAIN = SliceConfig(size=32, count=1, pixels_per_cell=1.0, supersampling=1)
BACKGROUND = torch.tensor([0.1, 0.2, 0.3])


def state_of(scene: BlockScene) -> torch.Tensor:
    random = torch.Generator().manual_seed(0)
    state = scene.seed(6)
    state[:-1] = 0.4 * torch.rand(len(state) - 1, 6, generator=random)
    return state


def seen(
    scene: BlockScene, state: torch.Tensor, random: np.random.Generator
) -> tuple[torch.Tensor, torch.Tensor]:
    return scene.pictures(state, scene.viewpoint(random), BACKGROUND)


def test_cells_are_told_nothing_and_see_across_the_border() -> None:
    scene = BlockScene(8, PLAIN)
    assert not scene.priors.any()
    assert (scene.domain.neighbours < len(scene.domain)).all()


def test_the_block_is_the_state_in_its_place() -> None:
    scene = BlockScene(8, PLAIN)
    state = scene.seed(6)
    cell = (scene.domain.cells == (1, 2, 3)).all(1).argmax()
    state[cell, :3] = torch.tensor([0.5, -0.5, 0.0])
    points = torch.tensor([[1.0, 2, 3], [9, -6, 11], [0, 0, 0], [7, 7, 7]])
    one, again, first, last = scene.shown(state, points)
    torch.testing.assert_close(one, torch.tensor([1.0, 0.0, 0.2140]), atol=1e-3, rtol=0)
    assert torch.equal(one, again)
    assert torch.equal(first, last)


def test_slices_fill_the_picture_and_teach_the_colours() -> None:
    scene = BlockScene(8, PLAIN)
    state = state_of(scene).requires_grad_()
    picture, opacity = seen(scene, state, np.random.default_rng(0))
    assert picture.shape == (1, 3, 32, 32)
    assert (opacity == 1).all()
    picture.sum().backward()
    assert state.grad is not None
    assert state.grad[:-1, :3].any()
    assert not state.grad[:-1, 3:].any()


def test_as_many_slices_are_cut_as_asked() -> None:
    scene = BlockScene(8, replace(PLAIN, count=3))
    pictures, opacity = seen(scene, state_of(scene), np.random.default_rng(0))
    assert pictures.shape == (3, 3, 32, 32)
    assert opacity.shape == (3, 32, 32)
    assert not torch.equal(pictures[0], pictures[1])


def test_pictures_depend_on_the_random_stream_alone() -> None:
    scene = BlockScene(8, PLAIN)
    state = state_of(scene)
    one, two, other = (seen(scene, state, np.random.default_rng(seed))[0] for seed in (1, 1, 2))
    assert torch.equal(one, two)
    assert not torch.equal(one, other)


def test_a_decoder_is_seen_as_painting_sees_it_and_learns() -> None:
    decoder = Decoder.initial(6, seed=1, units=8)
    scene = BlockScene(8, replace(PLAIN, pixels_per_cell=4.0, supersampling=2), decoder=decoder)
    state = state_of(scene).requires_grad_()
    points = torch.from_numpy(np.random.default_rng(0).uniform(-9, 20, (50, 3)).astype(np.float32))
    rule = replace(
        Rule.initial(RuleConfig(channels=6, hidden=2), Scales(), seed=0), decoder=decoder
    )
    corners = scene.domain.corners(points.numpy())
    expected = Between(rule).at(state.detach().numpy(), *corners)
    np.testing.assert_allclose(scene.seen(state, points).detach(), expected, atol=2e-5)
    assert scene.decoder is not None
    for tensor in scene.decoder:
        tensor.requires_grad_()
    picture, opacity = seen(scene, state, np.random.default_rng(0))
    assert picture.shape == (1, 3, 32, 32)
    assert (opacity == 1).all()
    picture.sum().backward()
    assert state.grad is not None
    assert state.grad[:-1, 4:].any(), "hidden channels are seen through the decoder"
    assert all(tensor.grad is not None and tensor.grad.any() for tensor in scene.decoder)


def test_a_slice_is_as_wide_as_its_cells_whatever_its_pixels() -> None:
    narrow = BlockScene(8, replace(PLAIN, pixels_per_cell=4.0, zoom=1.0))
    assert narrow.width == 8
    (cut,) = narrow.viewpoint(np.random.default_rng(0))
    assert float((cut.points[0, 0] - cut.points[0, -1]).norm()) == pytest.approx(8 * 31 / 32)


def test_samples_of_a_pixel_are_averaged(ball: Path) -> None:
    coarse = BlockScene(8, replace(PLAIN, mesh=1.0, supersampling=4), mesh=read_mesh(ball))
    _, opacity = seen(coarse, state_of(coarse), np.random.default_rng(0))
    assert opacity.shape == (1, 32, 32)
    assert ((opacity > 0) & (opacity < 1)).any(), "the rim of the mesh is soft"


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    trimesh.creation.icosphere(3, radius=40).export(tmp_path / "ball.glb")
    return tmp_path / "ball.glb"


def test_views_of_a_mesh_show_its_surface_before_the_background(ball: Path) -> None:
    scene = BlockScene(8, replace(PLAIN, mesh=1.0), mesh=read_mesh(ball))
    state = state_of(scene).requires_grad_()
    picture, opacity = seen(scene, state, np.random.default_rng(0))
    assert set(opacity.unique().tolist()) == {0.0, 1.0}
    behind = picture[0].permute(1, 2, 0)[opacity[0] == 0]
    assert (behind == behind[0]).all()
    picture.sum().backward()
    assert state.grad is not None
    assert state.grad[:-1, :3].any()


def test_a_pixel_of_a_mesh_shows_a_cell(ball: Path) -> None:
    for view in mesh_views(read_mesh(ball), 64, 64):
        # A ball as wide as its box's diagonal allows.
        radius = 64 / 2 / 3**0.5
        np.testing.assert_allclose(np.linalg.norm(view.points, axis=1), radius, rtol=0.02)
        assert view.covered.sum() == len(view.points)
        assert view.covered.sum() == pytest.approx(np.pi * radius**2, rel=0.03)


def test_slices_and_views_are_mixed_as_asked(ball: Path) -> None:
    random = np.random.default_rng(0)
    scene = BlockScene(8, replace(PLAIN, mesh=0.5), mesh=read_mesh(ball))
    state = state_of(scene)
    whole = [bool((seen(scene, state, random)[1] == 1).all()) for _ in range(40)]
    assert 10 < sum(whole) < 30
