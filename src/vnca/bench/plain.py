"""The step as the field writes it, on a dense grid: what everything else is compared with."""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from vnca.engine.automaton import FILTERS, Weights
from vnca.engine.domain import Domain


def plain_step(
    grid: Tensor,
    mask: Tensor,
    priors: Tensor,
    filters: Tensor,
    hidden: Tensor,
    bias: Tensor,
    output: Tensor,
) -> Tensor:
    """The state after one step; differentiable.

    Args:
        grid: State `[1, C, x, y, z]`, zero where no cell is active.
        mask: `[1, 1, x, y, z]`, 1 where cells change, 0 elsewhere.
        priors: `[1, P, x, y, z]`.
        filters: `[4C, 1, 3, 3, 3]` from `depthwise`.
        hidden: W1 `[H, 5C + P, 1, 1, 1]`, its inputs in the order of `input_order`.
        bias: b1 `[H]`.
        output: W2 `[C, H, 1, 1, 1]`.

    Returns:
        `[1, C, x, y, z]`.
    """
    padded = functional.pad(grid, (1,) * 6, mode="replicate")
    perceived = functional.conv3d(padded, filters, groups=grid.shape[1])
    z = torch.cat([grid, perceived, priors], dim=1)
    changed = functional.conv3d(torch.relu(functional.conv3d(z, hidden, bias)), output)
    return grid + mask * changed


def depthwise(stencil: Tensor, channels: int) -> Tensor:
    """The filters of `[5, 27]` but the identity, for each channel: `[4C, 1, 3, 3, 3]`."""
    return stencil[1:].view(FILTERS - 1, 1, 3, 3, 3).repeat(channels, 1, 1, 1, 1)


def input_order(channels: int, priors: int) -> Tensor:
    """Which of a rule's inputs comes where in `plain_step`.

    A depthwise convolution puts out all filters of a channel together, a rule all channels of a
    filter.
    """
    order = torch.arange(FILTERS * channels + priors)
    filtered = slice(channels, FILTERS * channels)
    order[filtered] = order[filtered].view(FILTERS - 1, channels).t().flatten()
    return order


class Grid:
    """The box of a domain as a dense grid, which values on a list of cells come to and go from."""

    def __init__(self, domain: Domain, device: torch.device | str) -> None:
        if domain.border != "replicate":
            raise ValueError("the plain step repeats its border")
        self._shape = domain.box.shape
        self._places = torch.from_numpy(domain.places).to(device)

    def spread(self, values: Tensor) -> Tensor:
        """`[1, K, x, y, z]` of values `[n, K]`, zero where no cell is active; differentiable."""
        flat = values.new_zeros(values.shape[1], int(np.prod(self._shape)))
        return flat.index_copy(1, self._places, values.t()).view(1, -1, *self._shape)

    def collect(self, grid: Tensor) -> Tensor:
        """`[n + 1, K]` of a grid, with a last row of zeros; differentiable."""
        cells = grid[0].flatten(1).index_select(1, self._places).t()
        return functional.pad(cells, (0, 0, 0, 1))


class PlainUpdate:
    """The plain step on a list of cells, for a place where a backend's step is expected.

    What it is given is spread over the grid and collected again in every step, which the field
    would not do: two of the many passes over memory that the step takes.
    """

    def __init__(
        self, domain: Domain, device: torch.device | str, *, compiled: bool = False
    ) -> None:
        self._grid = Grid(domain, device)
        self._step = torch.compile(plain_step) if compiled else plain_step
        self._known: tuple[Tensor, Tensor] | None = None  # priors as a list, and as a grid

    def __call__(
        self,
        state: Tensor,
        rows: Tensor,
        neighbours: Tensor,
        priors: Tensor,
        weights: Weights,
        stencil: Tensor,
    ) -> Tensor:
        """As `vnca.engine.reference.equations.update`; `neighbours` are those of the domain."""
        if self._known is None or self._known[0] is not priors:
            self._known = priors, self._grid.spread(priors)
        channels = state.shape[1]
        changing = state.new_zeros(len(priors), 1).index_fill(0, rows.long(), 1)
        ordered = weights.hidden[:, input_order(channels, priors.shape[1]).to(state.device)]
        grid = self._step(
            self._grid.spread(state[:-1]),
            self._grid.spread(changing),
            self._known[1],
            depthwise(stencil, channels),
            ordered[..., None, None, None],
            weights.bias,
            weights.output[..., None, None, None],
        )
        return self._grid.collect(grid)
