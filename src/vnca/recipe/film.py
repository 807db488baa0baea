"""Filming painted frames as they come."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.camera import Shot, frame_box, parse_colour
from vnca.core.colour import linear_to_srgb, srgb_to_linear
from vnca.core.errors import OptionError, SequenceError
from vnca.core.volume import Volume
from vnca.io import SmokeFormat
from vnca.io.film import FilmWriter
from vnca.io.smoke_format import NO_VELOCITY
from vnca.rendering import MOST_RAYS, rays_along
from vnca.rendering.film import Picture, render, require_renderer
from vnca.rendering.light import Light, LightVolume, spacing_for
from vnca.rendering.shutter import blurred

_RAISED, _LOWERED = 0.8, 0.4
# Interleaved gradient noise: neighbouring pixels are spread evenly over a step.
_NOISE = (52.9829189, 0.06711056, 0.00583715)


def soft_background(colour: Sequence[float], rows: int, columns: int) -> FloatArray:
    """A colour with a radial gradient around it: black stays black and white stays white there.

    It is dithered by a step of 8-bit sRGB, the same in every picture, as a dark gradient would
    show bands.

    Args:
        colour: Linear RGB, which the background has midway between the middle and the corners.
        rows: Height, pixels.
        columns: Width, pixels.

    Returns:
        Linear RGB `[rows, columns, 3]`.

    Reference: Jimenez 2014, interleaved gradient noise.
    """
    row, column = np.mgrid[:rows, :columns].astype(np.float64)
    y, x = (2 * row + 1) / rows - 1, (2 * column + 1) / columns - 1
    away = np.sqrt((x**2 + y**2) / 2)  # 1 in the corners
    weight = np.cos(np.pi * np.minimum(away, 1))[..., None]
    base = np.asarray(colour, np.float64)
    gain: AnyArray = np.where(weight > 0, _RAISED * (1 - base), _LOWERED)
    soft = linear_to_srgb(base * (1 + gain * weight))
    big, across, down = _NOISE
    noise = (big * ((across * column + down * row) % 1)) % 1 - 0.5
    dithered = soft + np.where(base > 0, noise[..., None] / 255, 0)
    return srgb_to_linear(np.clip(dithered, 0, 1)).astype(np.float32)


@dataclass(frozen=True)
class FilmConfig(Shot):
    """How smoke is filmed."""

    field_of_view: float = 30.0
    """Vertical, degrees; 0 films without perspective."""
    step: float = 0.5
    """Distance between samples along a ray, in cells, across where these are thinnest; a surface
    shows terraces where it is long."""
    supersampling: int | None = None
    """Rays along the rows and the columns of a pixel, 1 to 4; unless given, as many as there are
    cells across one: single rays miss some cells, and others a frame later."""
    light: float = 2.0
    """Strength of a light that the smoke is seen by and throws shadows in. 0: none, the smoke glows
    in its own colours before an even background."""
    light_azimuth: float = -55.0
    """Where the light stands, degrees around the smoke from where the camera begins; it stays there
    while the camera turns. Below 0 it comes from the left."""
    light_elevation: float = 40.0
    """How far above the horizon it stands, degrees."""
    ambient: float = Light.ambient
    """Part of the light that comes from everywhere, 0 to 1: how bright shadows are."""
    shutter: float = 0.0
    """Motion blur: the part of a frame for which the shutter is open, 0 to 1; film cameras have
    0.5. It takes smoke with a velocity."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.field_of_view < 120:
            raise OptionError(f"`film.field_of_view` {self.field_of_view}: must be 0 to 120")
        if not 0 < self.step <= 4:
            raise OptionError(f"`film.step` {self.step}: must be above 0, at most 4 cells")
        if self.supersampling is not None and not 1 <= self.supersampling <= MOST_RAYS:
            raise OptionError(
                f"`film.supersampling` {self.supersampling}: must be from 1 to {MOST_RAYS}"
            )
        if not 0 <= self.light < inf:
            raise OptionError(f"`film.light` {self.light}: must be 0 or more")
        if not isfinite(self.light_azimuth):
            raise OptionError("`film.light_azimuth`: expected a number of degrees")
        if not -90 <= self.light_elevation <= 90:
            raise OptionError(
                f"`film.light_elevation` {self.light_elevation}: must be -90 to 90 degrees"
            )
        if not 0 <= self.ambient <= 1:
            raise OptionError(f"`film.ambient` {self.ambient}: must be 0 to 1")
        if not 0 <= self.shutter <= 1:
            raise OptionError(f"`film.shutter` {self.shutter}: must be 0 to 1")
        if not self.light:
            for name in ("light_azimuth", "light_elevation", "ambient"):
                if getattr(self, name) != getattr(FilmConfig, name):
                    raise OptionError(f"`film.{name}`: changes nothing where `film.light` is 0")

    def reading(self, format: SmokeFormat) -> SmokeFormat:
        """How smoke is read to be filmed: without a velocity unless motion is blurred."""
        return format if self.shutter else replace(format, velocity_grid=NO_VELOCITY)


