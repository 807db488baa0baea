"""Reading the tree of a grid: its nodes from the root down, then the values of its leaves.

Reference: OpenVDB `tree/Tree.h`, `tree/RootNode.h`, `tree/InternalNode.h`, `tree/LeafNode.h`,
`tree/LeafNodeBool.h` (`readTopology`, `readBuffers`).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, BoolArray, IntArray
from vnca.io.vdb.compression import Codec, read_value
from vnca.io.vdb.layout import (
    LEAF_CELLS,
    LEAF_EDGE,
    LOWER_EDGE,
    LOWER_SLOTS,
    UPPER_EDGE,
    UPPER_SLOTS,
    Compression,
    Cursor,
    ValueType,
    bits_of,
    slot_origins,
)


class Tiles(NamedTuple):
    """Cubes of one value: those that are active, or differ from the background.

    Attributes:
        origins: Lowest cell, `[n, 3]`.
        edges: Cells along an edge: 8, 128 or 4096, `[n]`.
        values: `[n]`, or `[n, 3]` for vectors.
        active: `[n]`.
    """

    origins: IntArray
    edges: IntArray
    values: AnyArray
    active: BoolArray

    @classmethod
    def none(cls, value_type: ValueType) -> "Tiles":
        """No tiles."""
        values = value_type.shaped(np.empty((0, value_type.components), value_type.dtype))
        origins, edges = np.empty((0, 3), np.int32), np.empty(0, np.int32)
        return cls(origins, edges, values, np.empty(0, np.bool_))


class Tree(NamedTuple):
    """What a grid stores.

    Attributes:
        background: Value everywhere else, a scalar array or `[3]`.
        leaf_origins: Lowest cell of each leaf, `[n, 3]`.
        leaf_active: `[n, 512]`, z fastest.
        leaf_values: `[n, 512]`, or `[n, 512, 3]` for vectors.
        tiles: Cubes of one value.
    """

    background: AnyArray
    leaf_origins: IntArray
    leaf_active: BoolArray
    leaf_values: AnyArray
    tiles: Tiles


class _Topology:
    """Walks the nodes above the leaves and gathers leaves and tiles in the file's order."""

    def __init__(self, cursor: Cursor, codec: Codec) -> None:
        self.cursor = cursor
        self.codec = codec
        self.leaf_origins: list[IntArray] = [np.empty((0, 3), np.int32)]
        self.leaf_masks: list[bytes] = []
        self.tiles: list[Tiles] = [Tiles.none(codec.value_type)]

    def read_root(self) -> None:
        cursor, value_type = self.cursor, self.codec.value_type
        tile_count, child_count = cursor.unpack("II")
        stored = value_type.stored_dtype(False)
        record = np.dtype(
            [("origin", "<i4", 3), ("value", stored, (value_type.components,)), ("active", "u1")]
        )
        tiles = np.frombuffer(cursor.take(tile_count * record.itemsize), record)
        self._check_root_origins(tiles["origin"])
        values, active = tiles["value"].astype(value_type.dtype), tiles["active"] != 0
        kept = self._is_tile(values, active)
        self._add_tiles(tiles["origin"][kept], UPPER_EDGE, values[kept], active[kept])
        seen = {tuple(origin) for origin in tiles["origin"].tolist()}
        if len(seen) < tile_count:
            raise cursor.error("corrupt: two tiles below the root share a place")
        for _ in range(child_count):
            origin = np.array(cursor.unpack("3i"), np.int32)
            self._check_root_origins(origin[None])
            if (key := tuple(origin.tolist())) in seen:
                raise cursor.error(f"corrupt: two nodes at {key}")
            seen.add(key)
            for lower_origin in self._read_node(origin, UPPER_SLOTS, LOWER_EDGE):
                leaf_origins = self._read_node(lower_origin, LOWER_SLOTS, LEAF_EDGE)
                self.leaf_origins.append(leaf_origins)
                self.leaf_masks.append(cursor.take(len(leaf_origins) * LEAF_CELLS // 8))

    def leaves(self) -> tuple[IntArray, BoolArray]:
        """Lowest cell of each leaf `[n, 3]`, and which of its cells are active `[n, 512]`."""
        active = bits_of(b"".join(self.leaf_masks)).reshape(-1, LEAF_CELLS)
        return np.concatenate(self.leaf_origins), active

    def all_tiles(self) -> Tiles:
        return Tiles(*(np.concatenate(parts) for parts in zip(*self.tiles, strict=True)))

    def _check_root_origins(self, origins: AnyArray) -> None:
        if (origins % UPPER_EDGE).any():
            raise self.cursor.error("corrupt: a node below the root is not on a multiple of 4096")

    def _read_node(self, origin: IntArray, slots: int, slot_edge: int) -> IntArray:
        """Keep the tiles of the internal node at the cursor; return where its children are."""
        has_child = bits_of(self.cursor.take(slots // 8))
        active = bits_of(self.cursor.take(slots // 8))
        values = self.codec.read_values(self.cursor, active[None], is_leaf=False)[0]
        per_edge = round(slots ** (1 / 3))
        tiles = np.flatnonzero(self._is_tile(values, active) & ~has_child)
        tile_origins = origin + slot_origins(tiles, per_edge, slot_edge)
        self._add_tiles(tile_origins, slot_edge, values[tiles], active[tiles])
        return origin + slot_origins(np.flatnonzero(has_child), per_edge, slot_edge)

    def _is_tile(self, values: AnyArray, active: BoolArray) -> BoolArray:
        return active | ~self.codec.is_background(values)

    def _add_tiles(self, origins: AnyArray, edge: int, values: AnyArray, active: BoolArray) -> None:
        if len(origins):
            edges = np.full(len(origins), edge, np.int32)
            self.tiles.append(Tiles(origins, edges, self.codec.value_type.shaped(values), active))


def read_tree(cursor: Cursor, value_type: ValueType, *, is_half: bool, flags: Compression) -> Tree:
    """The tree at the cursor; the cursor moves behind it.

    Args:
        cursor: At the first byte of the tree.
        value_type: Type of the values.
        is_half: Whether floating-point values are stored as half floats.
        flags: How values are packed.

    Raises:
        FileFormatError: If the tree is truncated or corrupt.
    """
    topology = _read_topology(cursor, value_type, is_half, flags)
    codec = topology.codec
    origins, active = topology.leaves()
    if value_type.name == "bool":
        values = _read_bool_leaves(cursor, origins, active)
    else:
        values = codec.read_values(cursor, active, is_leaf=True)
    background = value_type.shaped(codec.background)
    return Tree(background, origins, active, value_type.shaped(values), topology.all_tiles())


class Leaves(NamedTuple):
    """All of a tree but the values of its leaves, and where those are: any of them can be read.

    Attributes:
        begin: Byte where the values of the leaves begin.
        positions: Byte where those of each leaf begin, `[n + 1]`, and where the tree ends.
        origins: Lowest cell of each leaf, `[n, 3]`.
        active: `[n, 512]`, z fastest.
        tiles: Cubes of one value.
        codec: How values are stored.
    """

    begin: int
    positions: AnyArray
    origins: IntArray
    active: BoolArray
    tiles: Tiles
    codec: Codec

    def tree(self, cursor_at: Callable[[int], Cursor], chosen: AnyArray) -> Tree:
        """The tree with some of its leaves alone.

        Args:
            cursor_at: A cursor at a byte of the file.
            chosen: `[m]` numbers of leaves, ascending.

        Raises:
            FileFormatError: If a leaf is corrupt.
        """
        value_type, kind = self.codec.value_type, (LEAF_CELLS, self.codec.value_type.components)
        values = np.empty((len(chosen), *kind), value_type.dtype)
        done = 0
        for run in np.split(chosen, np.flatnonzero(np.diff(chosen) != 1) + 1):
            if not len(run):
                continue
            cursor, active = cursor_at(int(self.positions[run[0]])), self.active[run]
            values[done : done + len(run)] = (
                _read_bool_leaves(cursor, self.origins[run], active)
                if value_type.name == "bool"
                else self.codec.read_values(cursor, active, is_leaf=True)
            )
            done += len(run)
        background = value_type.shaped(self.codec.background)
        origins, active = self.origins[chosen], self.active[chosen]
        return Tree(background, origins, active, value_type.shaped(values), self.tiles)


def read_active(
    cursor: Cursor, value_type: ValueType, *, is_half: bool, flags: Compression
) -> Tree:
    """Which cells are active, as the values of a tree, from its nodes alone.

    The arguments and errors are those of `read_tree`; values of leaves are not read.
    """
    topology = _read_topology(cursor, value_type, is_half, flags)
    origins, active = topology.leaves()
    tiles = topology.all_tiles()
    return Tree(np.zeros((), bool), origins, active, active, tiles._replace(values=tiles.active))


def locate_leaves(
    cursor: Cursor, value_type: ValueType, *, is_half: bool, flags: Compression
) -> Leaves:
    """What a tree holds and where the values of its leaves are; the cursor moves behind the tree.

    The arguments and errors are those of `read_tree`; values of leaves are not unpacked.
    """
    topology = _read_topology(cursor, value_type, is_half, flags)
    origins, active = topology.leaves()
    begin = cursor.position
    if value_type.name == "bool":
        _read_bool_leaves(cursor, origins, active)
        positions = begin + BOOL_LEAF.itemsize * np.arange(len(origins) + 1)
    else:
        positions = topology.codec.skip_leaves(cursor, active)
    return Leaves(begin, positions, origins, active, topology.all_tiles(), topology.codec)


def _read_topology(
    cursor: Cursor, value_type: ValueType, is_half: bool, flags: Compression
) -> _Topology:
    if (buffers := cursor.unpack("i")) != 1:
        raise cursor.error(f"corrupt: a tree of {buffers} buffers, expected 1")
    codec = Codec(value_type, is_half, flags, read_value(cursor, value_type))
    topology = _Topology(cursor, codec)
    topology.read_root()
    return topology


BOOL_LEAF = np.dtype(
    [("active", "u1", LEAF_CELLS // 8), ("origin", "<i4", 3), ("values", "u1", LEAF_CELLS // 8)]
)


def _read_bool_leaves(cursor: Cursor, origins: IntArray, active: BoolArray) -> BoolArray:
    """Values of boolean leaves, which are never packed. Reference: `tree/LeafNodeBool.h`."""
    leaves = np.frombuffer(cursor.take(len(origins) * BOOL_LEAF.itemsize), BOOL_LEAF)
    masks = np.packbits(active, axis=1, bitorder="little")
    if not (np.array_equal(leaves["active"], masks) and np.array_equal(leaves["origin"], origins)):
        raise cursor.error("corrupt: the two masks or origins of a leaf differ")
    return np.unpackbits(leaves["values"], axis=1, bitorder="little").view(np.bool_)[..., None]
