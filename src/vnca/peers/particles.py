"""Particles that follow smoke on a grid and stand for its density.

Reference: Kim et al. 2020 (LNST), section 4 and the published resimulation.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from vnca.peers import Clip
from vnca.peers.splat import Splatter, gathered, splatted_mass

WIDTHS = (2.0, 1.0)
"""Of the kernels of both scales, cells: what the wide one leaves is for the narrow one."""
_SEEDED = 0.01
"""Density that the particles there are do not show, from which a cell gets one."""
_STEP = 0.1
"""Of Adam, cells: 5·10⁻⁴ of 200."""


@dataclass(frozen=True, eq=False)
class Particles:
    """Particles of a clip; the first of a frame are those of the frame before, in the same order.

    Attributes:
        positions: In each frame `[n, 3]`, cells.
        densities: In each frame `[n, 2]`, of both scales.
    """

    positions: list[Float[Tensor, "n 3"]]
    densities: list[Float[Tensor, "n 2"]]

    @property
    def count(self) -> int:
        """How many there are in the last frame, which is all."""
        return len(self.positions[-1])


def sampled(
    clip: Clip, spreading: int, tell: Callable[[int], None], *, as_published: bool = False
) -> Particles:
    """Particles of a clip: moved with the smoke, spread evenly, and seeded where some is missing.

    Args:
        clip: The smoke.
        spreading: Steps by which they are spread in each frame.
        tell: Is told how many frames are done.
        as_published: Spread into empty cells, too, and splat as the published code does.
    """
    at = clip.density.new_zeros(0, 3)
    particles = Particles([], [])
    for t, density in enumerate(clip.density):
        if t:
            at = carried(at, clip.velocity[t - 1])
            at = spread(at, clip.shape, spreading, fills_gaps=as_published)
        missing = density - reconstructed(at, density, always_full=as_published)[1]
        at = torch.cat([at, (missing > _SEEDED).nonzero().to(at)])
        particles.positions.append(at)
        particles.densities.append(reconstructed(at, density, always_full=as_published)[0])
        tell(t + 1)
    return particles


def carried(at: Float[Tensor, "n 3"], velocity: Float[Tensor, "x y z 3"]) -> Float[Tensor, "n 3"]:
    """Positions a frame later, by the fourth-order rule of Runge and Kutta; none leaves the box."""
    first = gathered(velocity, at)
    second = gathered(velocity, at + 0.5 * first)
    third = gathered(velocity, at + 0.5 * second)
    last = gathered(velocity, at + third)
    moved = at + (first + 2 * second + 2 * third + last) / 6
    return _inside(moved, velocity.shape)


def spread(
    at: Float[Tensor, "n 3"],
    shape: tuple[int, int, int],
    steps: int,
    *,
    fills_gaps: bool = False,
) -> Float[Tensor, "n 3"]:
    """Positions at which there is nearer to one particle a cell, where there were more.

    Args:
        at: Where they are.
        shape: Cells of the grid.
        steps: How often they are moved.
        fills_gaps: Draw them to where there are fewer, too, as published: at its border that is
            out of the smoke.
    """
    if not steps or not len(at):
        return at
    at = at.clone().requires_grad_()
    optimiser = torch.optim.Adam([at], lr=_STEP)
    for _ in range(steps):
        mass = splatted_mass(at, shape, WIDTHS[0])
        pressure = torch.where(mass > 0, mass - 1, 0)
        if not fills_gaps:
            pressure = pressure.clamp_min(0)
        optimiser.zero_grad()
        pressure.square().mean().backward()
        optimiser.step()
    return _inside(at.detach(), shape)


def reconstructed(
    at: Float[Tensor, "n 3"], density: Float[Tensor, "x y z"], *, always_full: bool = False
) -> tuple[Float[Tensor, "n 2"], Float[Tensor, "x y z"]]:
    """The densities of particles in two scales, and the density that they make."""
    shown, found = torch.zeros_like(density), []
    for width in WIDTHS:
        found.append(gathered(density - shown, at))
        splat = Splatter(at, density.shape, width, always_full=always_full)
        shown = shown + splat(found[-1])
    return torch.stack(found, dim=-1), shown


def _inside(at: Tensor, shape: tuple[int, ...] | torch.Size) -> Tensor:
    return torch.minimum(at.clamp_min(0), at.new_tensor(shape[:3]) - 1)
