"""Flat textures: the rule of solid ones on a layer that is one cell thick, and moves if asked to.

The layer stands upright, x to the right and z up, and is its own neighbour on every side, before
and behind too. So the gradient along y is zero, the other filters are those of the plane, and every
kernel and decoder serves as it is.

Reference: Niklasson et al. 2021, "Self-Organising Textures"; Pajouheshgar et al. 2023, "DyNCA".
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import OptionError
from vnca.engine import Compute
from vnca.engine.domain import Domain
from vnca.painting.block import SMALLEST, Block, lives, sample_block
from vnca.rule import Rule
from vnca.rule.conditioning import normalised_velocity
from vnca.rule.styles import in_style

MOST_CELLS = 2**24
"""A larger layer is refused."""
SAMPLES = 2
"""Along each side of a pixel: what is finer is averaged."""

Vectors = Callable[[AnyArray, AnyArray], tuple[AnyArray, AnyArray]]
"""Right and up, at places to the right and up, −π to π from the middle."""
FIELDS: dict[str, Vectors] = {
    "still": lambda x, z: (0 * x, 0 * z),
    "right": lambda x, z: (1 + 0 * x, 0 * z),
    "left": lambda x, z: (-1 + 0 * x, 0 * z),
    "up": lambda x, z: (0 * x, 1 + 0 * z),
    "down": lambda x, z: (0 * x, -1 + 0 * z),
    "circular": lambda x, z: (-np.sin(z), np.sin(x)),
    "hyperbolic": lambda x, z: (np.sin(x), -np.sin(z)),
    "converging": lambda x, z: (-np.sin(x), -np.sin(z)),
    "diverging": lambda x, z: (np.sin(x), np.sin(z)),
    "shear": lambda x, z: (np.sin(z), 0 * x),
    "vortices": lambda x, z: (-np.sin(2 * z), np.sin(2 * x)),
}
"""Motion fields by name. Like the pattern they tile: a sine in the place of the coordinate is the
field in the middle, and has no edge."""


@dataclass(frozen=True, eq=False)
class MotionField:
    """How a flat texture is to move.

    Attributes:
        name: To tell it by.
        vectors: `[r, c, 2]`, right and up, row 0 at the top, in any unit; None of one of `FIELDS`.
    """

    name: str
    vectors: FloatArray | None = None

    @classmethod
    def named(cls, name: str) -> "MotionField":
        """One of `FIELDS`.

        Raises:
            OptionError: If there is none of that name.
        """
        if name not in FIELDS:
            raise OptionError(f"`motion_field` {name}: expected one of {', '.join(FIELDS)}")
        return cls(name)

    def velocity(self, columns: int, rows: int, speed: float) -> FloatArray:
        """Of the cells of a layer, `[columns, 1, rows, 3]`, cells per frame.

        Args:
            columns: Of cells.
            rows: Of cells.
            speed: Of the fastest, cells per frame; vectors that are all zero stay so.
        """
        right, up = (np.arange(count) + 0.5 for count in (columns, rows))
        places = np.meshgrid(right / columns, up / rows, indexing="ij")
        if self.vectors is None:
            found = np.stack(FIELDS[self.name](*(np.pi * (2 * at - 1) for at in places)), -1)
        else:
            found = self._sampled(*places)
        velocity = np.zeros((columns, 1, rows, 3), np.float32)
        fastest = np.linalg.norm(found, axis=-1).max()
        if fastest > 0:
            velocity[:, 0, :, ::2] = found * (speed / fastest)
        return velocity

    def _sampled(self, right: AnyArray, up: AnyArray) -> FloatArray:
        """The vectors at places from 0 to 1, linear between their own."""
        assert self.vectors is not None
        block = self.vectors[::-1].transpose(1, 0, 2)[:, None]
        columns, _, rows, _ = block.shape
        points = np.stack([right * columns - 0.5, 0 * right, up * rows - 0.5], -1)
        return sample_block(block, points.reshape(-1, 3)).reshape(*right.shape, 2)


def flat_domain(columns: int, rows: int) -> Domain:
    """A layer of active cells whose opposite sides are neighbours.

    Raises:
        OptionError: If it is too small to be a texture or too large to be computed.
    """
    if min(columns, rows) < SMALLEST or columns * rows > MOST_CELLS:
        raise OptionError(
            f"layer of {columns} × {rows} cells: expected at least {SMALLEST} along each side, and "
            f"at most {MOST_CELLS} in all"
        )
    return Domain.from_mask(np.ones((columns, 1, rows), bool), (0, 0, 0), border="circular")


def conditioned(rule: Rule, domain: Domain, velocity: FloatArray | None) -> FloatArray:
    """What the cells of a layer are conditioned on, `[n, P]`: the motion field, if the rule is.

    Args:
        rule: Of one style.
        domain: The layer.
        velocity: `[columns, 1, rows, 3]`, cells per frame; none stands still.
    """
    given = np.zeros((len(domain), rule.config.conditioning_width), np.float32)
    where = rule.config.columns("velocity")
    if where is not None and velocity is not None:
        given[:, where] = normalised_velocity(velocity.reshape(-1, 3)[domain.places], rule)
    return given


def grow_flat(
    rule: Rule,
    columns: int,
    rows: int,
    *,
    steps: int,
    seed: int = 0,
    pause: int = 0,
    velocity: FloatArray | None = None,
    compute: Compute | None = None,
    watch: Callable[[], None] | None = None,
) -> Iterator[Block]:
    """Grow a flat texture from nothing, and let it live on: one layer after the other.

    Args:
        rule: Trained in the plane. One of several styles grows its first.
        columns: Of cells.
        rows: Of cells.
        steps: Steps before the first layer.
        seed: Same seed, same machine, same texture.
        pause: Steps between two layers.
        velocity: What the pattern is to move by, `[columns, 1, rows, 3]`, cells per frame.
        compute: How steps are computed.
        watch: Is called after each step.
    """
    domain, rule = flat_domain(columns, rows), in_style(rule)
    told = conditioned(rule, domain, velocity)
    yield from lives(
        rule, domain, told, steps=steps, seed=seed, pause=pause, compute=compute, watch=watch
    )


def without_depth(rule: Rule) -> Rule:
    """The rule with no weight on the gradient along y, which a layer does not have."""
    hidden = rule.hidden.copy()
    hidden[:, depth_columns(rule.config.channels)] = 0
    return replace(rule, hidden=hidden)


def depth_columns(channels: int) -> slice:
    """Where in what the hidden layer sees the gradient along y is."""
    return slice(2 * channels, 3 * channels)


def picture(layer: Block, pixels_per_cell: int) -> FloatArray:
    """A layer as one sees it, linear RGB `[r, c, 3]`; its opposite edges fit together."""
    columns, _, rows, _ = layer.colours.shape
    along = pixels_per_cell * SAMPLES
    right, up = ((np.arange(n * along) + 0.5) / along - 0.5 for n in (columns, rows))
    z, x = np.meshgrid(up[::-1], right, indexing="ij")
    seen = layer.at(np.stack([x, 0 * x, z], -1).reshape(-1, 3))
    shape = (rows * pixels_per_cell, SAMPLES, columns * pixels_per_cell, SAMPLES, 3)
    return seen.reshape(shape).mean((1, 3))
