from dataclasses import replace

import pytest
import torch

from vnca.training.config import PRESETS, TrainConfig, ViewConfig
from vnca.training.memory import is_out_of_memory, memory_advice, memory_needs


def test_torch_and_numpy_are_understood() -> None:
    with pytest.raises(RuntimeError) as torchs:
        torch.empty(2**50)
    assert is_out_of_memory(torchs.value)
    assert is_out_of_memory(MemoryError())
    assert is_out_of_memory(torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2 GiB"))
    assert not is_out_of_memory(RuntimeError("shapes do not fit"))
    assert not is_out_of_memory(ValueError("not enough memory"))


def test_what_takes_the_most_is_halved() -> None:
    paper = PRESETS["paper"]
    advice = memory_advice(60_000, paper)
    # 256 states of 60,000 cells with 12 channels of 4 bytes
    assert "--pool.size 256 about 737 MB" in advice
    assert advice.endswith("--pool.size 128 would take 369 MB less")
    large = replace(paper, view=ViewConfig(size=1024))
    assert "--view.size 512 would take 5.5 GB less" in memory_advice(60_000, large)


def test_needs_follow_the_smoke() -> None:
    few, many = (memory_needs(cells, TrainConfig()) for cells in (1000, 2000))
    assert many["pool.size"] == 2 * few["pool.size"]
    assert many["longest-rollout"] == 2 * few["longest-rollout"]
    assert many["view.size"] == few["view.size"]
