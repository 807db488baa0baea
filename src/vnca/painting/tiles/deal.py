"""What each rank works on, and with: as much smoke, in tiles that lie together; cores, or a GPU."""

import os
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vnca.core import AnyArray, Box
from vnca.engine import Compute, native
from vnca.engine.device import shared_device
from vnca.ranks import Ranks


def shared(compute: Compute, ranks: Ranks) -> Compute:
    """How a rank computes that shares its machine: its part of the cores, or a GPU of its own."""
    if ranks.beside == 1:
        return compute
    cores = (os.cpu_count() or 1) // ranks.beside
    threads = max(1, min(native.default_threads(), cores))
    return replace(compute, device=shared_device(compute.device, ranks.local), threads=threads)


def dealt(tiles: Sequence[Box], weights: Sequence[float], size: int) -> list[int]:
    """The rank of each tile: runs along a curve, of which the heaviest is as light as can be.

    The curve (Morton 1966) goes through space so that what is near on it lies together, which
    makes what ranks have to tell each other small. A rank gets nothing where there is too little.

    Args:
        tiles: Cubes of one size.
        weights: Their work, such as cells of smoke.
        size: How many ranks there are.
    """
    if not tiles:
        return []
    at = np.array([tile.lower for tile in tiles], np.int64)
    edge = max(1, int(tiles[0].shape[0]))
    order = np.argsort(_morton((at - at.min(axis=0)) // edge), kind="stable")
    sorted_weights = np.asarray(weights, float)[order]
    low, high = float(sorted_weights.max()), float(sorted_weights.sum())
    for _ in range(50):
        most = (low + high) / 2
        low, high = (low, most) if _runs(sorted_weights, most)[-1] < size else (most, high)
    ranks = np.empty(len(tiles), int)
    ranks[order] = _runs(sorted_weights, high)
    return [min(rank, size - 1) for rank in ranks.tolist()]


def _runs(weights: AnyArray, most: float) -> AnyArray:
    """Numbers of runs of which none is heavier than `most`, each as long as can be."""
    runs, number, weight = np.empty(len(weights), int), 0, 0.0
    for at, each in enumerate(weights.tolist()):
        if weight + each > most and weight:
            number, weight = number + 1, 0.0
        runs[at], weight = number, weight + each
    return runs


def _morton(at: AnyArray) -> AnyArray:
    """Numbers `[t]` along the curve of places `[t, 3]`: their bits in turns."""
    found = np.zeros(len(at), np.int64)
    for bit in range(20):
        for axis in range(3):
            found |= ((at[:, axis] >> bit) & 1) << (3 * bit + 2 - axis)
    return found
