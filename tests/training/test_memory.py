import re
from dataclasses import replace

import pytest
import torch

from vnca.core.errors import OptionError
from vnca.core.memory import memory_budget
from vnca.core.volume import Volume
from vnca.rule import Rule, Scales
from vnca.training.config import PoolConfig, SmokeConfig, ViewConfig
from vnca.training.presets import preset
from vnca.training.rollout import (
    SAMPLE_BYTES,
    fewest_kept,
    is_out_of_memory,
    memory_advice,
    memory_free,
    memory_needs,
    memory_used,
    states_to_keep,
)
from vnca.training.scenes.smoke import SmokeScene

CPU = torch.device("cpu")
MANY = replace(preset(SmokeConfig, "draft"), longest_rollout=64, view=ViewConfig(size=32))


@pytest.fixture(scope="module")
def scene(tiny_smoke: Volume) -> SmokeScene:
    """1,328 cells."""
    return SmokeScene(tiny_smoke, Rule.initial(MANY.rule, Scales(), seed=0), MANY.view)


@pytest.fixture
def memory(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """What the program has and what is free, to be changed."""
    memory = {"used": 1e9, "free": 4e9}
    monkeypatch.setattr("vnca.training.rollout.memory_used", lambda _: memory["used"])
    monkeypatch.setattr("vnca.training.rollout.memory_free", lambda _: memory["free"])
    return memory


def test_torch_and_numpy_are_understood() -> None:
    with pytest.raises(RuntimeError) as torchs:
        torch.empty(2**50)
    assert is_out_of_memory(torchs.value)
    assert is_out_of_memory(MemoryError())
    assert is_out_of_memory(torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2 GiB"))
    assert not is_out_of_memory(RuntimeError("shapes do not fit"))
    assert not is_out_of_memory(ValueError("not enough memory"))


def test_needs_follow_the_options(scene: SmokeScene) -> None:
    needs = memory_needs([scene], MANY)
    assert needs.pool == MANY.pool.size * 1328 * 12 * 4
    assert needs.state == 1328 * (12 * 4 + 2)
    larger = replace(MANY, pool=PoolConfig(size=2 * MANY.pool.size), view=ViewConfig(size=64))
    assert memory_needs([scene], larger).pool == 2 * needs.pool
    assert memory_needs([scene], larger).pictures == 4 * needs.pictures
    assert memory_needs([scene], larger).work == needs.work
    both = replace(MANY, appearance=replace(MANY.appearance, grey=True))
    assert 1.5 * needs.pictures < memory_needs([scene], both).pictures < 2 * needs.pictures


def test_what_would_save_the_most_is_advised(scene: SmokeScene) -> None:
    pool = replace(MANY, pool=PoolConfig(size=256))
    advice = memory_advice([scene], pool, kept=20)
    assert advice.startswith("for 1328 cells training takes `pool.size` 256 about 16 MB, ")
    assert "`longest_rollout` 64 about 1 MB" in advice
    assert advice.endswith("`pool.size` 128 would take up to 8 MB less")
    assert "`view.size` 512 would take" in memory_advice(
        [scene], replace(MANY, view=ViewConfig(size=1024)), kept=20
    )
    long = replace(MANY, longest_rollout=2000)
    assert "a `memory_budget` would take" in memory_advice([scene], long, kept=2000)
    assert "a `memory_budget` would take" not in memory_advice(
        [scene], long, kept=fewest_kept(2000)
    )


@pytest.mark.parametrize(
    ("text", "bytes_"),
    [("auto", None), ("12GB", 12e9), ("800 mb", 8e8), ("1.5GiB", 1.5 * 2**30), ("2TB", 2e12)],
)
def test_budgets_are_sizes(text: str, bytes_: float | None) -> None:
    assert memory_budget(text) == bytes_


@pytest.mark.parametrize("text", ["", "12", "GB", "-1GB", "12 apples", "1e3GB", "nanGB"])
def test_what_is_no_size_is_refused(text: str) -> None:
    with pytest.raises(OptionError, match=f"`memory_budget` {text}: expected auto"):
        memory_budget(text)


def test_pictures_of_the_density_take_memory_too(scene: SmokeScene) -> None:
    appearance = replace(MANY.appearance, grey=True, grey_source="density")
    seen = memory_needs([scene], replace(MANY, appearance=appearance)).pictures
    by_luma = replace(MANY, appearance=replace(MANY.appearance, grey=True))
    sampled = 32**2 * scene.samples * SAMPLE_BYTES["cpu"]
    assert seen == pytest.approx(memory_needs([scene], by_luma).pictures + sampled, abs=1)


def test_all_states_are_kept_where_there_is_room(
    scene: SmokeScene, memory: dict[str, float]
) -> None:
    assert states_to_keep([scene], MANY, None) >= 64
    assert states_to_keep([scene], MANY, int(3e9)) >= 64
    memory["free"] = float("inf")
    assert states_to_keep([scene], MANY, None) >= 64


def test_a_smaller_budget_keeps_fewer_states_and_too_small_a_one_is_told_the_least(
    scene: SmokeScene, memory: dict[str, float]
) -> None:
    memory["used"] = 0
    with pytest.raises(OptionError, match=r"`memory_budget` 1 MB: at least \d+ MB are") as refused:
        states_to_keep([scene], MANY, int(1e6))
    assert "`pool.size` 4 about 0 MB" in str(refused.value)
    found = re.search(r"at least (\d+) MB", str(refused.value))
    assert found is not None
    least = int(found[1]) * 10**6
    fewest, few = (states_to_keep([scene], MANY, least + more * 10**6) for more in (1, 3))
    assert fewest_kept(64) <= fewest < few < 64
    memory["used"] = 1e9
    with pytest.raises(OptionError, match=r"1\.0 GB are in use already"):
        states_to_keep([scene], MANY, least)


def test_little_free_memory_is_tried_with_the_fewest_states(
    scene: SmokeScene, memory: dict[str, float]
) -> None:
    memory["free"] = 1e6
    assert states_to_keep([scene], MANY, None) == fewest_kept(64)


def test_this_program_has_memory_and_there_is_some_left() -> None:
    assert memory_used(CPU) >= 0
    assert memory_free(CPU) > 0


def test_the_largest_preset_fits_where_its_pool_does(scene: SmokeScene) -> None:
    paper = preset(SmokeConfig, "paper")
    needs = memory_needs([scene], paper)
    assert fewest_kept(paper.longest_rollout) * needs.state < needs.pool
