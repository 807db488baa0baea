"""Pictures of painted smoke for films: arrays in, arrays out.

On the CPU the native core draws them, whatever else is installed; torch does on other devices, and
where the native core is missing.
"""

import math
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.camera import Camera
from vnca.core.errors import BackendUnavailableError
from vnca.engine import native
from vnca.engine.native.marching import Marcher, Rays
from vnca.rendering import UNSEEN, averaged, check_view, rays_in_cells, staggered
from vnca.rendering.light import LightVolume

_RAYS_AT_ONCE = 2**20
"""A ray takes some sixty bytes: so many are held that threads have enough to share."""


class Picture(NamedTuple):
    """What a camera sees.

    Attributes:
        colour: `[rows, columns, 3]`, linear RGB, premultiplied by opacity.
        opacity: `[rows, columns]`, in [0, 1].
    """

    colour: FloatArray
    opacity: FloatArray

    def over(self, background: AnyArray | Sequence[float]) -> FloatArray:
        """The picture in front of a linear RGB colour or picture `[..., 3]`."""
        passes = np.float32(1) - self.opacity[..., None]
        return self.colour + passes * np.asarray(background, np.float32)

    @property
    def rgba(self) -> FloatArray:
        """Premultiplied linear RGB and opacity, `[rows, columns, 4]`."""
        return np.concatenate([self.colour, self.opacity[..., None]], axis=-1)


def require_renderer(device: str = "cpu") -> None:
    """Raise `BackendUnavailableError` unless pictures can be rendered on a device."""
    if not _is_native(device) and find_spec("torch") is None:
        reason = (
            native.unavailable() if device == "cpu" else f"it works on the CPU, not on {device}"
        )
        raise BackendUnavailableError(
            "films need the native core or torch; there is no torch (pip install 'vnca[train]'), "
            f"and the native core cannot run: {reason}"
        )


def render(
    density: FloatArray,
    colour: FloatArray,
    camera: Camera,
    *,
    rows: int,
    columns: int,
    gamma: float,
    step: float = 1.0,
    cells_to_world: AnyArray | None = None,
    supersampling: int = 1,
    light: LightVolume | None = None,
    device: str = "cpu",
) -> Picture:
    """Render painted smoke by emission and absorption, as `vnca.rendering.view.render` does.

    Deterministic bit for bit on the CPU, whatever the number of threads.

    Args:
        density: `[x, y, z]`, max(d (1 + Δd), 0), non-negative.
        colour: Linear RGB `[x, y, z, 3]`.
        camera: Where to look from, in the space that `cells_to_world` leads to.
        rows: Height of the picture, pixels.
        columns: Width of the picture, pixels.
        gamma: Extinction of density one, 1/length.
        step: Length between samples along a ray.
        cells_to_world: 4×4, affine and invertible, from cells to where the camera is.
        supersampling: Rays along the rows and the columns of a pixel.
        light: What lights the smoke; unless given it glows in its own colours.
        device: Where to render: `cpu`, or as torch names it.

    Raises:
        BackendUnavailableError: If there is neither the native core nor torch for that device.
        ShapeError: If density, colour and light do not cover the same cells.
        OptionError: If an option is out of range.
    """
    size = {"rows": rows, "columns": columns}
    require_renderer(device)
    if not _is_native(device):
        from vnca.rendering.view import render_arrays

        return Picture(
            *render_arrays(
                density,
                colour,
                camera,
                device=device,
                **size,
                gamma=gamma,
                step=step,
                cells_to_world=cells_to_world,
                supersampling=supersampling,
                light=light,
            )
        )
    check_view(density.shape, colour.shape, **size, gamma=gamma, step=step)
    if light is not None:
        light.check(density.shape)
    marcher, hue = Marcher(_float32(density)), _float32(colour)
    shade = light.shade if light else None
    seen = Picture(np.empty((rows, columns, 3), np.float32), np.empty((rows, columns), np.float32))
    along = supersampling
    for band in _bands(rows, columns * along**2):
        high = band.stop - band.start
        finer = slice(along * band.start, along * band.stop)
        origins, directions = map(
            _float32, rays_in_cells(camera, along * rows, along * columns, cells_to_world, finer)
        )
        offsets = np.zeros(1) if along == 1 else staggered(0.0, along, high, columns)
        rays = Rays(
            origins,
            directions,
            _float32(offsets),
            camera.near,
            step,
            extinction=gamma * step,
            most=-math.log(UNSEEN),
        )
        pixels, passes = marcher.film(hue, rays, shade)
        seen.colour[band] = averaged(pixels, high, columns, along)
        seen.opacity[band] = 1 - averaged(passes, high, columns, along)
    return seen


def _bands(rows: int, rays: int) -> Iterator[slice]:
    """Rows of pixels that together have no more rays than are held at once, `rays` in each."""
    high = max(1, _RAYS_AT_ONCE // rays)
    for first in range(0, rows, high):
        yield slice(first, min(first + high, rows))


def _is_native(device: str) -> bool:
    return device == "cpu" and native.unavailable() is None


def _float32(array: AnyArray) -> FloatArray:
    return np.ascontiguousarray(array, np.float32)
