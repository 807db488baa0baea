"""The grey loss on the density: I = Σ d τ, which nothing but Δd can bring nearer to a picture."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from vnca.core import FloatArray
from vnca.core.volume import Volume
from vnca.features.vgg import VGG16
from vnca.losses import luma
from vnca.losses.appearance import AppearanceConfig, AppearanceLoss
from vnca.rule import DENSITY_CHANGE, Rule, RuleConfig
from vnca.training.config import SmokeConfig, ViewConfig
from vnca.training.scenes.framing import SmokeViewpoint
from vnca.training.scenes.smoke import SmokeScene
from vnca.training.trainers import choose_scales, smoke_trainer

GREY = torch.tensor([0.2, 0.3, 0.1])
SMALL = AppearanceConfig(layers=("relu1_1", "relu2_1", "relu3_1"), samples=128)


@pytest.fixture(params=["emission-absorption", "paper"])
def scene(request: pytest.FixtureRequest, tiny_smoke: Volume) -> SmokeScene:
    view = ViewConfig(size=32, mode=request.param)
    scales = choose_scales(tiny_smoke, SmokeConfig(view=view))
    return SmokeScene(tiny_smoke, Rule.initial(RuleConfig(channels=5), scales, seed=0), view)


def front(scene: SmokeScene) -> SmokeViewpoint:
    return SmokeViewpoint(scene.camera(0, 0), 0.0)


def test_smoke_as_it_is_looks_about_white(scene: SmokeScene) -> None:
    state = scene.seed(5)
    seen = scene.density_pictures(state, front(scene), GREY)
    view = scene.look(state, front(scene).camera)
    assert seen.shape == (1, 3, 32, 32)
    assert torch.equal(seen[:, 0], seen[:, 1])
    inside = view.opacity > 0.98
    assert inside.sum() > 30
    assert 0.8 < float(seen[0, 0][inside].mean()) < 1.2
    # What is behind is as bright as behind the coloured view.
    coloured = scene.pictures(state, front(scene), GREY)[0]
    torch.testing.assert_close(seen[0, 0, 0, 0], luma(coloured)[0, 0, 0, 0])


def test_it_shows_the_change_of_the_density_and_no_colour(scene: SmokeScene) -> None:
    state = scene.seed(5).requires_grad_()
    scene.density_pictures(state, front(scene), GREY).sum().backward()
    assert state.grad is not None
    moved = state.grad.abs().sum(0)
    assert moved[DENSITY_CHANGE] > 0
    assert not moved[:DENSITY_CHANGE].any()
    assert not moved[DENSITY_CHANGE + 1 :].any()


def bettered(scene: SmokeScene, loss: AppearanceLoss, channels: slice, source: str) -> float:
    """What share of the grey loss is left after some descent in these channels alone."""
    free = torch.zeros(len(scene.domain), 5, requires_grad=True)
    mask = torch.zeros(5)
    mask[channels] = 1
    adam = torch.optim.Adam([free], lr=0.05)
    losses = []
    for _ in range(25):
        state = torch.cat([(free * mask).clamp(-0.5, 0.5), scene.seed(5)[-1:]])
        pictures, opacity = scene.pictures(state, front(scene), loss.background)
        grey: Tensor | None = None
        if source == "density":
            grey = scene.density_pictures(state, front(scene), loss.background)
        total = loss(pictures, opacity, torch.Generator().manual_seed(0), grey).total
        losses.append(float(total.detach()))
        if not total.requires_grad:
            return 1.0
        adam.zero_grad()
        total.backward()
        adam.step()
    return losses[-1] / losses[0]


def test_colour_alone_satisfies_luma_and_density_alone_the_density(
    tiny_smoke: Volume, style: FloatArray, vgg: VGG16
) -> None:
    view = ViewConfig(size=32)
    scales = choose_scales(tiny_smoke, SmokeConfig(view=view))
    scene = SmokeScene(tiny_smoke, Rule.initial(RuleConfig(channels=5), scales, seed=0), view)
    loss = AppearanceLoss(vgg, style, replace(SMALL, colour=False, pixels=0.0), 32)
    colour, density = slice(0, 3), slice(3, 4)
    left = {
        (source, name): bettered(scene, loss, channels, source)
        for source in ("luma", "density")
        for name, channels in (("colour", colour), ("density", density))
    }
    assert left["luma", "colour"] < 0.7
    assert left["density", "colour"] == pytest.approx(1)
    assert left["density", "density"] < 0.9
    # Opaque smoke looks the same however dense: by luma, Δd is hardly taught.
    assert left["luma", "density"] > 0.95


def test_a_training_with_it_teaches_other_weights_and_is_repeatable(
    tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16
) -> None:
    def weights(source: str) -> FloatArray:
        appearance = replace(tiny_config.appearance, grey_source=source)  # type: ignore[arg-type]
        trainer = smoke_trainer(tiny_smoke, style, replace(tiny_config, appearance=appearance), vgg)
        assert all(np.isfinite(step.loss) for step in trainer.run())
        return trainer.rule().output

    density = weights("density")
    np.testing.assert_array_equal(density, weights("density"))
    assert not np.array_equal(density, weights("luma"))
