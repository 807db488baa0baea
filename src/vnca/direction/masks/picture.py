"""A picture as a value: thrown through the smoke as light is through a slide."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.camera import frame_box
from vnca.core.colour import linear_to_srgb, luminance
from vnca.direction.mixing import Answer
from vnca.direction.moment import Inputs, Moment
from vnca.direction.values import Constant, Value
from vnca.io.picture import read_image

LEVEL, AS_FILMED = Constant(0.0), Constant(30.0)


@dataclass(frozen=True)
class Picture(Value):
    """How bright a picture is, thrown through the smoke from where a film is taken.

    As the film of the smoke of all frames shows it with the same angles: whoever paints over a
    picture of it paints a mask.
    """

    path: str
    azimuth: Value = LEVEL
    elevation: Value = LEVEL
    field_of_view: Value = AS_FILMED

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        picture = self._picture(moment.inputs)
        rows, columns = picture.shape
        lower, upper = moment.bounds
        angles = (self.azimuth, self.elevation, self.field_of_view)
        # A camera stands in one place: that of the first of the smoke, if it is told by places.
        azimuth, elevation, field_of_view = (
            float(np.ravel(angle.at(moment, places[:1]))[0]) for angle in angles
        )
        camera = frame_box(
            lower.tolist(),
            upper.tolist(),
            azimuth,
            elevation,
            aspect=columns / rows,
            field_of_view=field_of_view or None,
        )
        row, column, _ = camera.project(moment.world(places), rows, columns)
        return _looked_up(picture, np.nan_to_num(row, nan=-9.0), np.nan_to_num(column, nan=-9.0))

    def require(self, inputs: Inputs) -> None:
        """Refuse what cannot be read as a picture.

        Raises:
            FileFormatError: If it cannot.
        """
        self._picture(inputs)

    def files(self, inputs: Inputs) -> Iterator[Path]:
        """What it reads."""
        yield Path(self.path)

    def _picture(self, inputs: Inputs) -> FloatArray:
        """How bright it looks, `[row, column]`, 0 to 1."""
        key = "picture", self.path
        if key not in inputs.kept:
            bright = linear_to_srgb(luminance(read_image(self.path)))
            # White is 1, whatever the sum of its parts rounds to.
            inputs.kept[key] = np.where(bright > 1 - 1e-5, 1, bright.clip(0)).astype(np.float32)
        return inputs.kept[key]


def _looked_up(picture: FloatArray, row: AnyArray, column: AnyArray) -> FloatArray:
    """Straight between pixels, up to the edge of the outermost; zero beyond."""
    rows, columns = picture.shape
    inside = (np.abs(2 * row - rows + 1) < rows) & (np.abs(2 * column - columns + 1) < columns)
    row, column = row.clip(0, rows - 1), column.clip(0, columns - 1)
    top, left = np.floor(row).astype(int), np.floor(column).astype(int)
    below, right = np.minimum(top + 1, rows - 1), np.minimum(left + 1, columns - 1)
    down, across = row - top, column - left
    upper = picture[top, left] + across * (picture[top, right] - picture[top, left])
    lower = picture[below, left] + across * (picture[below, right] - picture[below, left])
    return np.where(inside, upper + down * (lower - upper), 0).astype(np.float32)