class Shown(NamedTuple):
    """A frame with what it takes to draw it.

    Attributes:
        smoke: The frame; its cells lie where its matrix says, whatever their shape.
        colour: Linear RGB `[x, y, z, 3]` of the same cells.
        extinction: Of density 1, per length of the world.
    """

    smoke: Volume
    colour: FloatArray
    extinction: float


Bounds = tuple[AnyArray, AnyArray]
"""The least and greatest corner of a box of the world."""


class Film:
    """A film of smoke, seen by a camera framed on a whole sequence."""

    def __init__(
        self,
        path: Path,
        config: FilmConfig,
        bounds: Bounds,
        *,
        frames: int,
        device: str = "cpu",
    ) -> None:
        """Open the film; it appears under its name when the context ends well.

        Args:
            path: mp4, gif or webp.
            config: How to film.
            bounds: What to keep in view.
            frames: How many will come, which sets the pace of a turning camera.
            device: Where to render.

        Raises:
            BackendUnavailableError: If what it takes to render is not installed.
            OptionError: If the path is no film, or the frame rate cannot work.
            OutputError: If the film cannot be written.
        """
        require_renderer(device)  # what is missing is reported before long work
        self._config, self._bounds, self._frames, self._device = config, bounds, frames, device
        self._writer = FilmWriter(path, fps=config.fps)
        self._background = behind(config)
        self._shown = 0

    def __enter__(self) -> "Film":
        """Start writing."""
        self._writer.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Finish the film, or drop it if something failed."""
        self._writer.__exit__(kind, error, trace)

    def add(self, frame: Shown, *, still: bool = False) -> None:
        """Render the next frame and add it; `still` if its smoke does not move."""
        turns = self._config.turn / self._frames
        view = picture(
            frame,
            self._config,
            bounds=self._bounds,
            turned=turns * self._shown,
            turns=turns,
            still=still,
            device=self._device,
        )
        self._writer.add(view.over(self._background))
        self._shown += 1


def behind(config: FilmConfig) -> FloatArray:
    """What is behind smoke, linear RGB: `[3]`, or `[rows, columns, 3]` where it is lit."""
    colour = parse_colour(config.background)
    if not config.light:
        return np.array(colour)
    return soft_background(colour, config.rows, config.columns)


def picture(
    frame: Shown,
    config: FilmConfig,
    *,
    bounds: Bounds,
    turned: float,
    turns: float = 0.0,
    still: bool = False,
    device: str = "cpu",
) -> Picture:
    """The view of one frame by a camera framed on `bounds`.

    Args:
        frame: The frame.
        config: How it is filmed.
        bounds: What to keep in view.
        turned: Degrees by which the camera has turned.
        turns: And by which it turns until the next frame.
        still: Whether the smoke stays as it is until then.
        device: Where to render.

    Raises:
        SequenceError: If motion is to be blurred and the smoke has no velocity.
    """
    density, colour, place = frame.smoke.density, frame.colour, frame.smoke.cells_to_world
    # In lengths of a cell, single precision has room for a world of any size.
    thinnest = _thinnest(place)
    place = np.diag([1 / thinnest] * 3 + [1.0]) @ place
    lower, upper = ((corner / thinnest).tolist() for corner in bounds)
    camera, later = (
        frame_box(
            lower,
            upper,
            config.azimuth + angle,
            config.elevation,
            aspect=config.columns / config.rows,
            field_of_view=config.field_of_view or None,
        )
        for angle in (turned, turned + turns)
    )
    is_moving = config.shutter > 0 and density.any()
    if density.size == 0:
        density, colour = np.zeros((1, 1, 1), np.float32), np.zeros((1, 1, 1, 3), np.float32)
    gamma = frame.extinction * thinnest
    light = None
    if config.light:
        light = LightVolume(
            density,
            Light(
                config.azimuth + config.light_azimuth,
                config.light_elevation,
                config.light,
                config.ambient,
            ),
            gamma=gamma,
            cells_to_world=place,
            spacing=spacing_for(*bounds) / thinnest,
            origin=frame.smoke.origin,
        )
    seen = render(
        density,
        colour,
        camera,
        rows=config.rows,
        columns=config.columns,
        gamma=gamma,
        step=config.step,
        cells_to_world=place,
        supersampling=config.supersampling or rays_along(camera.height / config.rows),
        light=light,
        device=device,
    )
    if not is_moving:
        return seen
    return blurred(
        seen,
        density,
        np.zeros((*density.shape, 3), np.float32) if still else require_velocity(frame.smoke),
        camera,
        later,
        shutter=config.shutter,
        gamma=gamma,
        step=config.step,
        cells_to_world=place,
        device=device,
    )


def require_velocity(smoke: Volume) -> FloatArray:
    """The velocity of a frame, by which its motion is blurred.

    Raises:
        SequenceError: If it has none.
    """
    if smoke.velocity is None:
        raise SequenceError(f"frame {smoke.frame}: no velocity, which `film.shutter` needs")
    return smoke.velocity


def _thinnest(cells_to_world: AnyArray) -> float:
    """The least distance in the world between two neighbouring layers of cells."""
    return float(1 / np.linalg.norm(np.linalg.inv(cells_to_world[:3, :3]), axis=1).max())
