"""Aurand et al. 2022, the optimisation: smoke moved a little, frame by frame, and averaged in time.

Known from notes of readers; optimiser, rates, octaves, layers, cap and the bounds of the multiplier
are nowhere to be found and are ours, near TNST's. It saw VGG19.

Reference: Aurand, Ortiz, Nauer and Azevedo 2022, "Efficient neural style transfer for volumetric
simulations" (TOG 41(6)), as quoted in the VNCA paper.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, Literal

import torch
from jaxtyping import Float
from torch import Tensor

from vnca.core.errors import OptionError
from vnca.peers import Clip, Look, Name, Tell, require_at_least
from vnca.peers.gram import GramLoss
from vnca.peers.octaves import Octave, OctaveSettings, octaves
from vnca.peers.pyramid import normalised, normalised_flow
from vnca.peers.transport import blurred, pulled, resized, semi_lagrangian
from vnca.peers.views import FRONT, pictures

_KNOTS = 256


@dataclass(frozen=True, kw_only=True)
class AurandSettings(OctaveSettings):
    """Aurand 2022, optimised: smoke is moved along a velocity, or multiplied."""

    name: ClassVar[Name] = "aurand"
    published_gamma: ClassVar[float] = 0.1

    changes: Literal["velocity", "density"] = "velocity"
    """What is optimised: a displacement of the smoke, or a factor of its density."""
    rate: float = 0.08
    """Length of a step: cells of displacement, or change of the factor's logarithm."""
    cap: float = 4.0
    """The longest displacement, cells: little keeps the silhouette."""
    most: float = 4.0
    """The largest factor; the smallest is its inverse."""
    alpha: float = 0.3
    """Share of what the frame before leaves: 0.1 is sharp, 0.5 is smooth, 0 is frame by frame."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_at_least(self, rate=0, cap=0, most=1)
        if not 0 <= self.alpha < 1:
            raise OptionError(f"`alpha` {self.alpha}: must be at least 0 and below 1")


def aurand(clip: Clip, look: Look, settings: AurandSettings, tell: Tell) -> Tensor:
    """Stylised densities `[t, x, y, z]`."""
    stages = list(octaves(clip, settings.octaves, settings.octave_scale))
    total, done = settings.iterations * len(stages), 0
    changes: Tensor | None = None
    for stage in stages:
        changes = _carried_up(changes, stage, settings)
        loss = settings.loss(look, stage)
        gamma = settings.gamma_on(clip) / stage.ratio
        for turn in range(settings.iterations):
            value = 0.0
            for t, density in enumerate(stage.clip.density):
                step, found = _descent(density, changes[t], loss, gamma, settings)
                changes[t] -= step
                value += found
            changes = averaged(changes, stage.clip, settings.alpha, backward=turn % 2 == 1)
            changes = _bounded(changes, stage.ratio, settings)
            done += 1
            tell(done, total, value / len(changes))
    assert changes is not None, "there is at least one octave"
    return torch.stack(
        [changed(d, c, settings) for d, c in zip(clip.density, changes, strict=True)]
    )


def changed(density: Tensor, change: Tensor, settings: AurandSettings) -> Float[Tensor, "x y z"]:
    """Smoke with a displacement, or times the exponential of a field."""
    if settings.changes == "velocity":
        return pulled(density, change)
    return density * change.exp()


def averaged(
    changes: Float[Tensor, "t x y z *c"], clip: Clip, alpha: float, backward: bool
) -> Float[Tensor, "t x y z *c"]:
    """An exponential moving average along the flow of the smoke, one transport a frame.

    v*_t = (1 − α) v_t + α T(v*_{t−1}, u_{t−1}); backward from the last frame to the first.
    """
    if alpha == 0:
        return changes
    order = list(range(len(changes)))
    order = order[::-1] if backward else order
    found = changes.clone()
    for before, t in pairwise(order):
        flow = -clip.velocity[t] if backward else clip.velocity[before]
        found[t] = (1 - alpha) * changes[t] + alpha * semi_lagrangian(found[before], flow)
    return found


def equalised(pictures: Float[Tensor, "b 1 r c"]) -> Float[Tensor, "b 1 r c"]:
    """I · cdf(I): contrast as in a picture whose brightness is spread evenly. Differentiable.

    The distribution is taken of the pixels that show smoke, and as given: no gradients through it.
    """
    found = []
    for picture in pictures:
        seen = picture.detach()[picture.detach() > 0]
        if len(seen) < 2:
            found.append(picture)
            continue
        at = torch.linspace(0, 1, _KNOTS, dtype=seen.dtype, device=seen.device)
        ordered = seen.sort().values
        knots = ordered[(at * (len(ordered) - 1)).round().long()]
        upper = torch.searchsorted(knots, picture.detach().contiguous()).clamp(1, _KNOTS - 1)
        low, high = knots[upper - 1], knots[upper]
        part = ((picture - low) / (high - low).clamp_min(1e-6)).clamp(0, 1)
        found.append(picture * (at[upper - 1] + part / (_KNOTS - 1)))
    return torch.stack(found)


def _descent(
    density: Tensor, change: Tensor, loss: GramLoss, gamma: float, settings: AurandSettings
) -> tuple[Tensor, float]:
    """A step that makes one frame more like the picture, and how unlike it was."""
    change = change.detach().requires_grad_()
    seen = pictures(changed(density, change, settings), [FRONT], gamma)
    value = loss(equalised(seen))
    (found,) = torch.autograd.grad(value, change)
    smooth = blurred(found, settings.sigma)
    even = normalised_flow if settings.changes == "velocity" else normalised
    return settings.rate * even(smooth, settings.levels), value.item()


def _carried_up(changes: Tensor | None, stage: Octave, settings: AurandSettings) -> Tensor:
    """What a coarser octave found, on the cells of the next; nothing at first."""
    clip = stage.clip
    if changes is None:
        flow = settings.changes == "velocity"
        return clip.density.new_zeros(*clip.density.shape, *([3] if flow else []))
    longer = clip.shape[2] / changes.shape[3] if settings.changes == "velocity" else 1.0
    return torch.stack([resized(change, clip.shape) * longer for change in changes])


def _bounded(changes: Tensor, ratio: float, settings: AurandSettings) -> Tensor:
    if settings.changes == "velocity":
        length = changes.norm(dim=-1, keepdim=True)
        return changes * (settings.cap * ratio / length.clamp_min(1e-6)).clamp(max=1)
    most = float(torch.tensor(settings.most).log())
    return changes.clamp(-most, most)
