"""Smoke along the rays of a camera, in the native core: its samples, and the light of rays.

What is computed is that of `vnca.rendering.march`, on the CPU and in float32; or all of it at once,
for films.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, FloatArray, IntArray
from vnca.core.errors import ShapeError
from vnca.engine.native import checked, default_threads, extension

_OPERATION = "marching"


class Seen(NamedTuple):
    """Samples that can be seen, ray by ray, near to far.

    Attributes:
        starts: `[rays + 1]`, the first sample of each ray, and how many there are; int64.
        points: `[n, 3]`, cell coordinates.
        depth: `[n]`, along their rays.
        density: `[n]`, interpolated.
    """

    starts: IntArray
    points: FloatArray
    depth: FloatArray
    density: FloatArray


class Rays(NamedTuple):
    """What is sampled: at depths (k + offset) · step for whole k.

    Attributes:
        origins: `[rays, 3]`, cell coordinates.
        directions: `[rays, 3]`, cells for each length of depth.
        offsets: In steps, in [0, 1): `[1]` of all rays, or `[rays]` of each.
        near: Depth before which nothing is sampled.
        step: Depth between samples.
        extinction: Of density one, in a step: the least that it can be.
        most: Optical depth behind which there is nothing to be seen.
    """

    origins: FloatArray
    directions: FloatArray
    offsets: FloatArray
    near: float
    step: float
    extinction: float
    most: float


class Shade(NamedTuple):
    """A light in smoke: colours are multiplied by what is full but for the shadow.

    Attributes:
        shadow: `[x, y, z]`, what is taken away at the centres of cells of its own, and interpolated
            between them; nothing outside of them.
        first: A point of the density is (point + first) / times in these cells.
        times: How much larger they are.
        full: What is there without shadow.
    """

    shadow: FloatArray
    first: tuple[float, float, float]
    times: tuple[float, float, float]
    full: float


@dataclass(frozen=True, eq=False)
class Marcher:
    """A density `[x, y, z]` that rays are sampled in."""

    density: FloatArray
    threads: int | None = None
    """How many to use; by default one for each core."""
    _near: AnyArray = field(init=False)
    _box: tuple[list[float], list[float]] | None = field(init=False)

    def __post_init__(self) -> None:
        if self.density.ndim != 3:
            raise ShapeError(f"{_OPERATION}: expected a density [x, y, z]")
        near = np.empty(np.add(self.density.shape, 1), np.uint8)
        find = extension().find_smoke
        least, most = checked(_OPERATION, find, self.density, near, self._threads)
        there = least[0] <= most[0]
        box = ([float(n - 1) for n in least], [float(n + 1) for n in most]) if there else None
        object.__setattr__(self, "_near", near)
        object.__setattr__(self, "_box", box)

    @property
    def _threads(self) -> int:
        return self.threads or default_threads()

    def along(self, rays: Rays) -> Seen | None:
        """The samples that can be seen, where there is smoke; None without smoke.

        Raises:
            BackendUnavailableError: If the extension was not built.
            ShapeError: If arrays are not contiguous, or of other shapes or types.
        """
        if self._box is None:
            return None
        arrays = (self.density, self._near, *rays[:3])
        how = (*self._box, *rays[3:], self._threads)
        return Seen(*checked(_OPERATION, extension().march, *arrays, *how))

    def film(
        self, colour: FloatArray, rays: Rays, shade: Shade | None
    ) -> tuple[FloatArray, FloatArray]:
        """What rays see of smoke of that density and some colour.

        Args:
            colour: Linear RGB `[x, y, z, 3]` of the cells, interpolated weighted by density.
            rays: Where it is sampled; the extinction is the true one.
            shade: What lights it; None where it glows.

        Returns:
            Premultiplied linear RGB `[rays, 3]`, and the share of the light from behind that passes
            `[rays]`.

        Raises:
            BackendUnavailableError: If the extension was not built.
            ShapeError: If arrays are not contiguous, or of other shapes or types.
        """
        count = len(rays.origins)
        pixels, passes = np.zeros((count, 3), np.float32), np.ones(count, np.float32)
        if self._box is not None:
            arrays = (self.density, self._near, colour, shade, *rays[:3])
            how = (*self._box, *rays[3:], pixels, passes, self._threads)
            checked("filming", extension().film, *arrays, *how)
        return pixels, passes


def smeared(picture: FloatArray, way: FloatArray, count: int, still: float) -> FloatArray:
    """Means of a picture along ways through its pixels, as `vnca.rendering.shutter.smeared` has it.

    Args:
        picture: `[rows, columns, 4]`.
        way: `[rows, columns, 2]`, pixels.
        count: Of the places on a way.
        still: Pixels with a shorter way stay as they are.

    Raises:
        BackendUnavailableError: If the extension was not built.
        ShapeError: If arrays are not contiguous, or of other shapes or types.
    """
    result = np.empty_like(picture)
    checked("smearing", extension().smear, picture, way, count, still, result, default_threads())
    return result


class Shading(NamedTuple):
    """What the samples of rays show.

    Attributes:
        starts: As of `Seen`.
        density: `[n]`, painted.
        colour: `[n, 3]`, linear RGB.
        depth: As of `Seen`.
        extinction: Of density one, in a step.
        paper: Whether light adds up as the VNCA paper prints it.
    """

    starts: IntArray
    density: FloatArray
    colour: FloatArray
    depth: FloatArray
    extinction: float
    paper: bool


def composite(
    shading: Shading, *, threads: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The light of rays.

    Returns:
        Premultiplied linear RGB `[rays, 3]`, the share of the light from behind that passes
        `[rays]`, and the mean depth of what is seen `[rays]`, infinite where that is nothing.

    Raises:
        BackendUnavailableError: If the extension was not built.
        ShapeError: If arrays are not contiguous, or of other shapes or types.
    """
    rays = len(shading.starts) - 1
    colour, passes, depth = (np.empty(shape, np.float32) for shape in ((rays, 3), rays, rays))
    how = threads or default_threads()
    checked("compositing", extension().composite, *shading, colour, passes, depth, how)
    return colour, passes, depth


def composite_backward(
    shading: Shading, of_colour: FloatArray, of_passes: FloatArray, *, threads: int | None = None
) -> tuple[FloatArray, FloatArray]:
    """Gradients of density `[n]` and colour `[n, 3]` from those of colours and of what passes.

    Arguments and errors are those of `composite`.
    """
    density, colour = np.empty_like(shading.density), np.empty_like(shading.colour)
    arrays = (*shading, of_colour, of_passes, density, colour)
    checked("compositing", extension().composite_backward, *arrays, threads or default_threads())
    return density, colour
