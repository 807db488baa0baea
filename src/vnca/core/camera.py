"""Cameras that look at a space in which +z is up, and how a film is taken with them.

That space is the upright world (`Volume.index_to_upright`), or that of the cells where these are
cubes and stand upright: then the centre of cell `[i, j, k]` is the point (i, j, k) and lengths are
in cells. A camera looks at a target
from an azimuth and an elevation, both in degrees. Azimuth 0 looks along +y with +x to the
right; a growing azimuth walks the camera counter-clockwise as seen from above, so 90 looks
along −x from the +x side. A positive elevation looks down from above; at 90 the top of the
picture is where azimuth points. Pixels are square and pixel `[0, 0]` is at the top left.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import isfinite
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from vnca.core import AnyArray
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import OptionError

Point = tuple[float, float, float]
WHOLE = slice(None)
"""The band of a picture that is all of it."""


@runtime_checkable
class Camera(Protocol):
    """What a renderer needs to know of a camera."""

    near: ClassVar[float]
    """Depth before which nothing is seen."""

    @property
    def height(self) -> float:
        """Length between the top and the bottom edge of the picture, at the target."""
        ...

    def rays(self, rows: int, columns: int, band: slice = WHOLE) -> tuple[AnyArray, AnyArray]:
        """One ray through each pixel centre: `point = origin + depth * direction`.

        Args:
            rows: Of the picture.
            columns: Of the picture.
            band: Through which rows of pixels; all unless given.

        Returns:
            Origins and unit directions, both `[rows of the band, columns, 3]`, float64: a world may
            be large.
        """
        ...

    def project(
        self, points: AnyArray, rows: int, columns: int
    ) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Where points `[..., 3]` appear: the inverse of `rays`.

        Returns:
            Row, column (whole numbers at pixel centres) and depth along the ray, each `[...]`.
            Row and column are NaN for a point behind a perspective camera.
        """
        ...


