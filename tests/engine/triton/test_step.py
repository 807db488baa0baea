"""Neighbour tables read backwards, against looking through the whole table."""

from collections import Counter

import numpy as np
import pytest
import torch

from vnca.engine.automaton import stencil
from vnca.engine.domain import Border, Domain
from vnca.engine.triton.step import Perceivers

FORMS = stencil(sobel_divisor=1, laplacian_divisor=1)


@pytest.mark.parametrize("border", ["replicate", "circular"])
@pytest.mark.parametrize("occupancy", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 1, 7), (2, 1, 3), (5, 4, 3), (9, 2, 8)])
def test_every_cell_finds_all_that_perceive_it(
    shape: tuple[int, int, int], occupancy: float, border: Border
) -> None:
    alive = np.random.default_rng(0).random(shape) < occupancy
    neighbours = Domain.from_mask(alive, (0, 0, 0), border=border).neighbours
    n = neighbours.shape[1]
    expected = Counter(
        (row, source, tuple(FORMS[:, offset]))
        for (offset, source), row in np.ndenumerate(neighbours)
        if row < n
    )

    found = Perceivers.of(torch.from_numpy(neighbours))
    mutual, begin, source = found.mutual.numpy(), found.begin.numpy(), found.source.numpy()
    pairs = Counter(
        (row, int(neighbours[26 - offset, row]), tuple(FORMS[:, offset]))
        for row in range(n)
        for offset in range(27)
        if mutual[row] >> offset & 1
    )
    for row in range(n):
        for at in range(begin[row], begin[row + 1]):
            pairs[row, int(source[at]), tuple(found.weights[:, at].numpy())] += 1
    assert pairs == expected


def test_inside_a_box_no_pair_is_listed() -> None:
    alive = np.zeros((7, 8, 6), bool)
    alive[1:-1, 1:-1, 1:-1] = np.random.default_rng(1).random((5, 6, 4)) < 0.8
    found = Perceivers.of(torch.from_numpy(Domain.from_mask(alive, (0, 0, 0)).neighbours))
    assert len(found.source) == 0
