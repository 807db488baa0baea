"""The block of solid texture that a rule grows; it tiles space."""

from collections.abc import Callable, Iterator

import numpy as np

from vnca.core.errors import OptionError
from vnca.core.typing import AnyArray, FloatArray
from vnca.engine.domain import Domain
from vnca.engine.session import Compute, open_session
from vnca.rule.paint import colours
from vnca.rule.rule import Rule

SMALLEST, LARGEST = 8, 384
"""Cells along an edge."""
KIND = "texture"
"""What the model of a solid texture says it is, under `kind` in its record of training."""


def block_domain(size: int) -> Domain:
    """A cube of living cells whose opposite faces are neighbours.

    Raises:
        OptionError: If it is too small to be a texture or too large to be computed.
    """
    if not SMALLEST <= size <= LARGEST:
        raise OptionError(f"block of {size} cells: expected from {SMALLEST} to {LARGEST}")
    return Domain.from_mask(np.ones((size,) * 3, bool), (0, 0, 0), border="circular")


def grow(
    rule: Rule,
    size: int,
    *,
    steps: int,
    seed: int = 0,
    pause: int = 0,
    compute: Compute | None = None,
    watch: Callable[[], None] | None = None,
) -> Iterator[FloatArray]:
    """Grow a block from nothing, and let it live on: one block after the other, without end.

    Args:
        rule: Cells are told nothing but their neighbourhood: its conditioning is zero here.
        size: Cells along an edge.
        steps: Steps before the first block.
        seed: Same seed, same machine, same block.
        pause: Steps between two blocks.
        compute: How steps are computed.
        watch: Is called after each step.

    Yields:
        Linear RGB `[size, size, size, 3]`.
    """
    domain = block_domain(size)
    nothing = np.zeros((len(domain), rule.config.conditioning_width), np.float32)
    session = open_session(rule.automaton(seed), domain, nothing, compute)
    state = session.upload(domain.seed(rule.config.channels))
    done, waiting = 0, steps
    while True:
        state = session.run(state, range(done, done + waiting), watch)
        yield domain.scatter(colours(session.read(state)[:-1]), domain.box)
        done, waiting = done + waiting, pause


def sample_block(block: FloatArray, points: AnyArray) -> FloatArray:
    """Colours `[n, c]` of a block `[s, s, s, c]` that tiles space, at points in cells.

    Trilinear between cell centres, which lie on whole numbers.
    """
    size = len(block)
    flat = block.reshape(size**3, -1)
    found = np.empty((len(points), flat.shape[1]), np.float32)
    for start in range(0, len(points), 1 << 18):
        part = np.asarray(points[start : start + (1 << 18)])
        low = np.floor(part)
        share = (part - low).astype(np.float32)
        near = low.astype(np.int64) % size
        far = (near + 1) % size
        total = np.zeros((len(part), flat.shape[1]), np.float32)
        for corner in np.ndindex(2, 2, 2):
            x, y, z = (np.where(c, far[:, k], near[:, k]) for k, c in enumerate(corner))
            weight = np.prod(np.where(corner, share, 1 - share), axis=1)
            total += weight[:, None] * flat[(x * size + y) * size + z]
        found[start : start + (1 << 18)] = total
    return found


def border_jump(block: FloatArray) -> float:
    """How much more neighbours across the block's border differ than neighbours inside it.

    One for a block that tiles: the mean difference across the border over that inside.
    """
    across, inside = [], []
    for axis in range(3):
        difference = np.abs(block - np.roll(block, 1, axis))
        across.append(difference.take(0, axis).mean())
        inside.append(difference.take(range(1, block.shape[axis]), axis).mean())
    return float(np.mean(across) / max(np.mean(inside), 1e-12))
