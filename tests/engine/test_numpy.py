"""The step that runs where there is neither a native kernel nor torch."""

import numpy as np
import pytest
import torch

from vnca.engine import numpy as array_reference
from vnca.engine.automaton import Weights, changing_rows, stencil
from vnca.engine.domain import Domain
from vnca.engine.reference import equations as reference


@pytest.mark.parametrize("shape", [(1, 1, 1), (7, 9, 11)])
@pytest.mark.parametrize("probability", [1e-9, 0.5, 1])
def test_it_agrees_with_the_reference(
    shape: tuple[int, int, int], probability: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(array_reference, "SLAB", 50)
    random = np.random.default_rng(0)
    domain = Domain.from_mask(random.random(shape) < 0.8, (-3, 0, 5))
    n, channels, hidden, priors = len(domain), 5, 17, 3
    shapes = (
        *((n + 1, channels), (n, priors), (hidden, 5 * channels + priors)),
        *((hidden,), (channels, hidden)),
    )
    state, told, *weights = (random.standard_normal(s).astype(np.float32) for s in shapes)
    state[-1] = 0
    rows = changing_rows(domain.hashes, seed=0, step=1, probability=probability)
    filters = stencil(sobel_divisor=30.0)
    got = array_reference.update(state, rows, domain.neighbours, told, Weights(*weights), filters)
    expected = reference.update(
        torch.from_numpy(state).double(),
        torch.from_numpy(rows),
        torch.from_numpy(domain.neighbours),
        torch.from_numpy(told).double(),
        Weights(*(torch.from_numpy(w).double() for w in weights)),
        torch.from_numpy(filters).double(),
    ).numpy()
    assert got.dtype == np.float32
    np.testing.assert_allclose(got, expected, atol=3e-6 * np.abs(expected).max())
    untouched = np.setdiff1d(np.arange(n + 1), rows)
    np.testing.assert_array_equal(got[untouched], state[untouched])