@dataclass(frozen=True)
class _LookAt:
    target: Point
    azimuth: float = 0.0
    elevation: float = 0.0

    def view_coordinates(self, points: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Right, up and forward of the target, for points `[..., 3]`."""
        offset = np.asarray(points, np.float64) - np.asarray(self.target)
        right, up, forward = view_axes(self.azimuth, self.elevation)
        return offset @ right, offset @ up, offset @ forward


@dataclass(frozen=True)
class Orthographic(_LookAt):
    """A camera whose rays are parallel.

    Depth is measured from the plane through the target: it is negative in front of it, and
    nothing is cut off.

    Attributes:
        target: The point in the middle of the picture.
        azimuth: Degrees, as described at the top of this module.
        elevation: Degrees.
        height: Length between the top and the bottom edge of the picture.
    """

    height: float = 1.0
    near: ClassVar[float] = -math.inf

    def __post_init__(self) -> None:
        if not self.height > 0:
            raise OptionError(f"camera height: expected more than 0, got {self.height}")

    def rays(self, rows: int, columns: int, band: slice = WHOLE) -> tuple[AnyArray, AnyArray]:
        """See `Camera.rays`."""
        right, up, forward = view_axes(self.azimuth, self.elevation)
        x, y = (self.height * offset for offset in _pixel_offsets(rows, columns, band))
        origins = np.asarray(self.target) + x[..., None] * right + y[..., None] * up
        return origins, np.broadcast_to(forward, origins.shape)

    def project(
        self, points: AnyArray, rows: int, columns: int
    ) -> tuple[AnyArray, AnyArray, AnyArray]:
        """See `Camera.project`."""
        right, up, forward = self.view_coordinates(points)
        row, column = _pixel(right / self.height, up / self.height, rows, columns)
        return row, column, forward


@dataclass(frozen=True)
class Perspective(_LookAt):
    """A pinhole camera.

    Depth is the distance from the pinhole.

    Attributes:
        target: The point in the middle of the picture.
        azimuth: Degrees, as described at the top of this module.
        elevation: Degrees.
        distance: Length from the pinhole to the target.
        field_of_view: Degrees between the top and the bottom edge of the picture.
    """

    distance: float = 1.0
    field_of_view: float = 30.0
    near: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        if not self.distance > 0:
            raise OptionError(f"camera distance: expected more than 0, got {self.distance}")
        _check_field_of_view(self.field_of_view)

    @property
    def height(self) -> float:
        """See `Camera.height`."""
        return 2 * self.distance * _slope(self.field_of_view)

    def rays(self, rows: int, columns: int, band: slice = WHOLE) -> tuple[AnyArray, AnyArray]:
        """See `Camera.rays`."""
        right, up, forward = view_axes(self.azimuth, self.elevation)
        extent = 2 * _slope(self.field_of_view)
        x, y = (extent * offset for offset in _pixel_offsets(rows, columns, band))
        directions = forward + x[..., None] * right + y[..., None] * up
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        pinhole = np.asarray(self.target) - self.distance * forward
        return np.broadcast_to(pinhole, directions.shape), directions

    def project(
        self, points: AnyArray, rows: int, columns: int
    ) -> tuple[AnyArray, AnyArray, AnyArray]:
        """See `Camera.project`."""
        right, up, forward = self.view_coordinates(points)
        forward = forward + self.distance
        depth = np.copysign(np.sqrt(right**2 + up**2 + forward**2), forward)
        extent = 2 * _slope(self.field_of_view) * np.where(forward > 0, forward, np.nan)
        row, column = _pixel(right / extent, up / extent, rows, columns)
        return row, column, depth


def frame_box(
    lower: Sequence[float],
    upper: Sequence[float],
    azimuth: float = 0.0,
    elevation: float = 0.0,
    *,
    margin: float = 0.04,
    aspect: float = 1.0,
    field_of_view: float | None = None,
) -> Orthographic | Perspective:
    """The camera that sees a box as large as the picture allows, all corners inside.

    Args:
        lower: Least corner of the box.
        upper: Greatest corner.
        azimuth: Degrees, as described at the top of this module.
        elevation: Degrees.
        margin: Part of the picture's height and width left free on every side.
        aspect: Width over height of the picture.
        field_of_view: Vertical, degrees, for a perspective camera; None for an orthographic one.

    Raises:
        OptionError: If the box is empty or a value is out of range.
    """
    low, high = _checked_box(lower, upper, margin)
    if not aspect > 0:
        raise OptionError(f"aspect: expected more than 0, got {aspect}")
    axes = view_axes(azimuth, elevation)
    centre = (low + high) / 2
    corners = np.array(list(product(*zip(low, high, strict=True)))) - centre
    right, up, forward = (corners @ axis for axis in axes)
    used = 1 - 2 * margin
    if field_of_view is None:
        height = max(np.ptp(up), np.ptp(right) / aspect) / used
        return Orthographic(_point(centre), azimuth, elevation, height=float(height))
    _check_field_of_view(field_of_view)
    slope = used * _slope(field_of_view)
    x, distance_x = _fit(right, forward, slope * aspect)
    y, distance_y = _fit(up, forward, slope)
    return Perspective(
        _point(centre + x * axes[0] + y * axes[1]),
        azimuth,
        elevation,
        distance=max(distance_x, distance_y),
        field_of_view=field_of_view,
    )


def turntable(
    lower: Sequence[float],
    upper: Sequence[float],
    azimuth: float = 0.0,
    elevation: float = 0.0,
    *,
    steepest: float = 90.0,
    margin: float = 0.04,
) -> Orthographic:
    """The camera of a square picture that sees a box as large from every side.

    Where `frame_box` comes as near as each side allows, this one stays as far away as the widest
    side asks for.

    Args:
        lower: Least corner of the box.
        upper: Greatest corner.
        azimuth: Degrees, as described at the top of this module.
        elevation: Degrees.
        steepest: All corners are inside from up to this many degrees above and below the horizon.
        margin: Part of the picture's height and width left free on every side.

    Raises:
        OptionError: If the box is empty or a value is out of range.
    """
    low, high = _checked_box(lower, upper, margin)
    width, depth, height = high - low
    across = math.hypot(width, depth)
    # A box seen along its diagonal is tallest where it stands on the edge of its two corners.
    tilt = min(math.radians(steepest), math.atan2(across, height))
    tallest = height * math.cos(tilt) + across * math.sin(tilt)
    needed = max(across, tallest) / (1 - 2 * margin)
    return Orthographic(_point((low + high) / 2), azimuth, elevation, height=float(needed))


def world_box(
    lower: Sequence[float] | AnyArray, upper: Sequence[float] | AnyArray, cells_to_world: AnyArray
) -> tuple[AnyArray, AnyArray]:
    """The least and greatest corner of the world's box around a box of cells.

    Args:
        lower: Least corner of the box of cells, in cell coordinates.
        upper: Greatest corner.
        cells_to_world: 4×4, affine.
    """
    corners = np.array(list(product(*zip(lower, upper, strict=True))), np.float64)
    corners = corners @ cells_to_world[:3, :3].T + cells_to_world[:3, 3]
    return corners.min(axis=0), corners.max(axis=0)


def view_axes(azimuth: float, elevation: float) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Unit vectors to the right, up and forward in the picture, for angles in degrees."""
    a, e = math.radians(azimuth), math.radians(elevation)
    right = np.array([math.cos(a), math.sin(a), 0.0])
    level = np.array([-math.sin(a), math.cos(a), 0.0])
    z = np.array([0.0, 0.0, 1.0])
    up = math.sin(e) * level + math.cos(e) * z
    forward = math.cos(e) * level - math.sin(e) * z
    return right, up, forward


def _checked_box(
    lower: Sequence[float], upper: Sequence[float], margin: float
) -> tuple[AnyArray, AnyArray]:
    low, high = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
    if not (high > low).all():
        raise OptionError(f"box to frame: expected lower below upper, got {lower} to {upper}")
    if not 0 <= margin < 0.5:
        raise OptionError(f"margin: expected 0 to less than 0.5, got {margin}")
    return low, high


def _fit(across: AnyArray, forward: AnyArray, slope: float) -> tuple[float, float]:
    """Shift and least distance at which `|across − shift| ≤ slope · (forward + distance)`.

    Each side of the view is a line of that slope pushed against the outermost corner; where
    the two lines meet is the pinhole.
    """
    above = float(np.max(across - slope * forward))
    below = float(np.max(-across - slope * forward))
    return (above - below) / 2, (above + below) / (2 * slope)


def _pixel_offsets(rows: int, columns: int, band: slice) -> tuple[AnyArray, AnyArray]:
    """Right and up from the middle to the centre of each pixel of a band, in picture heights."""
    x = (np.arange(columns) + 0.5 - columns / 2) / rows
    y = (rows / 2 - 0.5 - np.arange(rows)[band, None]) / rows
    size = (len(y), columns)
    return np.broadcast_to(x, size), np.broadcast_to(y, size)


def _pixel(x: AnyArray, y: AnyArray, rows: int, columns: int) -> tuple[AnyArray, AnyArray]:
    """Row and column of points given right and up of the middle, in picture heights."""
    return (rows - 1) / 2 - y * rows, (columns - 1) / 2 + x * rows


def _slope(field_of_view: float) -> float:
    return math.tan(math.radians(field_of_view) / 2)


def _check_field_of_view(degrees: float) -> None:
    if not 0 < degrees < 180:
        raise OptionError(f"field of view: expected 0 to 180 degrees exclusive, got {degrees}")


def _point(array: AnyArray) -> Point:
    x, y, z = array.tolist()
    return x, y, z


@dataclass(frozen=True)
class Shot:
    """How a film is taken."""

    rows: int = 384
    """Height of the film, pixels."""
    columns: int = 384
    """Width of the film, pixels."""
    azimuth: float = 0.0
    """Where the camera stands, degrees around what it shows; 0 is the front, looking along +y."""
    elevation: float = 5.0
    """How far above the horizon it stands, degrees."""
    turn: float = 0.0
    """Degrees the camera walks around over the whole film; 360 is a turntable."""
    fps: float = 24.0
    """Frames per second of the film."""
    background: str = "#101014"
    """Colour behind what is shown, #rrggbb."""

    def __post_init__(self) -> None:
        if self.rows < 16 or self.columns < 16:
            raise OptionError("`film.rows` and `film.columns`: at least 16 pixels are needed")
        if not 0 < self.fps <= 1000:
            raise OptionError(f"`film.fps` {self.fps}: must be positive, at most 1000")
        if not -90 <= self.elevation <= 90:
            raise OptionError(f"`film.elevation` {self.elevation}: must be -90 to 90 degrees")
        if not (isfinite(self.azimuth) and isfinite(self.turn)):
            raise OptionError("`film.azimuth` and `film.turn`: expected numbers of degrees")
        parse_colour(self.background)


def parse_colour(text: str) -> list[float]:
    """Linear RGB of `#rrggbb`.

    Raises:
        OptionError: If the text is not such a colour.
    """
    digits = text.removeprefix("#")
    try:
        values = bytes.fromhex(digits)
    except ValueError:
        values = b""
    if len(values) != 3:
        raise OptionError(f"`film.background` '{text}': expected a colour such as #101014")
    return srgb_to_linear(np.frombuffer(values, np.uint8) / 255).tolist()
