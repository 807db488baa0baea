"""Neighbour tables read backwards: which cells perceive a cell."""

from typing import NamedTuple

import torch
from torch import Tensor

from vnca.engine.stencil import NEIGHBOURS, stencil


class Perceivers(NamedTuple):
    """For each cell r, all cells i and offsets o with `neighbours[o, i] == r`.

    Nearly always i is itself a neighbour of r, at the opposite offset. Where the border of a box
    repeats cells it need not be; those pairs are listed, by r.

    Attributes:
        mutual: `[n]` int32; bit o is set if `neighbours[26 - o, r]` is such an i.
        begin: `[n + 1]` int32; the other pairs of r are those from `begin[r]` to `begin[r + 1]`.
        source: Their cells i, int32.
        weights: `[5, pairs]` of the filters at their offsets o, whole numbers, before any scale.
    """

    mutual: Tensor
    begin: Tensor
    source: Tensor
    weights: Tensor

    @classmethod
    def of(cls, neighbours: Tensor) -> "Perceivers":
        """Read a table `[27, n]` backwards, on its own device."""
        n = neighbours.shape[1]
        cells = torch.arange(n, dtype=torch.int32, device=neighbours.device)
        mutual = torch.zeros_like(cells)
        pairs = []
        for offset, opposite in zip(range(NEIGHBOURS), reversed(neighbours), strict=True):
            mutual |= _looks_back(opposite, neighbours[offset], cells).int() << offset
            target = neighbours[offset]
            one_way = (target < n) & ~_looks_back(target, opposite, cells)
            source = cells[one_way]
            pairs.append(torch.stack([target[one_way], source, torch.full_like(source, offset)]))
        target, source, offset = torch.cat(pairs, dim=1)
        target, order = torch.sort(target, stable=True)
        begin = torch.searchsorted(
            target, torch.arange(n + 1, device=target.device), out_int32=True
        )
        forms = torch.from_numpy(stencil(sobel_divisor=1, laplacian_divisor=1))
        weights = forms.to(offset.device)[:, offset[order].long()].contiguous()
        return cls(mutual, begin, source[order], weights)


def _looks_back(there: Tensor, back: Tensor, cells: Tensor) -> Tensor:
    """Which `cells` are found again by looking from the rows `there` along the table `back`."""
    n = len(cells)
    if n == 0:
        return torch.zeros_like(cells, dtype=torch.bool)
    return (there < n) & (back[there.clamp(max=n - 1).long()] == cells)
