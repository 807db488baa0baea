"""Where cells lie: the lattice that the frames of a sequence share, and grids in one another.

A frame has a grid of its own: its origin may move, an axis may be mirrored, voxels may be uneven.
What goes from frame to frame needs cells that stay where they are in the world: a `Lattice`. A
`Placement` takes cells, arrays and vectors of one grid to another: exactly where only axes are
exchanged, mirrored and shifted by whole cells, interpolated where not.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import Literal, NamedTuple

import numpy as np

from vnca.core import AnyArray, Box, FloatArray, Index
from vnca.core.bricks import CELLS, EDGE, bricks_reached
from vnca.core.errors import GridError
from vnca.core.field import Field

Beyond = Literal["nothing", "nearest"]
"""What there is beyond the cells of an array: nothing, or what its nearest cell holds."""

MOST_CELLS = 2**27
"""What is interpolated may not take more cells (512³)."""
_TOLERANCE = 1e-3
"""Of lengths and of cosines: closer to cubic, or to a right angle, is that."""
_APART = 1e-2
"""Cells nearer than this part of a cell, everywhere in a box, are in the same place."""
_ANCHOR_SLACK = 1e-6
_FARTHEST = 2**30
"""Cells from the world's origin, at most, where that is what indices count from."""
_SLAB = 2**16  # cells interpolated at a time

# All ways to turn axes onto axes, with and without mirroring. The first is that of no turn.
_TURNS = [
    np.diag(signs)[list(order)]
    for order in permutations(range(3))
    for signs in product((1, -1), repeat=3)
]


@dataclass(frozen=True, eq=False)
class Lattice:
    """Cubic cells all over the world, right-handed, their axes nearest to the world's.

    Attributes:
        to_world: 4×4, `world = to_world @ (i, j, k, 1)` for cell centres; up is +z in the world.
    """

    to_world: AnyArray

    @classmethod
    def of(cls, index_to_world: AnyArray, what: str) -> "Lattice":
        """The lattice of a grid: its cells, counted along the world's axes from the world's origin.

        So grids of the same cells have one lattice, whichever cell a grid calls its first and
        whichever way its axes go. Uneven cells are divided into cubes as wide as their shortest
        side.

        Args:
            index_to_world: 4×4, of the grid.
            what: What a message calls it.

        Raises:
            GridError: If its axes are not at right angles.
        """
        require_right_angles(index_to_world, what)
        matrix = index_to_world @ upright_turn(index_to_world)
        linear, centre = matrix[:3, :3], matrix[:3, 3]
        sides = np.linalg.norm(linear, axis=0)
        if not is_cubic(index_to_world):
            linear = linear / sides * sides.min()
        # The cell next to the world's origin is number 0; of two alike, that on the positive side.
        with np.errstate(over="ignore"):
            first = np.ceil(np.linalg.solve(linear, centre) - 0.5 - _ANCHOR_SLACK)
        if np.abs(first).max() < _FARTHEST and first.any():
            centre = centre - linear @ first
        to_world = np.eye(4)
        to_world[:3, :3], to_world[:3, 3] = linear, centre
        return cls(to_world)

    @classmethod
    def as_it_is(cls, index_to_world: AnyArray, what: str) -> "Lattice":
        """That of a grid's own cells, as they are counted there; arguments as of `of`.

        Raises:
            GridError: If they are not cubic.
        """
        require_right_angles(index_to_world, what)
        if not is_cubic(index_to_world):
            sides = ", ".join(
                f"{side:g}" for side in np.linalg.norm(index_to_world[:3, :3], axis=0)
            )
            raise GridError(
                f"{what}: expected cubic cells, got sides of {sides}; lay it on a lattice"
            )
        return cls(index_to_world)

    @property
    def spacing(self) -> float:
        """World length of a cell's side."""
        return float(np.linalg.norm(self.to_world[:3, 0]))


class Region(NamedTuple):
    """A box of cells of a lattice: a part of the world."""

    lattice: Lattice
    box: Box


