"""A grid in memory: leaves of 8³ cells and tiles, to and from dense arrays."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from vnca.core import AnyArray, BoolArray, Box, Index, IntArray
from vnca.core.bricks import covered
from vnca.core.errors import GridError
from vnca.core.field import Field, as_bricks
from vnca.io.vdb.layout import LEAF_CELLS, LEAF_EDGE, VALUE_TYPES, ValueType
from vnca.io.vdb.metadata import NAMES_OF_TYPES, Metadata, Transform
from vnca.io.vdb.tree import Tiles, Tree

EMPTY_BOX = Box((0, 0, 0), (0, 0, 0))
_MOST_CELLS = 2**31  # a dense array beyond this is a corrupt box, not a wish
MOST_TILE_CELLS = 2**27
"""Active tiles of more cells (512³) count only where they are wanted, see `Grid.fields`."""


class Described(Protocol):
    """What `Grid` and `GridHeader` have in common."""

    @property
    def value_type(self) -> str: ...  # noqa: D102
    @property
    def is_half(self) -> bool: ...  # noqa: D102
    @property
    def metadata(self) -> Metadata: ...  # noqa: D102
    @property
    def transform(self) -> Transform: ...  # noqa: D102


@dataclass(eq=False)
class Grid:
    """A grid with its values.

    Attributes:
        name: Without the number that tells grids of one name apart.
        value_type: A key of `VALUE_TYPES`: `float`, `vec3s`, …
        transform: From index space to the world.
        tree: Leaves, tiles and background. Values are not only finite ones: check them upstream.
        metadata: By name. Statistics in it are those of the file it came from.
        is_half: Whether files store floating-point values as half floats.
    """

    name: str
    value_type: str
    transform: Transform
    tree: Tree
    metadata: Metadata
    is_half: bool = False

    @property
    def grid_class(self) -> str:
        """`fog volume`, `level set`, `staggered` or `unknown`."""
        return self.metadata.value("class", "unknown")

    @property
    def active_voxels(self) -> int:
        """Active cells in leaves and tiles."""
        tiles = self.tree.tiles
        edges = tiles.edges[tiles.active].tolist()
        return int(self.tree.leaf_active.sum()) + sum(edge**3 for edge in edges)

    @property
    def held_cells(self) -> int:
        """Cells in the bricks of leaves and active tiles: what `fields` take, at most."""
        tiles = self.tree.tiles
        return self.tree.leaf_active.size + sum(
            edge**3 for edge in tiles.edges[tiles.active].tolist()
        )

    def active_box(self) -> Box:
        """The smallest box around the active cells; empty if there are none."""
        tree = self.tree
        cells = tree.leaf_active.reshape(-1, LEAF_EDGE, LEAF_EDGE, LEAF_EDGE)
        bounds = []
        for axis in range(3):
            others = tuple(1 + other for other in range(3) if other != axis)
            occupied = np.logical_or.reduce(cells, axis=others)
            first, last = occupied.argmax(axis=1), 8 - occupied[:, ::-1].argmax(axis=1)
            origins, kept = tree.leaf_origins[:, axis].astype(np.int64), occupied.any(axis=1)
            tiles = tree.tiles.origins[tree.tiles.active, axis].astype(np.int64)
            low = np.concatenate([(origins + first)[kept], tiles])
            high = np.concatenate(
                [(origins + last)[kept], tiles + tree.tiles.edges[tree.tiles.active]]
            )
            if not len(low):
                return EMPTY_BOX
            bounds.append((int(low.min()), int(high.max())))
        (x, u), (y, v), (z, w) = bounds
        return Box((x, y, z), (u, v, w))

    def to_dense(self, box: Box, fill: Any = None) -> tuple[AnyArray, BoolArray]:
        """The cells of `box` as arrays.

        Args:
            box: Any box in index space; what the grid does not store there is background.
            fill: Value given to inactive cells; by default they keep theirs, which is the
                background almost always.

        Returns:
            Values `[x, y, z]`, or `[x, y, z, 3]` for vectors, in the grid's own type, and
            which cells are active, `[x, y, z]`.

        Raises:
            GridError: If the box is too large for an array.
        """
        lower = np.array([low // LEAF_EDGE * LEAF_EDGE for low in box.lower], np.int64)
        bricks = [
            -(-(start + cells - int(low)) // LEAF_EDGE) if cells else 0
            for start, cells, low in zip(box.lower, box.shape, lower, strict=True)
        ]
        x, y, z = (brick * LEAF_EDGE for brick in bricks)
        if x * y * z > _MOST_CELLS:
            raise GridError(f"grid {self.name!r}: a box of {box.shape} cells is too large")
        components = self.tree.leaf_values.shape[2:]
        try:
            values = np.empty((x, y, z, *components), self.tree.leaf_values.dtype)
            active = np.zeros((x, y, z), np.bool_)
        except MemoryError as error:
            raise GridError(
                f"grid {self.name!r}: no memory for a box of {box.shape} cells"
            ) from error
        values[...] = self.tree.background
        self._scatter_leaves(values, active, lower)
        self._scatter_tiles(values, active, lower)
        inside = tuple(
            slice(start - int(low), start - int(low) + cells)
            for start, cells, low in zip(box.lower, box.shape, lower, strict=True)
        )
        # One after the other, so that only one of them is there twice.
        values = np.ascontiguousarray(values[inside])
        active = np.ascontiguousarray(active[inside])
        if fill is not None:
            values[~active] = fill
        return values, active

    def fields(self, box: Box, *, near: IntArray | None = None) -> tuple[Field, Field]:
        """The cells of `box` as fields, which take what leaves and active tiles take.

        Args:
            box: Any box in index space.
            near: Bricks near which alone active tiles count, if there they fill more than fits.

        Returns:
            Values in the grid's own type, zero where inactive, and which cells are active.
        """
        _, counts = self._tile_spans(box)
        fits = counts.prod(axis=1).sum() * LEAF_CELLS <= MOST_TILE_CELLS
        return self._fields(box, None if fits else near)

    def _fields(self, box: Box, near: IntArray | None) -> tuple[Field, Field]:
        tree, edges = self.tree, (LEAF_EDGE,) * 3
        leaves = tree.leaf_origins // LEAF_EDGE
        first, last = covered(leaves, box)
        inside = np.flatnonzero((first < last).all(axis=1))
        tiles, filled = self._tile_bricks(box, near)
        bricks = np.concatenate([leaves[inside], filled])
        order = np.lexsort(bricks.T[::-1])
        kind = tree.leaf_values.shape[2:]
        values = np.empty((len(bricks), LEAF_CELLS, *kind), tree.leaf_values.dtype)
        active = np.empty((len(bricks), LEAF_CELLS), np.bool_)
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        of_leaves, of_tiles = np.split(place, [len(inside)])
        values[of_leaves], active[of_leaves] = tree.leaf_values[inside], tree.leaf_active[inside]
        values[of_tiles], active[of_tiles] = tree.tiles.values[tiles, None], True
        values[~active] = 0
        shown = Field(bricks[order], values.reshape(-1, *edges, *kind), box).within(box)
        return shown, Field(bricks[order], active.reshape(-1, *edges), box, False).within(box)

    def _tile_spans(self, box: Box) -> tuple[AnyArray, AnyArray]:
        """Where tiles begin in a box, and how many bricks they fill in it, `[n, 3]`, 0 if idle."""
        tiles = self.tree.tiles
        origins = tiles.origins.astype(np.int64)
        low = np.maximum(origins, box.lower) // LEAF_EDGE
        high = -(-np.minimum(origins + tiles.edges[:, None], box.upper) // LEAF_EDGE)
        counts = np.maximum(high - low, 0)
        counts[~tiles.active] = 0
        return low, counts

    def _tile_bricks(self, box: Box, near: IntArray | None) -> tuple[AnyArray, IntArray]:
        """Bricks of active tiles in a box: of which tile `[n]`, and their coordinates `[n, 3]`."""
        low, counts = self._tile_spans(box)
        found = np.flatnonzero(counts.all(axis=1))
        if near is not None:
            # Each of those bricks that lie in a tile.
            high = low + counts
            at = [((near >= low[tile]) & (near < high[tile])).all(axis=1) for tile in found]
            bricks = [near[there] for there in at]
        else:
            bricks = [low[tile] + np.argwhere(np.ones(counts[tile], bool)) for tile in found]
        which = np.repeat(found, [len(each) for each in bricks])
        return which, np.concatenate([np.empty((0, 3), np.int32), *bricks]).astype(np.int32)

    def _scatter_leaves(self, values: AnyArray, active: BoolArray, lower: AnyArray) -> None:
        """Write leaves into arrays whose first cell, `lower`, is aligned to leaves."""
        tree, edges = self.tree, (LEAF_EDGE,) * 3
        cells = tree.leaf_values.reshape(-1, *edges, *tree.leaf_values.shape[2:])
        _put_bricks(
            values, active, tree.leaf_origins - lower, cells, tree.leaf_active.reshape(-1, *edges)
        )

    def _scatter_tiles(self, values: AnyArray, active: BoolArray, lower: AnyArray) -> None:
        tiles = self.tree.tiles
        # There can be very many as wide as a leaf, but only few larger ones in an array.
        small, everywhere = tiles.edges == LEAF_EDGE, np.s_[:, None, None, None]
        _put_bricks(
            values,
            active,
            tiles.origins[small] - lower,
            tiles.values[small][everywhere],
            tiles.active[small][everywhere],
        )
        starts = tiles.origins - lower
        stops = np.minimum(starts + tiles.edges[:, None].astype(np.int64), active.shape)
        starts = np.maximum(starts, 0)
        for tile in np.flatnonzero((starts < stops).all(axis=1) & ~small):
            region = tuple(slice(*ends) for ends in zip(starts[tile], stops[tile], strict=True))
            values[region] = tiles.values[tile]
            active[region] = tiles.active[tile]

    @classmethod
    def from_dense(
        cls,
        name: str,
        values: AnyArray,
        active: BoolArray,
        origin: Index,
        *,
        like: Described | None = None,
        transform: Transform | None = None,
        metadata: Mapping[str, Any] | None = None,
        background: Any = 0,
        half: bool | None = None,
        grid_class: str | None = None,
    ) -> "Grid":
        """A grid with a leaf wherever cells are active.

        Args:
            name: Name of the new grid.
            values: `[x, y, z]`, or `[x, y, z, 3]` for vectors, of a type in `VALUE_TYPES`.
            active: `[x, y, z]`. Inactive cells become background.
            origin: Index coordinates of cell `[0, 0, 0]`.
            like: Gives transform, metadata and half floats where they are not given here. Metadata
                that name another type of values are left out.
            transform: From index space to the world.
            metadata: Entries or Python values, added to those of `like`.
            background: Value outside.
            half: Whether files store the values as half floats.
            grid_class: Otherwise that of the metadata.

        Raises:
            GridError: If shapes or type do not fit, or there is no transform.
        """
        if active.dtype != np.bool_ or active.ndim != 3 or values.shape[:3] != active.shape:
            raise GridError(
                f"grid {name!r}: values {values.shape} need a boolean mask of their cells, "
                f"got {active.dtype} {active.shape}"
            )
        return cls.from_fields(
            name,
            Field.from_dense(values, origin, held=active),
            Field.from_dense(active, origin, outside=False),
            like=like,
            transform=transform,
            metadata=metadata,
            background=background,
            half=half,
            grid_class=grid_class,
        )

    @classmethod
    def from_fields(
        cls,
        name: str,
        values: Field,
        active: Field,
        *,
        like: Described | None = None,
        transform: Transform | None = None,
        metadata: Mapping[str, Any] | None = None,
        background: Any = 0,
        half: bool | None = None,
        grid_class: str | None = None,
    ) -> "Grid":
        """A grid with a leaf wherever cells are active; arguments and errors as of `from_dense`."""
        if any(abs(cell) > 2**31 for corner in active.box for cell in corner):
            raise GridError(
                f"grid {name!r}: cells from {active.origin} leave the range of 32-bit indices"
            )
        kind = values.values.shape[4:]
        leaf_active = active.values.reshape(-1, LEAF_CELLS)
        leaf_values = values.blocks(active.bricks).reshape(-1, LEAF_CELLS, *kind)
        background = np.array(np.broadcast_to(np.asarray(background, leaf_values.dtype), kind))
        leaf_values[~leaf_active] = background
        return cls.from_leaves(
            name,
            Tree(
                background,
                active.bricks * np.int32(LEAF_EDGE),
                leaf_active,
                leaf_values,
                Tiles.none(_value_type_of(name, leaf_values)),
            ),
            like=like,
            transform=transform,
            metadata=metadata,
            half=half,
            grid_class=grid_class,
        )

    @classmethod
    def from_leaves(
        cls,
        name: str,
        tree: Tree,
        *,
        like: Described | None = None,
        transform: Transform | None = None,
        metadata: Mapping[str, Any] | None = None,
        half: bool | None = None,
        grid_class: str | None = None,
    ) -> "Grid":
        """A grid with a tree of its own; arguments and errors as of `from_dense`."""
        value_type = _value_type_of(name, tree.leaf_values)
        if transform is None:
            if like is None:
                raise GridError(f"grid {name!r}: needs a transform, or a grid to be like")
            transform = like.transform
        entries = like.metadata.without_statistics() if like is not None else Metadata()
        if like is not None and like.value_type != value_type.name:
            entries = entries.without(NAMES_OF_TYPES)
        entries.update(Metadata.of(metadata))
        if grid_class is not None:
            entries.update(Metadata.of({"class": grid_class}))
        if half is None:
            half = like.is_half if like is not None else False
        return cls(name, value_type.name, transform, tree, entries, half)


def _put_bricks(
    values: AnyArray, active: BoolArray, starts: AnyArray, cells: AnyArray, are_active: AnyArray
) -> None:
    """Write bricks of 8³ cells that begin at `starts` `[n, 3]` and lie inside the arrays."""
    bricks = starts // LEAF_EDGE
    inside = ((bricks >= 0) & (bricks < np.array(active.shape) // LEAF_EDGE)).all(axis=1)
    chosen = slice(None) if inside.all() else inside
    i, j, k = bricks[chosen].T
    as_bricks(values)[i, j, k] = cells[chosen]
    as_bricks(active)[i, j, k] = are_active[chosen]


def _value_type_of(name: str, values: AnyArray) -> ValueType:
    """The type of values of leaves, `[m, 512, ...]`."""
    kind = values.shape[2:]
    components = {(): 1, (3,): 3}.get(kind)
    for value_type in VALUE_TYPES.values():
        if value_type.dtype == values.dtype and value_type.components == components:
            return value_type
    raise GridError(
        f"grid {name!r}: no grid type for {values.dtype} values of shape {kind}; "
        f"there are {', '.join(VALUE_TYPES)}"
    )
