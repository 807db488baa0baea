"""Curves as guides: strokes run along the nearest of them."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import FileFormatError
from vnca.core.files import existing_file
from vnca.direction.guides import unit
from vnca.direction.mixing import Answer
from vnca.direction.moment import Inputs, Moment
from vnca.direction.values import Value

MOST_POINTS = 10_000
_AT_ONCE = 2**20
_COMMENT = "#"


@dataclass(frozen=True)
class Curve(Value):
    """Curves through the points of a text file, in the world of the smoke's files; still.

    Each line has the x, y and z of a point; an empty line begins another curve.
    """

    path: str

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        starts, ends, tangents = self._segments(moment.inputs)
        points = moment.in_file(moment.world(places))
        found = np.zeros((len(places), 3))
        many = max(1, _AT_ONCE // len(starts))
        for first in range(0, len(points), many):
            some = slice(first, first + many)
            found[some] = _nearest(points[some], starts, ends, tangents)
        return unit(moment.in_cells(found))

    def require(self, inputs: Inputs) -> None:
        """Refuse what cannot be read as curves.

        Raises:
            FileFormatError: If it cannot.
        """
        self._segments(inputs)

    def files(self, inputs: Inputs) -> Iterator[Path]:
        """What it reads."""
        yield Path(self.path)

    def _segments(self, inputs: Inputs) -> tuple[AnyArray, AnyArray, AnyArray]:
        if self not in inputs.kept:
            inputs.kept[self] = _read(Path(self.path))
        return inputs.kept[self]


def _nearest(points: AnyArray, starts: AnyArray, ends: AnyArray, tangents: AnyArray) -> AnyArray:
    """Tangents `[n, 3]` where segments are nearest to points `[n, 3]`, straight along each."""
    along = ends - starts
    # Written out: the vectors from all starts to all points would be large.
    part = (points @ along.T - (starts * along).sum(1)) / np.square(along).sum(1)
    part = np.clip(part, 0, 1)
    distance = np.zeros_like(part)
    for axis in range(3):
        distance += np.square(points[:, None, axis] - starts[:, axis] - part * along[:, axis])
    nearest = distance.argmin(axis=1)
    share = part[np.arange(len(points)), nearest][:, None]
    return (1 - share) * tangents[nearest, 0] + share * tangents[nearest, 1]


def _read(path: Path) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Segments of all curves: where they start and end `[m, 3]`, tangents there `[m, 2, 3]`."""
    parts: list[tuple[AnyArray, AnyArray, AnyArray]] = []
    for points in _curves(path):
        starts, ends = points[:-1], points[1:]
        straight = (ends - starts) / np.linalg.norm(ends - starts, axis=1, keepdims=True)
        middle = straight[:-1] + straight[1:]
        at_points = np.concatenate([straight[:1], middle, straight[-1:]])
        at_points = unit(at_points).astype(np.float64)
        parts.append((starts, ends, np.stack([at_points[:-1], at_points[1:]], axis=1)))
    starts, ends, tangents = (np.concatenate(each) for each in zip(*parts, strict=True))
    return starts, ends, tangents


def _curves(path: Path) -> list[AnyArray]:
    """The points of each curve, none where the one before it is.

    Raises:
        FileFormatError: If a line holds no point, or there is no curve.
    """
    try:
        text = existing_file(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{path}: cannot be read as text ({error})") from error
    curves: list[list[list[float]]] = [[]]
    for number, line in enumerate(text.splitlines(), 1):
        said = line.partition(_COMMENT)[0].replace(",", " ").split()
        if not said:
            curves += [] if line.strip() else [[]]
            continue
        try:
            point = [float(each) for each in said]
        except ValueError:
            point = []
        if len(point) != 3 or not np.isfinite(point).all():
            raise FileFormatError(f"{path}:{number}: expected x, y and z of a point, got {line!r}")
        if point not in curves[-1][-1:]:
            curves[-1].append(point)
    found = [np.array(curve) for curve in curves if len(curve) > 1]
    if not found:
        raise FileFormatError(f"{path}: a curve has two points or more, and there is none")
    if sum(map(len, found)) > MOST_POINTS:
        raise FileFormatError(f"{path}: more than {MOST_POINTS} points")
    return found
