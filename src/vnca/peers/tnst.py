"""TNST: smoke moved along a potential, seen from several sides, smoothed in time along the flow.

Mended, and as published with `as_published`:
- the limiter of its transport compares with the middle of the volume (`transport.maccormack`);
- views are turned in coordinates from −1 to 1, which shears a box that is no cube (`views`);
- the view that is meant to be in the middle of the others stands at half the range (`views`);
- the pyramid's way up loses a part of each band (`pyramid.PUBLISHED_GAIN`);
- gradients are averaged in time in place: later frames average averages;
- the mask is blurred in time as well as in space.
A VGG is in the place of its GoogLeNet.

Reference: Kim, Azevedo, Gross and Solenthaler 2019, "Transport-based neural style transfer for
smoke simulations" (arXiv 1905.07442), and its code (MIT).
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from vnca.peers import Clip, Look, Name, Tell, require_at_least
from vnca.peers.gram import GramLoss
from vnca.peers.octaves import OctaveSettings, octaves
from vnca.peers.pyramid import GAIN, PUBLISHED_GAIN, normalised, normalised_flow
from vnca.peers.transport import blurred, curl, gradient, maccormack, resized
from vnca.peers.views import FRONT, brightness, drawn_views, pictures

_FADED = 1e-3


@dataclass(frozen=True, kw_only=True)
class TnstSettings(OctaveSettings):
    """TNST (Kim 2019): smoke is moved along a potential that is optimised from several sides."""

    name: ClassVar[Name] = "tnst"
    published_gamma: ClassVar[float] = 0.1

    potential: Literal["scalar", "vector"] = "scalar"
    """Smoke moves along ∇φ of a scalar, or ∇×ψ of a vector potential."""
    rate: float = 0.002
    """Length of a step, in the potential."""
    views: int = 9
    """Views that each step sums over."""
    window: int = 9
    """Frames over which steps are averaged along the flow; 1 is frame by frame."""
    as_published: bool = False
    """With the slips of the published code; the module's description lists them."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_at_least(self, rate=0, views=1, window=1)


def tnst(clip: Clip, look: Look, settings: TnstSettings, tell: Tell) -> Tensor:
    """Stylised densities `[t, x, y, z]`."""
    stages = list(octaves(clip, settings.octaves, settings.octave_scale))
    random = np.random.default_rng(settings.seed)
    frames, total, done = len(clip.density), len(stages) * settings.iterations, 0
    potentials: list[Tensor] = []
    for stage in stages:
        potentials = _carried_up(potentials, stage.clip, settings)
        loss, gamma = settings.loss(look, stage), settings.gamma_on(clip) / stage.ratio
        light = [float(brightness(d, *FRONT, gamma).sum()) for d in stage.clip.density]
        brightest = max(light) or 1.0
        masks = _masks(stage.clip.density, settings)
        for _ in range(settings.iterations):
            steps, value = [], 0.0
            for t in range(frames):
                views = drawn_views(settings.views, random, published=settings.as_published)
                found = _descent(stage.clip.density[t], potentials[t], loss, views, gamma, settings)
                rate = settings.rate * light[t] / brightest
                steps.append(-rate * found[0] * _beside(masks[t], found[0]))
                value += found[1]
            steps = averaged(steps, stage.clip.velocity, settings)
            potentials = [
                (potential + step) * _beside(mask > _FADED, step)
                for potential, step, mask in zip(potentials, steps, masks, strict=True)
            ]
            done += 1
            tell(done, total, value / frames / settings.views)
    return torch.stack(
        [moved(d, p, settings) for d, p in zip(clip.density, potentials, strict=True)]
    )


def moved(density: Tensor, potential: Tensor, settings: TnstSettings) -> Float[Tensor, "x y z"]:
    """Smoke after a frame along the flow of a potential; a potential of zero leaves it alone.

    The flow is measured in half heights of the volume, so that a potential does not depend on the
    resolution.
    """
    flow = gradient(potential) if settings.potential == "scalar" else curl(potential)
    cells = density.shape[2] / 2
    found = maccormack(density, cells * flow, limits_by_centre=settings.as_published)
    return found.clamp_min(0)


def averaged(
    steps: list[Tensor], velocity: Float[Tensor, "t x y z 3"], settings: TnstSettings
) -> list[Tensor]:
    """Each frame's step averaged with its neighbours', which the flow carries there."""
    reach = (settings.window - 1) // 2
    found = list(steps)
    known = found if settings.as_published else steps
    for t in range(len(steps)):
        total, count = known[t].clone(), 1
        for direction in (-1, 1):
            for far in range(1, reach + 1):
                source = t + direction * far
                if not 0 <= source < len(steps):
                    break
                total += _carried(known[source], source, t, velocity, settings)
                count += 1
        found[t] = total / count
    return found


def _carried(
    step: Tensor, source: int, target: int, velocity: Tensor, settings: TnstSettings
) -> Tensor:
    """A field of one frame where the flow takes it in another, a frame at a time."""
    way = range(source, target) if source < target else range(source - 1, target - 1, -1)
    for t in way:
        flow = velocity[t] if source < target else -velocity[t]
        step = maccormack(step, flow, limits_by_centre=settings.as_published)
    return step


def _descent(
    density: Tensor,
    potential: Tensor,
    loss: GramLoss,
    views: list[tuple[float, float]],
    gamma: float,
    settings: TnstSettings,
) -> tuple[Tensor, float]:
    """The direction of a step, as strong in every band, and how unlike the views were."""
    potential = potential.detach().requires_grad_()
    painted = moved(density, potential, settings)
    seen = pictures(painted, views, gamma, sheared=settings.as_published)
    value = loss(seen)
    (found,) = torch.autograd.grad(value, potential)
    smooth = blurred(found, settings.sigma)
    gain = PUBLISHED_GAIN if settings.as_published else GAIN
    even = normalised if settings.potential == "scalar" else normalised_flow
    return even(smooth, settings.levels, gain), value.item()


def _masks(densities: Float[Tensor, "t x y z"], settings: TnstSettings) -> Float[Tensor, "t x y z"]:
    """Where there is smoke, softly."""
    masks = torch.stack([blurred(density, settings.sigma) for density in densities])
    if not settings.as_published or len(masks) == 1:
        return masks
    reach = max(1, round(3 * settings.sigma))
    offsets = torch.arange(-reach, reach + 1, dtype=masks.dtype)
    kernel = torch.exp(-0.5 * (offsets / settings.sigma) ** 2)
    lines = masks.flatten(1).T[:, None]
    lines = functional.pad(lines, (reach, reach), mode="replicate")
    blurred_lines = functional.conv1d(lines, (kernel / kernel.sum())[None, None])
    return blurred_lines[:, 0].T.reshape(masks.shape)


def _carried_up(potentials: list[Tensor], clip: Clip, settings: TnstSettings) -> list[Tensor]:
    """What a coarser octave found, on the cells of the next; nothing at first."""
    if potentials:
        return [resized(potential, clip.shape) for potential in potentials]
    vector = [3] if settings.potential == "vector" else []
    return [density.new_zeros(*density.shape, *vector) for density in clip.density]


def _beside(mask: Tensor, field: Tensor) -> Tensor:
    return mask[..., None] if field.ndim > mask.ndim else mask
