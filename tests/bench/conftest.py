"""Small cases."""

from collections.abc import Callable, Iterator

import pytest
import torch

from vnca.bench.contenders import Case
from vnca.bench.step import StepConfig

Make = Callable[..., StepConfig]


@pytest.fixture
def case() -> Case:
    """A ragged column in a box that is not a cube."""
    return Case.draw((12, 8, 9), 16, 0.3)


@pytest.fixture
def small() -> Make:
    """Makes the configuration of a measurement that takes a moment."""
    usual = {"grid": (12, 8, 9), "hidden": 16, "occupancy": 0.3, "threads": 1, "repeats": 2}
    return lambda **options: StepConfig(**{**usual, **options})


@pytest.fixture(autouse=True)
def threads_as_before() -> Iterator[None]:
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)