@dataclass(frozen=True, eq=False)
class Placement:
    """Where the cells of one grid lie among those of another.

    Attributes:
        matrix: 4×4, from the one's index coordinates to the other's.
        is_whole: Whether cells lie on cells: axes are at most exchanged and mirrored, and the
            shift is of whole cells. Then `matrix` holds whole numbers.
        what: What a message calls the one grid.
    """

    matrix: AnyArray
    is_whole: bool
    what: str

    @classmethod
    def between(cls, source: AnyArray, target: AnyArray, box: Box, what: str) -> "Placement":
        """That of the cells of one grid in another.

        Cells that differ by less than a hundredth all over a box are the same.

        Args:
            source: 4×4, of the one, to the world.
            target: 4×4, of the other.
            box: Cells of the one that matter.
            what: What a message calls it.

        Raises:
            GridError: If its axes are not at right angles.
        """
        matrix = np.linalg.solve(target, source)
        corners = _corners(box, 0)
        linear = np.rint(matrix[:3, :3])
        middle = corners.mean(axis=0)
        whole = np.eye(4)
        whole[:3, :3] = linear
        whole[:3, 3] = np.rint(matrix[:3, :3] @ middle + matrix[:3, 3] - linear @ middle)
        apart = np.abs(_at(corners, whole) - _at(corners, matrix)).max()
        if _is_turn(linear) and apart < _APART:
            return cls(whole, True, what)
        require_right_angles(source, what)
        return cls(matrix, False, what)

    @property
    def inverse(self) -> "Placement":
        """The way back."""
        back = np.linalg.inv(self.matrix)
        return Placement(np.rint(back) if self.is_whole else back, self.is_whole, self.what)

    def cells(self, cells: AnyArray) -> AnyArray:
        """Index coordinates `[n, 3]` in the other grid, fractions unless cells lie on cells."""
        return _at(cells, self.matrix)

    def box(self, box: Box) -> Box:
        """The cells of the other grid that the cells of a box have a part in.

        Raises:
            GridError: If they lie too far away to be counted.
        """
        if box.is_empty:
            return Box((0, 0, 0), (0, 0, 0))
        # Interpolated, a cell reaches to the centres of those beside it; a mean, half a cell more.
        corners = _at(_corners(box, 0 if self.is_whole else 1), self.matrix)
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        if self.is_whole:
            upper = upper + 1
        else:
            wider = 0.5 * (np.array(self._parts) > 1)
            lower, upper = np.floor(lower - wider) + 1, np.ceil(upper + wider)
        if not (np.abs([lower, upper]) < 2.0**31).all():
            raise GridError(
                f"{self.what}: its cells lie too far from the others of the sequence to be counted"
            )
        return Box(_index(lower), _index(upper))

    def field(self, field: Field, over: Box | None = None, beyond: Beyond = "nothing") -> Field:
        """The values of the one grid's cells, as the other has them.

        Where cells do not lie on cells, they are interpolated linearly between centres; a cell of
        the other grid that is larger has the mean of several places in it.

        Args:
            field: Of the cells of the one grid.
            over: The wanted cells of the other; those that `box` gives unless given.
            beyond: What there is beyond the box of the field; nothing where cells lie on cells.

        Raises:
            GridError: If interpolating takes too many cells.
        """
        over = self.box(field.box) if over is None else over
        if field.box.is_empty or over.is_empty:
            nothing = slice(0, 0)
            return replace(
                field, bricks=field.bricks[nothing], values=field.values[nothing], box=over
            )
        if not self.is_whole:
            return self._interpolated(field, over, beyond)
        linear = self.matrix[:3, :3]
        order, signs = np.abs(linear).argmax(axis=1).tolist(), linear.sum(axis=1).astype(int)
        # Mirrored, cell i becomes cell -1 - i.
        by = _index(self.matrix[:3, 3] + (signs < 0))
        moved = field.turned(order, signs.tolist()).moved(by)
        return moved if moved.box == over else replace(moved.within(over), box=over)

    def vectors(self, values: FloatArray) -> FloatArray:
        """Vectors `[..., 3]` in cells of the one grid, in cells of the other."""
        linear = self.matrix[:3, :3]
        if not self.is_whole:
            return values @ linear.T.astype(np.float32)
        order = np.abs(linear).argmax(axis=1)
        signs = linear.sum(axis=1).astype(np.float32)
        if (order == range(3)).all() and (signs == 1).all():
            return values
        return values[..., order] * signs

    @property
    def _parts(self) -> Index:
        """In how many places of a cell of the other grid values are taken, along its axes."""
        sides = np.linalg.norm(np.linalg.inv(self.matrix[:3, :3]), axis=0)
        return _index(np.maximum(1, np.ceil(sides - _APART)))

    def _interpolated(self, field: Field, over: Box, beyond: Beyond) -> Field:
        # A cell has a share in those whose centres are less than one cell away.
        margin, most = 1 if beyond == "nothing" else 2, MOST_CELLS // CELLS
        bricks = bricks_reached(field.bricks, self.matrix, over, margin=margin, most=most)
        if bricks is None:
            raise GridError(
                f"{self.what}: takes more than {MOST_CELLS} cubic cells as small as the shortest "
                "side of the sequence's voxels; resample it to more even voxels"
            )
        values = np.empty((len(bricks), CELLS, *field.values.shape[4:]), np.float32)
        back = np.linalg.inv(self.matrix)
        parts = [(np.arange(count) + 0.5) / count - 0.5 for count in self._parts]
        places = [np.array(place) for place in product(*parts)]
        within = np.array(list(product(range(EDGE), repeat=3)))
        for start in range(0, len(bricks), _SLAB // CELLS):
            slab = slice(start, start + _SLAB // CELLS)
            at = (bricks[slab, None] * EDGE + within).reshape(-1, 3)
            total = np.sum(
                [_between_centres(field, _at(at + place, back), beyond) for place in places], axis=0
            )
            values[slab] = (total / len(places)).reshape(-1, *values.shape[1:])
        values = values.reshape(-1, *field.values.shape[1:])
        return replace(field, bricks=bricks, values=values, box=over).within(over)


def require_right_angles(index_to_world: AnyArray, what: str) -> None:
    """Refuse a grid whose axes are not at right angles; `what` is its name in the message.

    Raises:
        GridError: If they are not.
    """
    linear = index_to_world[:3, :3]
    axes = linear / np.linalg.norm(linear, axis=0)
    cosines = (axes.T @ axes)[np.triu_indices(3, 1)]
    if not (np.abs(cosines) < _TOLERANCE).all():
        angles = ", ".join(
            f"{angle:.0f}" for angle in np.degrees(np.arccos(np.clip(cosines, -1, 1)))
        )
        raise GridError(
            f"{what}: its voxels are sheared (their sides meet at {angles} degrees); resample it "
            "to a grid of right angles"
        )


def is_cubic(index_to_world: AnyArray) -> bool:
    """Whether the sides of a cell are as long as each other."""
    sides = np.linalg.norm(index_to_world[:3, :3], axis=0)
    return bool(sides.max() <= sides.min() * (1 + _TOLERANCE))


def upright_turn(index_to_world: AnyArray) -> AnyArray:
    """4×4: exchanges and mirrors a grid's axes, so that they go as nearly as can be as the world's.

    It takes coordinates of our cells to the grid's. Ours are always right-handed.
    """
    linear = index_to_world[:3, :3]
    directions = linear / np.linalg.norm(linear, axis=0)
    handed = np.sign(np.linalg.slogdet(linear)[0])
    result, best = np.eye(4), -np.inf
    for turn in _TURNS:
        nearness = np.trace(directions @ turn)
        if np.linalg.det(turn) * handed > 0 and nearness > best + _TOLERANCE:
            result[:3, :3], best = turn, nearness
    return result


def _is_turn(linear: AnyArray) -> bool:
    return any(np.array_equal(linear, turn) for turn in _TURNS)


def _corners(box: Box, margin: int) -> AnyArray:
    """Index coordinates `[8, 3]` of the outermost cells' centres, or so many cells beyond."""
    ends = [
        (low - margin, max(low, high - 1) + margin)
        for low, high in zip(box.lower, box.upper, strict=True)
    ]
    return np.array(list(product(*ends)), np.float64)


def _at(places: AnyArray, matrix: AnyArray) -> AnyArray:
    return places @ matrix[:3, :3].T + matrix[:3, 3]


def _index(numbers: AnyArray) -> Index:
    x, y, z = (int(number) for number in numbers)
    return x, y, z


def _between_centres(field: Field, at: AnyArray, beyond: Beyond) -> FloatArray:
    """Values at places `[n, 3]` in index coordinates, linear in between."""
    first = np.array(field.box.lower)
    last = np.array(field.box.upper) - 1
    if beyond == "nearest":
        at = np.clip(at, first, last)
    below = np.floor(at)
    part = at - below
    kind = field.values.shape[4:]
    total = np.zeros((len(at), *kind), np.float32)
    for corner, weight in _weighted(part):
        cell = below + corner
        weight = weight * ((cell >= first) & (cell <= last)).all(axis=1)
        where = np.clip(cell, first, last).astype(np.int32)
        total += weight.astype(np.float32).reshape(-1, *[1] * len(kind)) * field.gather(where)
    return total


def _weighted(part: AnyArray) -> Iterator[tuple[AnyArray, AnyArray]]:
    """The eight corners around a place, and the share of each, `[n]`."""
    for corner in product((0, 1), repeat=3):
        yield np.array(corner), np.where(corner, part, 1 - part).prod(axis=1)
