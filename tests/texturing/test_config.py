from collections.abc import Callable

import pytest

from vnca.core.errors import OptionError
from vnca.losses.appearance import AppearanceConfig
from vnca.rule import RuleConfig
from vnca.training.config import PoolConfig, SliceConfig, TextureConfig
from vnca.training.presets import preset, preset_names


def test_presets_tell_cells_nothing() -> None:
    for name in preset_names(TextureConfig):
        rule = preset(TextureConfig, name).rule
        assert not any([rule.position_prior, rule.density_prior, rule.velocity_prior])


@pytest.mark.parametrize(
    ("make", "option"),
    [
        (lambda: SliceConfig(size=16), "`slice.size`"),
        (lambda: SliceConfig(oblique=1.5), "`slice.oblique`"),
        (lambda: SliceConfig(mesh=-1), "`slice.mesh`"),
        (lambda: SliceConfig(zoom=0.5), "`slice.zoom`"),
        (lambda: PoolConfig(size=0), "`pool.size`"),
        (lambda: TextureConfig(rule=RuleConfig()), "`density_prior`"),
        (lambda: TextureConfig(iterations=0), "`iterations`"),
        (lambda: TextureConfig(learning_rate=0), "`learning_rate`"),
        (lambda: TextureConfig(rate_warmup=-1), "`rate_warmup`"),
        (lambda: TextureConfig(milestones=(2,)), "`milestones`"),
        (lambda: TextureConfig(shortest_rollout=9, longest_rollout=8), "`shortest_rollout`"),
        (lambda: TextureConfig(overflow=-1), "`overflow`"),
        (lambda: TextureConfig(seed=-1), "`seed`"),
        (lambda: TextureConfig(block=4), "`block`"),
        (
            lambda: TextureConfig(appearance=AppearanceConfig(grey_source="density")),
            "`appearance.grey_source`",
        ),
    ],
)
def test_values_that_cannot_work_are_refused_by_name(
    make: Callable[[], object], option: str
) -> None:
    with pytest.raises(OptionError, match=option):
        make()


def test_the_learning_rate_rises_and_falls() -> None:
    config = TextureConfig(
        iterations=10, learning_rate=1.0, rate_warmup=1, milestones=(0.5,), decay=0.1
    )
    assert [config.rate(i) for i in (0, 1, 4, 5, 9)] == pytest.approx([0.5, 1, 1, 0.1, 0.1])
