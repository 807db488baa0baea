import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vnca.engine.automaton import changing_rows, mask_threshold, mix

HASHES = mix(np.arange(20_000, dtype=np.uint32))


@given(st.floats(0, 1, exclude_min=True))
def test_any_chance_of_a_change_can_be_drawn(probability: float) -> None:
    rows = changing_rows(HASHES, seed=1, step=2, probability=probability)
    assert rows.dtype == np.int32
    assert len(rows) / len(HASHES) == pytest.approx(probability, abs=0.02)


@pytest.mark.parametrize("probability", [np.nextafter(1, 0), 1 - 2.0**-33, 1 - 2.0**-34])
def test_a_chance_next_to_one_is_not_none(probability: float) -> None:
    assert mask_threshold(probability) == 2**32 - 1
    assert len(changing_rows(HASHES, seed=1, step=2, probability=probability)) == len(HASHES)


def test_the_least_chance_is_not_none() -> None:
    assert mask_threshold(5e-324) == 1
    assert mask_threshold(0.5) == 2**31
