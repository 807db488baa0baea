"""LNST for smoke: densities of particles are optimised, and smoothed in time for each of them.

Particles follow the smoke (`particles.py`), so a change that a particle carries moves with it; no
field is transported. Mended, and as published with `as_published`:
- a cell that a single particle touches is as dense as that: smoke grows by a cell all around;
- spreading draws particles out of the smoke, into empty cells.
The source of the smoke is hard-coded in the published code: here particles begin wherever there is
smoke that the others do not show. A VGG is in the place of its GoogLeNet.

Reference: Kim, Azevedo, Gross and Solenthaler 2020, "Lagrangian neural style transfer for fluids"
(arXiv 2005.00803), and its code (MIT).
"""

from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from vnca.peers import Clip, Look, Name, Settings, Tell, require_at_least
from vnca.peers.gram import GramLoss
from vnca.peers.particles import WIDTHS, Particles, sampled
from vnca.peers.splat import Splatter
from vnca.peers.views import FRONT, pictures

_SOFT = (1.0, 3.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class LnstSettings(Settings):
    """LNST (Kim 2020): densities of particles are optimised, which carry them along."""

    name: ClassVar[Name] = "lnst"
    published_gamma: ClassVar[float] = 0.01

    rate: float = 0.1
    """Of Adam, in density."""
    smoothing: float = 3.0
    """Deviation of the Gaussian over time of what a particle changes, frames; 0 is frame by
    frame."""
    spreading: int = 20
    """Steps by which particles are spread evenly in each frame."""
    as_published: bool = False
    """With the slips of the published code; the module's description lists them."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_at_least(self, rate=0, smoothing=0, spreading=0)


def lnst(clip: Clip, look: Look, settings: LnstSettings, tell: Tell) -> Tensor:
    """Stylised densities `[t, x, y, z]`."""
    frames = len(clip.density)
    total = frames + settings.iterations

    def sampling(done: int) -> None:
        tell(done, total, None)

    published = settings.as_published
    particles = sampled(clip, settings.spreading, sampling, as_published=published)
    columns, _, rows = clip.shape
    loss = GramLoss(
        look,
        rows,
        columns,
        enlarged=settings.enlarged,
        whole=settings.whole_picture,
        scaling="lnst",
    )
    gamma = settings.gamma_on(clip)
    changes = clip.density.new_zeros(frames, particles.count, len(WIDTHS))
    moments = torch.zeros_like(changes), torch.zeros_like(changes)
    for turn in range(settings.iterations):
        updates, value = torch.zeros_like(changes), 0.0
        for t in range(frames):
            born = len(particles.positions[t])
            change = changes[t, :born].requires_grad_()
            splatters = _splatters(particles, t, clip.shape, published)
            found = shown(particles, t, change, splatters)
            distance = loss(pictures(found, [FRONT], gamma))
            (slope,) = torch.autograd.grad(distance, change)
            step = _adam(slope, [m[t, :born] for m in moments], turn + 1, settings.rate)
            # What has no density of its own is not to gain any.
            updates[t, :born] = -step * particles.densities[t][:, :1]
            value += distance.item()
        changes = changes.detach() + smoothed(updates, settings.smoothing)
        tell(frames + turn + 1, total, value / frames)
    with torch.no_grad():
        return torch.stack(
            [
                shown(
                    particles,
                    t,
                    changes[t, : len(particles.positions[t])],
                    _splatters(particles, t, clip.shape, published),
                )
                for t in range(frames)
            ]
        )


def shown(
    particles: Particles, t: int, change: Float[Tensor, "n 2"], splatters: list[Splatter]
) -> Float[Tensor, "x y z"]:
    """The density that particles with changed densities make, slightly softened."""
    values = particles.densities[t] + change.clamp(-1, 1)
    density = torch.stack([splat(values[:, scale]) for scale, splat in enumerate(splatters)]).sum(0)
    line = density.new_tensor(_SOFT) / sum(_SOFT)
    kernel = line[:, None, None] * line[:, None] * line
    return functional.conv3d(density[None, None], kernel[None, None], padding=1)[0, 0].clamp_min(0)


def smoothed(updates: Float[Tensor, "t n c"], sigma: float) -> Float[Tensor, "t n c"]:
    """A Gaussian over time, ends reflected: particle i is the same in every frame."""
    frames = len(updates)
    if sigma <= 0 or frames == 1:
        return updates
    reach = max(1, round(4 * sigma))
    offsets = torch.arange(-reach, reach + 1)
    kernel = torch.exp(-0.5 * (offsets / sigma) ** 2).to(updates)
    kernel = kernel / kernel.sum()
    mixing = updates.new_zeros(frames, frames)
    for t in range(frames):
        beside = (t + offsets) % (2 * frames)
        source = torch.where(beside < frames, beside, 2 * frames - 1 - beside)
        mixing[t].index_add_(0, source, kernel)
    return torch.einsum("ts,snc->tnc", mixing, updates)


def _splatters(
    particles: Particles, t: int, shape: tuple[int, int, int], published: bool
) -> list[Splatter]:
    at = particles.positions[t]
    return [Splatter(at, shape, width, always_full=published) for width in WIDTHS]


def _adam(slope: Tensor, moments: list[Tensor], turn: int, rate: float) -> Tensor:
    """A step of Adam, whose moments are kept for each frame."""
    first, second = moments
    first.mul_(0.9).add_(slope, alpha=0.1)
    second.mul_(0.999).addcmul_(slope, slope, value=0.001)
    corrected = second / (1 - 0.999**turn)
    return rate * first / (1 - 0.9**turn) / (corrected.sqrt() + 1e-8)
