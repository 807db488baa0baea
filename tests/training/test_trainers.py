"""What a rule is told of a frame: the same while it is trained and when it paints."""

import dataclasses
from functools import reduce

import numpy as np
import pytest
from torch import Tensor

from vnca import painting
from vnca.core import Box, FloatArray
from vnca.core.errors import GridError
from vnca.core.volume import Volume
from vnca.engine.domain import Domain, DomainKind
from vnca.features.vgg import VGG16
from vnca.painting import StylizeConfig
from vnca.rule import Rule
from vnca.rule.conditioning import priors
from vnca.training.config import SmokeConfig
from vnca.training.terms import Iteration, Term
from vnca.training.trainers import smoke_trainer


@pytest.mark.parametrize("kind", ["active", "box"])
@pytest.mark.parametrize("shift", [0, 3])
def test_the_frame_of_the_training_has_the_same_priors_in_a_painting(
    tiny_smoke: Volume,
    style: FloatArray,
    tiny_config: SmokeConfig,
    vgg: VGG16,
    kind: DomainKind,
    shift: int,
) -> None:
    """As one of a sequence whose box is larger, and whose grid may begin elsewhere."""
    config = dataclasses.replace(tiny_config.rule, position_prior=True, domain=kind)
    config = dataclasses.replace(tiny_config, rule=config)
    trainer = smoke_trainer(tiny_smoke, style, config, vgg)
    trained, told = trainer.scene.domain, []
    x, y, z = tiny_smoke.origin
    matrix = tiny_smoke.index_to_world.copy()
    matrix[:3, 3] += shift * matrix[:3, 2]
    here = dataclasses.replace(tiny_smoke, origin=(x, y, z - shift), index_to_world=matrix)
    higher = dataclasses.replace(here, origin=(x, y, z - shift + 5), frame=2)
    box = reduce(Box.union, (smoke.box for smoke in (here, higher)))

    def told_priors(domain: Domain, smoke: Volume, rule: Rule) -> FloatArray:
        told.append(priors(domain, smoke, rule))
        return told[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(painting, "priors", told_priors)
        frames = painting.stylize([here, higher], trainer.rule(), StylizeConfig(warmup=0), box=box)
        cells = next(frames).state.cells + np.array([0, 0, shift])
    rows = {tuple(cell): row for row, cell in enumerate(cells.tolist())}
    ours = [rows[tuple(cell)] for cell in trained.cells.tolist()]
    np.testing.assert_array_equal(told[0][ours], trainer.scene.priors.numpy())
    assert np.ptp(told[0][:, :3], axis=0).min() > 1.5


def test_a_frame_of_sheared_cells_is_not_trained_on(
    tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16
) -> None:
    matrix = tiny_smoke.index_to_world.copy()
    matrix[0, 2] = 0.05
    sheared = dataclasses.replace(tiny_smoke, index_to_world=matrix)
    with pytest.raises(GridError, match="frame 1: its voxels are sheared"):
        smoke_trainer(sheared, style, tiny_config, vgg)


def test_frames_are_trained_on_by_turns_and_seen_as_large(
    tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16
) -> None:
    columns = len(tiny_smoke.density)
    half = dataclasses.replace(
        tiny_smoke,
        density=tiny_smoke.density * (np.arange(columns) < columns // 2)[:, None, None],
        frame=2,
    )
    config = dataclasses.replace(tiny_config, iterations=4)
    trainer = smoke_trainer([tiny_smoke, half], style, config, vgg)
    whole, part = trainer.scenes
    assert len(part.domain) < len(whole.domain)
    assert part.width == whole.width
    assert part.viewpoint(np.random.default_rng(0)).camera.height == whole.width
    seen = []

    class Watching(Term):
        name = "watching"

        def __call__(self, asked: Iteration) -> dict[str, Tensor]:
            seen.append(len(asked.scene.domain))
            return {}

    trainer.terms = (*trainer.terms, Watching())
    for _ in trainer.run():
        pass
    assert seen == 2 * [len(whole.domain), len(part.domain)]
    pools = [name for name in trainer.snapshot() if name.startswith("pool")]
    assert pools == ["pool", "pool 2"]
