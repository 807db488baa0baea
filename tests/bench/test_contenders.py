import numpy as np
import pytest
import torch

from vnca.bench.contenders import Case, Place
from vnca.bench.plain import PlainUpdate
from vnca.core import Box
from vnca.engine.automaton import stencil
from vnca.engine.domain import Domain
from vnca.engine.reference import equations as reference

DOUBLE = Place("cpu", torch.float64)


@pytest.mark.parametrize("occupancy", [0.3, 1.0])
def test_the_plain_step_does_what_the_reference_does(occupancy: float) -> None:
    case = Case.draw((7, 5, 9), 16, occupancy)
    filters = torch.from_numpy(stencil()).double()
    rows, neighbours = (torch.from_numpy(a) for a in (case.rows, case.domain.neighbours))
    priors, gradient = DOUBLE.tensor(case.priors), DOUBLE.tensor(case.gradient)
    results = []
    for update in (PlainUpdate(case.domain, "cpu"), reference.update):
        inputs = [DOUBLE.tensor(a).requires_grad_() for a in (case.state, *case.weights)]
        state = inputs[0]
        for _ in range(2):  # in a rollout, where cells meet what others became
            weights = reference.Weights(*inputs[1:])
            state = update(state, rows, neighbours, priors, weights, filters)
        to_inputs = torch.autograd.grad(state[:-1], inputs, gradient[:-1])
        # What lies outside is a constant; the gradient of its row means nothing.
        results.append([state, to_inputs[0][:-1], *to_inputs[1:]])
    for plain, right in zip(*results, strict=True):
        np.testing.assert_allclose(plain.detach(), right.detach(), rtol=1e-9, atol=1e-9)


def test_the_plain_step_refuses_a_border_that_wraps(case: Case) -> None:
    wrapped = Domain(case.domain.cells, Box((0, 0, 0), (12, 8, 9)), "circular")
    with pytest.raises(ValueError, match="border"):
        PlainUpdate(wrapped, "cpu")
