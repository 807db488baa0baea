"""A painted frame on its way into a file, part by part; what is painted waits out of memory."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from vnca.core import AnyArray, Box
from vnca.core.bricks import CELLS, EDGE, meeting
from vnca.core.field import Field
from vnca.core.lattice import Placement
from vnca.core.scratch import Scratch
from vnca.core.volume import refined_transform
from vnca.io.painted import COLOUR_GRIDS, EMISSION, among, shared_metadata
from vnca.io.painted.cells import PaintedCells, finer
from vnca.io.parts import VdbSmoke
from vnca.io.provenance import Provenance, without_provenance
from vnca.io.smoke_format import UpAxis, up_axis_of, upright_world
from vnca.io.vdb import Grid, Tiles, Tree, write_vdb
from vnca.io.vdb.layout import ValueType

_RIM = 4
"""Cells from which colour comes to one at the rim of the smoke."""
_COLOUR = COLOUR_GRIDS[0]


def tiles_of(box: Box, edge: int) -> Iterator[Box]:
    """Cubes of so many cells a side that cover a box; where they lie does not depend on it."""
    for x, y, z in product(*map(range, *box.coarsened(edge))):
        yield Box((x, y, z), (x + 1, y + 1, z + 1)).refined(edge)


class PaintedParts:
    """The leaves of a painted frame, in the order in which its parts are painted."""

    def __init__(
        self,
        smoke: VdbSmoke,
        folder: Path,
        *,
        colour_grids: Sequence[str] = COLOUR_GRIDS,
        refine: int = 1,
        beyond: int = 0,
    ) -> None:
        """For a frame that is read by parts, too.

        Args:
            smoke: The frame.
            folder: Where what is painted waits.
            colour_grids: As of `write_painted`, and so
            refine: and
            beyond: are these.
        """
        self._smoke, self._folder, self._refine, self._beyond = smoke, folder, refine, beyond
        self._colour_grids = colour_grids
        self._index = smoke.density
        self._up: UpAxis = up_axis_of(smoke.file.path, smoke.format)
        self._what = f"{smoke.file.path}: grid {self._index.grid.name!r}"
        self._box = self._index.active_box.refined(refine).grown(beyond)
        world = upright_world(self._index.grid.transform.index_to_world, self._up)
        ours = smoke.lattice.to_world
        source, target = (refined_transform(matrix, refine) for matrix in (world, ours))
        self._place = Placement.between(source, target, self._box, self._what)
        self._waiting: dict[str, _Waiting] = {}

    def boxes(self, edge: int) -> Iterator[tuple[Box, Box]]:
        """The parts, cubes of so many cells of the painting, a multiple of 8.

        Yields:
            Cells of the file; and those of the painting on which they depend.
        """
        for own in tiles_of(self._box.grown(1), edge):
            if self._index.holds(self._in_source(own.grown(_RIM + self._beyond))):
                yield own, self._place.box(own.grown(_RIM))

    def add(self, own: Box, density: Field, colour: Field, emission: Field | None) -> None:
        """Keep what was painted of a part.

        Args:
            own: Which cells of the file.
            density: As of `write_painted`, but only where those cells depend on it; so are
            colour: and
            emission: these.

        Raises:
            OutputError: If there is no room.
            ShapeError: If the painting's box does not cover the source's density.
        """
        old = self._index.part(self._in_source(own.grown(_RIM)))
        before, active = old.fields(self._index.active_box)
        colours = {_COLOUR: colour} if emission is None else {_COLOUR: colour, EMISSION: emission}
        lattice = self._smoke.lattice
        frame = PaintedCells(density, colours, lattice, self._up, self._refine, self._beyond)
        stored = frame.stored(old, before, active, self._what)
        self._keep("", own, *stored.density, old.tree.background)
        for name, values in stored.colours.items():
            self._keep(name, own, *values, 0)

    def write(self, path: Path, provenance: Provenance) -> None:
        """Write all that was added, as `write_painted` does.

        Raises:
            OutputError: If the path cannot be written.
        """
        file, old, waiting = self._smoke.file, self._index.grid, dict(self._waiting)
        header = file.grids[self._smoke.format.density_grid]
        transform = finer(old.transform, self._refine)
        density = waiting.pop("").grid(old.name, like=old, transform=transform)
        options: Mapping[str, Any] = {
            "transform": transform,
            "metadata": shared_metadata(old),
            "half": old.is_half,
        }
        names = {_COLOUR: self._colour_grids, EMISSION: (EMISSION,)}
        colours = [
            kept.grid(name, **options) for kind, kept in waiting.items() for name in names[kind]
        ]
        about = {**without_provenance(file.metadata), **provenance.metadata}
        write_vdb(path, among(file, header, density, colours, refine=self._refine), metadata=about)

    def _in_source(self, box: Box) -> Box:
        """The cells of the source in which those of the file lie, at least."""
        return box.coarsened(self._refine).grown(1)

    def pieces(self) -> Iterator["Piece"]:
        """All that was added, some at a time, for the same frame in another program."""
        for name, kept in self._waiting.items():
            yield from kept.pieces(name)

    def take(self, piece: "Piece") -> None:
        """What was added in another program; see `pieces`."""
        name, background, bricks, active, values = piece
        if name not in self._waiting:
            self._waiting[name] = _Waiting(self._folder, background, values.dtype)
        self._waiting[name].add(bricks, active, values)

    def _keep(self, name: str, own: Box, values: Field, active: Field, background: Any) -> None:
        bricks = active.bricks[meeting(active.bricks, own)]
        kind, dtype = values.values.shape[4:], values.values.dtype
        empty = np.array(np.broadcast_to(np.asarray(background, dtype), kind))
        self.take(Piece(name, empty, bricks, active.blocks(bricks), values.blocks(bricks)))


class Piece(NamedTuple):
    """Some leaves of a grid that is to be written.

    Attributes:
        name: Which grid.
        background: Its value where nothing is active.
        bricks: `[n, 3]` where they lie.
        active: `[n, ...]` which of their cells are active.
        values: `[n, ...]` of all of their cells.
    """

    name: str
    background: AnyArray
    bricks: AnyArray
    active: AnyArray
    values: AnyArray


class _Waiting:
    """Leaves of a grid that is to be written."""

    def __init__(self, folder: Path, background: AnyArray, dtype: DTypeLike) -> None:
        self._background = background
        self._bricks = [np.empty((0, 3), np.int32)]
        self._active = [np.empty((0, CELLS), bool)]
        self._values = Scratch(folder, (CELLS, *background.shape), dtype)

    def add(self, bricks: AnyArray, active: AnyArray, values: AnyArray) -> None:
        """Some more, each once."""
        active = active.reshape(-1, CELLS)
        values = values.reshape(len(bricks), *self._values.shape[1:])
        values[~active] = self._background
        self._bricks.append(bricks)
        self._active.append(active)
        self._values.append(values)

    def pieces(self, name: str) -> Iterator[Piece]:
        """All of them as pieces of a name, as they were added."""
        first = 0
        for bricks, active in zip(self._bricks, self._active, strict=True):
            values = self._values[np.arange(first, first + len(bricks))]
            yield Piece(name, self._background, bricks, active, values)
            first += len(bricks)

    def grid(self, name: str, **options: Any) -> Grid:
        """All of them as a grid; see `Grid.from_leaves`."""
        kind = ValueType("", self._values.dtype, int(np.prod(self._values.shape[2:])))
        origins = np.concatenate(self._bricks) * np.int32(EDGE)
        values: Any = self._values
        tree = Tree(
            self._background, origins, np.concatenate(self._active), values, Tiles.none(kind)
        )
        return Grid.from_leaves(name, tree, **options)
