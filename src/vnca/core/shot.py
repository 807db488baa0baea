"""How a film is taken, whatever it shows: its size, where the camera stands and how it turns."""

from dataclasses import dataclass
from math import isfinite

import numpy as np

from vnca.core.colour import srgb_to_linear
from vnca.core.errors import OptionError


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
