"""What a camera sees of a volume, on tensors: its picture and its motion.

The picture is differentiable in the density and colour of the volume.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from vnca.core import AnyArray, FloatArray
from vnca.core.camera import Camera
from vnca.core.errors import OptionError, ShapeError
from vnca.rendering import (
    THINNEST,
    averaged,
    check_view,
    march,
    moved_cells,
    native,
    rays_in_cells,
    staggered,
)
from vnca.rendering.light import LightVolume
from vnca.rendering.march import sample

Mode = Literal["emission-absorption", "paper"]

Shader = Callable[[Tensor], tuple[Tensor, Tensor]]
"""What smoke is at points `[m, 3]` in cells: factors of its density `[m]`, at least
`LEAST_FACTOR`, and linear RGB `[m, 3]`."""

LEAST_FACTOR = 0.5
"""The least that a shader may multiply density by."""


@dataclass(frozen=True, eq=False)
class View:
    """What a camera sees.

    Attributes:
        colour: `[rows, columns, 3]`, linear RGB, premultiplied by opacity.
        opacity: `[rows, columns]`, in [0, 1].
        depth: `[rows, columns]`, mean depth along the ray of the smoke seen, in the camera's
            lengths; infinite where there is none.
    """

    colour: Float[Tensor, "rows columns 3"]
    opacity: Float[Tensor, "rows columns"]
    depth: Float[Tensor, "rows columns"]

    def over(
        self, background: Tensor | AnyArray | Sequence[float]
    ) -> Float[Tensor, "rows columns 3"]:
        """The view in front of a linear RGB colour or picture `[..., 3]`. Differentiable."""
        behind = torch.as_tensor(background, dtype=self.colour.dtype, device=self.colour.device)
        return self.colour + (1 - self.opacity)[..., None] * behind

    @property
    def rgba(self) -> Float[Tensor, "rows columns 4"]:
        """Premultiplied linear RGB and opacity."""
        return torch.cat([self.colour, self.opacity[..., None]], -1)


def render(
    density: Float[Tensor, "x y z"],
    colour: Float[Tensor, "x y z 3"] | Shader,
    camera: Camera,
    *,
    rows: int,
    columns: int,
    gamma: float,
    step: float = 1.0,
    offset: float = 0.0,
    mode: Mode = "emission-absorption",
    cells_to_world: AnyArray | None = None,
    supersampling: int = 1,
    light: LightVolume | None = None,
) -> View:
    """Render smoke by emission and absorption.

    Differentiable in `density` and `colour`, except for cells further than a cell from any
    smoke, and for those that so much smoke hides that they could not be seen: rays are not
    sampled there. The depth is not differentiable. Deterministic bit for bit on the CPU.

    Colours of an array: density and density times colour are interpolated, and the colour of a
    sample is their quotient: so what colour the empty cells around the smoke have is of no effect.
    A shader says what is at each sample that can be seen, however fine; the density is then that
    of the smoke before it is painted.

    Lengths are those of the space the camera is in, whatever the shape of the cells: what a slab
    of smoke absorbs depends on how thick it is there, not on how many cells it is divided into.

    Args:
        density: max(d (1 + Δd), 0), non-negative.
        colour: Linear RGB, or a shader.
        camera: Where to look from, in the space that `cells_to_world` leads to.
        rows: Height of the picture, pixels.
        columns: Width of the picture, pixels.
        gamma: Extinction of density one, 1/length.
        step: Length between samples along a ray; one in paper mode.
        offset: Shift of all samples along their rays, in steps, in [0, 1). Training draws it.
        mode: The integrand: "emission-absorption", or "paper" as the paper prints it.
        cells_to_world: 4×4, affine and invertible, from cell coordinates of these arrays (cell
            `[i, j, k]` at (i, j, k)) to where the camera is. The same unless given: lengths are
            then in cells.
        supersampling: Rays along the rows and the columns of a pixel, whose samples begin at
            different depths; the view is their mean.
        light: What lights the smoke; unless given it glows in its own colours. It passes no
            gradients on.

    Raises:
        ShapeError: If density, colour and light do not cover the same cells.
        OptionError: If an option is out of range.
    """
    shape = colour.shape if isinstance(colour, Tensor) else (*density.shape, 3)
    size = {"rows": rows, "columns": columns}
    check_view(tuple(density.shape), tuple(shape), **size, gamma=gamma, step=step)
    _check(step, offset, mode)
    if light is not None:
        light.check(density.shape)
    along, offsets = supersampling, offset
    if along > 1:
        offsets = density.new_tensor(staggered(offset, along, rows, columns))
    view = _render(
        density,
        colour,
        camera,
        rows=along * rows,
        columns=along * columns,
        gamma=gamma,
        step=step,
        offset=offsets,
        mode=mode,
        cells_to_world=cells_to_world,
        light=light,
    )
    return view if along == 1 else _averaged(view, rows, columns, along)


def _averaged(view: View, rows: int, columns: int, along: int) -> View:
    """A view of pixels of which each is the mean of `along` × `along` rays."""

    def mean(values: Tensor) -> Tensor:
        return averaged(values.flatten(0, 1), rows, columns, along)

    opacity = mean(view.opacity)
    depth = mean(torch.where(view.opacity > 0, view.depth * view.opacity, 0))
    depth = torch.where(opacity > THINNEST, depth / opacity.clamp_min(THINNEST), math.inf)
    return View(mean(view.colour), opacity, depth)


def _render(
    density: Tensor,
    colour: Tensor | Shader,
    camera: Camera,
    *,
    rows: int,
    columns: int,
    gamma: float,
    step: float,
    offset: float | Tensor,
    mode: Mode,
    cells_to_world: AnyArray | None,
    light: LightVolume | None,
) -> View:
    """A ray through the middle of each pixel; `offset` of all, or of each of them."""
    origins, directions = (
        density.new_tensor(array) for array in rays_in_cells(camera, rows, columns, cells_to_world)
    )
    light_at = None if light is None else lighting(light, density)
    field, least = density[..., None], LEAST_FACTOR
    if isinstance(colour, Tensor):
        field, least = torch.cat([field, field * colour], dim=-1), 1.0
    pixels, colours, opacities, depths = [], [], [], []
    for samples in (native if native.serves(density) else march).samples_along(
        density,
        origins,
        directions,
        near=camera.near,
        step=step,
        offset=offset,
        extinction=gamma * step * least,
    ):
        if isinstance(colour, Tensor):
            values = sample(field, samples.points)
            dense = values[:, 0]
            hue = values[:, 1:] / dense[:, None].clamp_min(THINNEST)
        else:
            factors, hue = colour(samples.points)
            plain = samples.density  # which samples were found by, without a gradient
            if density.requires_grad:
                plain = sample(field, samples.points)[:, 0]
            dense = plain * factors
        if light_at is not None:
            hue = hue * light_at(samples.points)[:, None]
        seen, passes, depth = samples.light(
            dense, hue, extinction=gamma * step, paper=mode == "paper"
        )
        pixels.append(samples.ray)
        colours.append(seen)
        opacities.append(1 - passes)
        depths.append(depth)
    return View(
        _picture(pixels, colours, density.new_zeros(rows * columns, 3)).view(rows, columns, 3),
        _picture(pixels, opacities, density.new_zeros(rows * columns)).view(rows, columns),
        _picture(pixels, depths, density.new_full((rows * columns,), math.inf)).view(rows, columns),
    )


def lighting(light: LightVolume, like: Tensor) -> Callable[[Tensor], Tensor]:
    """What colours at points `[n, 3]`, in cells of the density, are multiplied by, as `[n]`.

    Args:
        light: What lights the smoke.
        like: Of which type, and where, points are.
    """
    shadow, first, times, full = light.shade
    field, first, times = (like.new_tensor(part) for part in (shadow[..., None], first, times))

    @torch.no_grad()
    def at(points: Tensor) -> Tensor:
        return full - sample(field, (points + first) / times)[:, 0]

    return at


@torch.no_grad()
def render_arrays(
    density: FloatArray, colour: FloatArray, camera: Camera, *, device: str, **options: Any
) -> tuple[FloatArray, FloatArray]:
    """What `render` shows of density and colour in arrays, computed on a device.

    Args:
        density: `[x, y, z]`.
        colour: Linear RGB `[x, y, z, 3]`.
        camera: Where to look from.
        device: As torch names it.
        **options: Those of `render`.

    Returns:
        Colour `[rows, columns, 3]` and opacity `[rows, columns]`, as of `View`.
    """
    smoke, hue = (torch.from_numpy(array).to(device) for array in (density, colour))
    view = render(smoke, hue, camera, **options)
    return view.colour.cpu().numpy(), view.opacity.cpu().numpy()


def _picture(pixels: list[Tensor], values: list[Tensor], empty: Tensor) -> Tensor:
    """`empty` with the values of the pixels that see smoke."""
    if not pixels:
        return empty
    return empty.index_put((torch.cat(pixels),), torch.cat(values))


def _check(step: float, offset: float, mode: str) -> None:
    if not 0 <= offset < 1:
        raise OptionError(f"offset: expected 0 to less than 1, got {offset}")
    if mode not in ("emission-absorption", "paper"):
        raise OptionError(f"mode: expected emission-absorption or paper, got {mode}")
    if mode == "paper" and step != 1:
        raise OptionError(f"step: the paper's integrand is defined for a step of 1, got {step}")


@torch.no_grad()
def projected_velocity(
    density: Float[Tensor, "x y z"],
    velocity: Float[Tensor, "x y z 3"],
    camera: Camera,
    *,
    rows: int,
    columns: int,
    cells_to_world: AnyArray | None = None,
    **marching: Any,
) -> tuple[Float[Tensor, "rows columns 2"], Float[Tensor, "rows columns"]]:
    """What moves in each pixel of a view, and how opaque the pixel is.

    Each cell moves by some pixels in a frame. The camera sees these movements as it sees
    colours: the mean along a ray, weighted by how much every sample contributes to the picture.

    Args:
        density: max(d (1 + Δd), 0), non-negative.
        velocity: Cells per frame.
        camera: Where to look from, in the space that `cells_to_world` leads to.
        rows: Height of the picture, pixels.
        columns: Width of the picture, pixels.
        cells_to_world: Where the camera is, see `render`.
        **marching: `gamma`, `step`, `offset` and `mode` of `render`.

    Returns:
        Pixels per frame, to the right and down, zero where nothing is seen; and the opacity.

    Raises:
        ShapeError: If density and velocity do not cover the same cells.
        OptionError: If an option is out of range.

    Reference: VNCA section 3.4, J^ψ.
    """
    if velocity.shape != (*density.shape, 3):
        raise ShapeError(
            "velocity to project: expected [x, y, z, 3] for a density of "
            f"{tuple(density.shape)}, got {tuple(velocity.shape)}"
        )
    smoke = torch.nonzero(density > 0)
    there = tuple(smoke.T)
    moved = density.new_zeros(*density.shape, 3)
    moves = moved_cells(
        smoke.cpu().numpy(),
        velocity[there].cpu().numpy(),
        (camera, camera),
        rows,
        columns,
        cells_to_world,
    )
    # A camera sees the one as the sum of the weights of a ray, which makes the others a mean.
    moves = np.concatenate([moves, np.ones((len(moves), 1))], axis=-1)
    moved[there] = torch.from_numpy(moves).to(velocity)
    size: dict[str, Any] = {"rows": rows, "columns": columns}
    view = render(density, moved, camera, **size, cells_to_world=cells_to_world, **marching)
    weight = view.colour[..., 2:]
    return view.colour[..., :2] / weight.clamp_min(1e-6), view.opacity
