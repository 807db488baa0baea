"""What teaches a rule to keep its pattern where the smoke carries it, and the smoke its mass."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from vnca.core import FloatArray
from vnca.core.volume import Volume
from vnca.features.vgg import VGG16
from vnca.losses import MotionConfig
from vnca.rule import DENSITY_CHANGE, Decoder, Rule, RuleConfig, Scales
from vnca.training.config import PoolConfig, SliceConfig, SmokeConfig, ViewConfig
from vnca.training.loop import Trainer
from vnca.training.scenes.smoke import SmokeScene
from vnca.training.scenes.texture import BlockScene
from vnca.training.terms import GROWN, ConsistencyTerm, Iteration, Keeping, MassTerm, SteadinessTerm
from vnca.training.trainers import smoke_trainer

SHAPE = RuleConfig(channels=6, hidden=16, transport=True)


@pytest.fixture(scope="module")
def scene(tiny_smoke: Volume) -> SmokeScene:
    return SmokeScene(tiny_smoke, Rule.initial(SHAPE, Scales(), seed=0), ViewConfig(size=32))


@pytest.fixture
def trainer(tiny_smoke: Volume, style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16) -> Any:
    def make(**options: Any) -> Trainer:
        config = replace(
            tiny_config,
            rule=replace(tiny_config.rule, transport=True),
            motion=MotionConfig(weight=0.0),
            pool=PoolConfig(size=1, reseed_every=100),
            **options,
        )
        return smoke_trainer(tiny_smoke, style, config, vgg)

    return make


def grown(scene: SmokeScene) -> torch.Tensor:
    state = torch.randn(len(scene.domain) + 1, SHAPE.channels, generator=torch.manual_seed(0)) / 4
    state[-1] = 0
    return state


def iteration(scene: Any, before: torch.Tensor, after: torch.Tensor, age: int) -> Iteration:
    nothing = torch.zeros(())
    return Iteration(
        before=before,
        kept=before,
        after=after,
        age=age,
        frames=1.0,
        scene=scene,
        viewpoint=None,
        pictures=nothing,
        opacity=nothing,
        background=nothing,
        sums={"appearance": torch.tensor(3.0)},
    )


def test_what_stays_as_it_is_costs_nothing_and_what_is_all_new_twice_the_weight(
    scene: SmokeScene,
) -> None:
    before = grown(scene)
    term = SteadinessTerm(0.5)
    assert float(term(iteration(scene, before, before, GROWN))["steadiness"]) == 0
    other = before[:-1].flip(0)
    other = torch.cat([other, before[-1:]])
    cost = float(term(iteration(scene, before, other, GROWN))["steadiness"])
    assert cost == pytest.approx(2 * 0.5 * 3.0, rel=0.1)


def test_a_state_that_grows_is_left_to_grow(scene: SmokeScene) -> None:
    before = grown(scene)
    assert SteadinessTerm(1)(iteration(scene, before, 2 * before, GROWN - 1)) == {}


def looked_at(scene: SmokeScene, before: torch.Tensor, after: torch.Tensor, age: int) -> Iteration:
    viewpoint = scene.viewpoint(np.random.default_rng(0))
    background = torch.full((3,), 0.2)
    pictures, opacity = scene.pictures(after, viewpoint, background)
    return replace(
        iteration(scene, before, after, age),
        viewpoint=viewpoint,
        pictures=pictures,
        opacity=opacity,
        background=background,
    )


def test_what_is_seen_to_stay_costs_nothing_whatever_is_hidden(scene: SmokeScene) -> None:
    before = grown(scene)
    hidden = before.clone()
    hidden[:-1, DENSITY_CHANGE + 1 :] += 0.1
    term = ConsistencyTerm(0.5)
    assert float(term(looked_at(scene, before, hidden, GROWN))["consistency"]) == 0
    assert float(SteadinessTerm(0.5)(iteration(scene, before, hidden, GROWN))["steadiness"]) > 0.01


def test_what_is_seen_all_new_costs_twice_the_weight(scene: SmokeScene) -> None:
    before = grown(scene)
    before[:, DENSITY_CHANGE] = 0
    other = torch.cat([before[:-1].flip(0), before[-1:]]).requires_grad_()
    cost = ConsistencyTerm(0.5)(looked_at(scene, before, other, GROWN))["consistency"]
    assert cost.item() == pytest.approx(2 * 0.5 * 3.0, rel=0.3)
    cost.backward()
    assert other.grad is not None
    assert other.grad[:, :DENSITY_CHANGE].any()


def test_views_of_a_state_that_grows_may_change(scene: SmokeScene) -> None:
    before = grown(scene)
    assert ConsistencyTerm(1)(looked_at(scene, before, 2 * before, GROWN - 1)) == {}


@pytest.mark.parametrize("decoded", [False, True])
def test_mass_is_that_of_the_density_however_thin_where_it_changes(
    tiny_smoke: Volume, decoded: bool
) -> None:
    decoder = Decoder.initial(SHAPE.channels, seed=0) if decoded else None
    scene = SmokeScene(
        tiny_smoke,
        replace(Rule.initial(SHAPE, Scales(), seed=0), decoder=decoder),
        ViewConfig(size=32),
    )
    state = grown(scene)
    state[:-1, DENSITY_CHANGE] = 0.2
    assert float(scene.mass_change(state)) == pytest.approx(0.2, rel=1e-5)
    cost = MassTerm(50)(iteration(scene, state, state, 0))["mass"]
    assert float(cost) == pytest.approx(50 * 0.2**2, rel=1e-4)
    empty = scene._density == 0
    state[:-1][empty, DENSITY_CHANGE] = -0.4
    assert float(scene.mass_change(state)) == pytest.approx(0.2, rel=1e-5)


def test_smoke_carries_a_state_up_to_a_frame_along(scene: SmokeScene) -> None:
    height = torch.from_numpy(scene.domain.cells[:, 2].astype(np.float32))
    state = torch.zeros(len(scene.domain) + 1, SHAPE.channels)
    state[:-1, 0] = height

    class Whole:
        def uniform(self) -> float:
            return 1.0

    carried, worn = scene.transported(state, Whole())  # type: ignore[arg-type]
    middle = (scene._density > 0.99) & (height > float(height.median()))
    for moved in (carried, worn):
        risen = (height - moved[:-1, 0])[middle]
        # It rises by half a cell a frame.
        np.testing.assert_allclose(risen.numpy(), 0.5, atol=0.05)
        assert not moved[-1].any()


def test_what_is_worn_has_lost_of_what_is_fine_and_not_of_what_is_broad() -> None:
    scene = BlockScene(24, SliceConfig(size=32), conditioning_width=7)

    def left(length: int) -> float:
        wave = np.sin(2 * np.pi / length * scene.domain.cells[:, 0])
        state = torch.zeros(len(scene.domain) + 1, 4)
        state[:-1, 0] = torch.from_numpy(wave.astype(np.float32))
        carried, worn = scene.transported(state, np.random.default_rng(0))
        return float(worn.square().mean() / carried.square().mean())

    assert left(3) < 0.95
    assert left(12) > 0.99


def test_a_cell_that_nothing_came_to_is_left_to_grow(scene: SmokeScene) -> None:
    after = grown(scene)
    kept = after.clone()
    kept[: len(kept) // 2] = 0
    seen = looked_at(scene, kept, after, GROWN)
    assert float(SteadinessTerm(1)(seen)["steadiness"]) == 0
    assert float(ConsistencyTerm(1)(seen)["consistency"]) == 0


def test_a_block_is_carried_as_a_whole() -> None:
    scene = BlockScene(8, SliceConfig(size=32), conditioning_width=7)
    state = torch.randn(len(scene.domain) + 1, 4, generator=torch.manual_seed(0))
    state[-1] = 0
    carried = scene._carried(state, np.float32([1, 0, -2]))
    block, moved = (scene.dense(s[:-1]) for s in (state, carried))
    np.testing.assert_allclose(moved, block.roll((1, -2), (0, 2)), atol=1e-6)


@pytest.mark.parametrize("term", [SteadinessTerm(1), ConsistencyTerm(1)])
def test_a_rule_learns_to_keep_its_pattern(trainer: Callable[..., Trainer], term: Keeping) -> None:
    def changes(**options: Any) -> float:
        training = trainer(iterations=40, shortest_rollout=4, longest_rollout=4, **options)
        seen = []

        class Watched(SteadinessTerm):
            def __call__(self, shown: Iteration) -> dict[str, torch.Tensor]:
                if shown.age >= GROWN:
                    seen.append(float(term.change(shown).detach()))
                return {}

        watched = Watched(1)
        watched.name = "watched"
        training.terms = (*training.terms, watched)
        list(training.run())
        return float(np.median(seen[-8:]))

    assert changes(**{term.name: 16.0}) < 0.7 * changes()


def test_all_of_it_goes_on_from_a_snapshot(trainer: Callable[..., Trainer]) -> None:
    options = {"iterations": 8, "steadiness": 2.0, "consistency": 1.0, "mass": 10.0}
    whole, first, second = (trainer(**options) for _ in range(3))
    list(whole.run())
    for _ in range(5):
        first.improve()
    second.restore(first.snapshot())
    list(second.run())
    np.testing.assert_array_equal(whole.rule().hidden, second.rule().hidden)
