"""The block of solid texture that a rule grows; it tiles space."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import OptionError
from vnca.engine import Compute, open_session
from vnca.engine.domain import Domain
from vnca.rule import Rule
from vnca.rule.paint import Between, colours, require_refinement
from vnca.rule.styles import in_style

SMALLEST, LARGEST = 8, 384
"""Cells along an edge."""
_POINTS_AT_ONCE = 1 << 18
KIND = "texture"
"""What the model of a solid texture says it is, under `kind` in its record of training."""


def block_domain(size: int) -> Domain:
    """A cube of active cells whose opposite faces are neighbours.

    Raises:
        OptionError: If it is too small to be a texture or too large to be computed.
    """
    if not SMALLEST <= size <= LARGEST:
        raise OptionError(f"block of {size} cells: expected from {SMALLEST} to {LARGEST}")
    return Domain.from_mask(np.ones((size,) * 3, bool), (0, 0, 0), border="circular")


class _Decoded(NamedTuple):
    """The state of a block that a decoder shows."""

    domain: Domain
    state: FloatArray
    between: Between


@dataclass(frozen=True, eq=False)
class Block:
    """A block of solid texture, which tiles space; a layer of one is a flat texture.

    Attributes:
        colours: Linear RGB `[x, y, z, 3]` of its cells.
    """

    colours: FloatArray
    _decoded: _Decoded | None = None

    @classmethod
    def of_state(cls, domain: Domain, state: FloatArray, between: Between) -> "Block":
        """What a rule's state `[n + 1, C]` shows: between cells, what its decoder says, if any."""
        if not between.has_decoder:
            return cls(domain.scatter(colours(state[:-1]), domain.box))
        decoded = _Decoded(domain, state, between)
        return cls(_parts(decoded, 1), decoded)

    def __len__(self) -> int:
        """Cells along an edge."""
        return len(self.colours)

    def refined(self, factor: int) -> FloatArray:
        """Linear RGB on a grid `factor` times as fine, `[factor · s, …, 3]`.

        Raises:
            OptionError: If the factor is not from 1 to 8.
        """
        require_refinement(factor)
        if self._decoded is not None:
            return _parts(self._decoded, factor)
        if factor == 1:
            return self.colours
        size = tuple(factor * cells for cells in self.colours.shape[:3])
        # Part i of the finer grid is centred there.
        along = ((np.arange(parts) + 0.5) / factor - 0.5 for parts in size)
        points = np.stack(np.meshgrid(*along, indexing="ij"), -1).reshape(-1, 3)
        return sample_block(self.colours, points).reshape(*size, 3)

    def at(self, points: AnyArray, width: float = 0.0) -> FloatArray:
        """Linear RGB `[n, 3]` at points in cells, whose centres lie on whole numbers.

        Args:
            points: `[n, 3]`.
            width: Of what a point stands for, in cells: what a decoder shows finer than that is
                averaged, instead of becoming grain.
        """
        if self._decoded is None:
            return sample_block(self.colours, points)
        domain, state, between = self._decoded
        offsets = width / 4 * np.array(list(product((-1, 1), repeat=3))) if width else np.zeros(1)
        found = np.zeros((len(points), 3), np.float32)
        for start in range(0, len(points), _POINTS_AT_ONCE):
            some = slice(start, start + _POINTS_AT_ONCE)
            for offset in offsets:
                corners = domain.corners(np.asarray(points[some]) + offset)
                found[some] += colours(between.at(state, *corners))
        found /= len(offsets)
        return found


def grow(
    rule: Rule,
    size: int,
    *,
    steps: int,
    seed: int = 0,
    pause: int = 0,
    compute: Compute | None = None,
    watch: Callable[[], None] | None = None,
) -> Iterator[Block]:
    """Grow a block from nothing, and let it live on: one block after the other, without end.

    Args:
        rule: Cells know nothing but their neighbourhood: its conditioning is zero here. One of
            several styles grows its first.
        size: Cells along an edge.
        steps: Steps before the first block.
        seed: Same seed, same machine, same block.
        pause: Steps between two blocks.
        compute: How steps are computed.
        watch: Is called after each step.
    """
    domain, rule = block_domain(size), in_style(rule)
    nothing = np.zeros((len(domain), rule.config.conditioning_width), np.float32)
    yield from lives(
        rule, domain, nothing, steps=steps, seed=seed, pause=pause, compute=compute, watch=watch
    )


def lives(
    rule: Rule,
    domain: Domain,
    conditioning: FloatArray,
    *,
    steps: int,
    seed: int,
    pause: int,
    compute: Compute | None,
    watch: Callable[[], None] | None,
) -> Iterator[Block]:
    """What grows on any cells that tile space, as `grow` says, conditioned by `[n, P]`."""
    compute = compute or Compute()
    session = open_session(rule.automaton(seed), domain, conditioning, compute)
    between = Between(rule, compute.backend, threads=compute.threads)
    state = session.upload(domain.seed(rule.config.channels))
    done, waiting = 0, steps
    while True:
        state = session.run(state, range(done, done + waiting), watch)
        yield Block.of_state(domain, session.read(state), between)
        done, waiting = done + waiting, pause


def sample_block(block: FloatArray, points: AnyArray) -> FloatArray:
    """Colours `[n, c]` of a block `[x, y, z, c]` that tiles space, at points in cells.

    Trilinear between cell centres, which lie on whole numbers.
    """
    size = block.shape[:3]
    flat = block.reshape(-1, block.shape[3])
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
            total += weight[:, None] * flat[(x * size[1] + y) * size[2] + z]
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


def _parts(decoded: _Decoded, factor: int) -> FloatArray:
    """Linear RGB on a grid `factor` times as fine, of what a decoder shows."""
    domain, state, between = decoded
    colour, _ = between.parts(state, domain, factor)
    dense = domain.scatter(colour, domain.box).transpose(0, 3, 1, 4, 2, 5, 6)
    size = (factor * cells for cells in domain.box.shape)
    return np.ascontiguousarray(dense).reshape(*size, 3)
