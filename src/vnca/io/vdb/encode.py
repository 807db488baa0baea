"""Turning a grid into the bytes of a file.

Reference: OpenVDB `tree/RootNode.h`, `tree/InternalNode.h`, `tree/LeafNode.h`,
`tree/LeafNodeBool.h` (`writeTopology`, `writeBuffers`), `Grid.cc` (`addStatsMetadata`).
"""

import struct
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray, BoolArray
from vnca.core.errors import GridError
from vnca.io.vdb.compression import Codec
from vnca.io.vdb.grid import Grid
from vnca.io.vdb.layout import (
    LEAF_CELLS,
    LEAF_EDGE,
    LOWER_EDGE,
    LOWER_SLOTS,
    UPPER_EDGE,
    UPPER_SLOTS,
    VALUE_TYPES,
    Compression,
    ValueType,
    slots_of,
)
from vnca.io.vdb.metadata import Entry, Metadata
from vnca.io.vdb.tree import BOOL_LEAF

_INT_MAX, _INT_MIN = 2**31 - 1, -(2**31)


class EncodedGrid(NamedTuple):
    """The parts of a grid in the order of the file.

    Attributes:
        head: Compression, metadata and transform.
        topology: The tree down to the masks of the leaves.
        values: The leaves' values, made as they are asked for.
    """

    head: bytes
    topology: bytes
    values: Iterator[bytes]


def encode_grid(grid: Grid, flags: Compression) -> EncodedGrid:
    """The bytes of `grid`, packed according to `flags`.

    Raises:
        GridError: If leaves or tiles overlap or lie off their places.
    """
    writer = _TreeWriter(grid, flags)
    topology = writer.topology()
    head = struct.pack("<I", flags) + _metadata(grid, flags, writer).encode()
    return EncodedGrid(head + grid.transform.encode(), topology, writer.leaf_values())


class _TreeWriter:
    def __init__(self, grid: Grid, flags: Compression) -> None:
        self.grid = grid
        self.value_type = VALUE_TYPES[grid.value_type]
        tree = grid.tree
        background = np.asarray(tree.background, self.value_type.dtype)
        self.codec = Codec(
            self.value_type, grid.is_half, flags, self.value_type.unshaped(background)
        )
        self.tile_values = self.value_type.unshaped(tree.tiles.values)
        _check_places(grid)
        self.leaves = _grouped(tree.leaf_origins, LOWER_EDGE)
        self.tiles = {
            edge: _grouped(tree.tiles.origins, parent, np.flatnonzero(tree.tiles.edges == edge))
            for edge, parent in (
                (LEAF_EDGE, LOWER_EDGE),
                (LOWER_EDGE, UPPER_EDGE),
                (UPPER_EDGE, UPPER_EDGE),
            )
        }
        lower = sorted(self.leaves.keys() | self.tiles[LEAF_EDGE].keys())
        self.lower_origins = np.array(lower, np.int64).reshape(-1, 3)
        self.lower = _grouped(self.lower_origins, UPPER_EDGE)
        self.upper = sorted(self.lower.keys() | self.tiles[LOWER_EDGE].keys())
        if self.tiles[UPPER_EDGE].keys() & set(self.upper):
            raise GridError(f"grid {grid.name!r}: a tile lies where leaves or smaller tiles are")
        self.leaf_order: list[AnyArray] = [_NOTHING]

    def topology(self) -> bytes:
        """Background, tiles and nodes; notes the order in which leaves are met."""
        tiles = self.grid.tree.tiles
        root_tiles = [tile for (tile,) in self.tiles[UPPER_EDGE].values()]
        parts = [
            struct.pack("<i", 1),
            self._stored_background(),
            struct.pack("<II", len(root_tiles), len(self.upper)),
        ]
        for tile in root_tiles:
            parts += (
                tiles.origins[tile].astype("<i4").tobytes(),
                self.tile_values[tile].tobytes(),
                struct.pack("?", tiles.active[tile]),
            )
        for key in self.upper:
            children = self.lower.get(key, _NOTHING)
            parts.append(struct.pack("<3i", *key))
            origins, slot_tiles = self.lower_origins[children], self.tiles[LOWER_EDGE].get(key)
            order = np.argsort(slots_of(origins, 32, LOWER_EDGE))
            parts.append(self._node(origins, slot_tiles, UPPER_SLOTS, LOWER_EDGE))
            parts += [self._lower_node(tuple(origins[child].tolist())) for child in order]
        return b"".join(parts)

    def _lower_node(self, key: tuple[int, int, int]) -> bytes:
        leaves = self.leaves.get(key, _NOTHING)
        origins = self.grid.tree.leaf_origins[leaves]
        order = np.argsort(slots_of(origins, 16, LEAF_EDGE))
        self.leaf_order.append(leaves[order])
        node = self._node(origins, self.tiles[LEAF_EDGE].get(key), LOWER_SLOTS, LEAF_EDGE)
        active = self.grid.tree.leaf_active[leaves[order]]
        return node + np.packbits(active, axis=1, bitorder="little").tobytes()

    def _node(
        self, child_origins: AnyArray, tiles: AnyArray | None, slots: int, slot_edge: int
    ) -> bytes:
        """Masks and tile values of an internal node."""
        per_edge = round(slots ** (1 / 3))
        has_child, active = np.zeros((2, 1, slots), np.bool_)
        values = np.empty((1, slots, self.value_type.components), self.value_type.dtype)
        values[...] = self.codec.background
        has_child[0, slots_of(child_origins, per_edge, slot_edge)] = True
        values[has_child] = 0
        if tiles is not None:
            places = slots_of(self.grid.tree.tiles.origins[tiles], per_edge, slot_edge)
            if has_child[0, places].any():
                raise GridError(f"grid {self.grid.name!r}: a tile lies where leaves are")
            values[0, places] = self.tile_values[tiles]
            active[0, places] = self.grid.tree.tiles.active[tiles]
        masks = (np.packbits(mask, bitorder="little").tobytes() for mask in (has_child, active))
        return b"".join([*masks, *self._packed(active, values, has_child)])

    def _packed(
        self, active: BoolArray, values: AnyArray, ignored: BoolArray | None = None
    ) -> Iterator[bytes]:
        try:
            yield from self.codec.write_values(active, values, ignored)
        except GridError as error:
            raise GridError(f"grid {self.grid.name!r}: {error}") from error

    def _stored_background(self) -> bytes:
        """In full precision, but rounded as the values are."""
        dtype = self.value_type.stored_dtype(self.grid.is_half)
        background = self.codec.background
        with np.errstate(over="ignore"):
            return background.astype(dtype).astype(self.value_type.dtype).tobytes()

    def leaf_values(self) -> Iterator[bytes]:
        """Mask and values of each leaf in the order of the topology."""
        tree = self.grid.tree
        order = np.concatenate(self.leaf_order)
        if self.value_type.name == "bool":
            leaves = np.zeros(len(order), BOOL_LEAF)
            leaves["active"] = np.packbits(tree.leaf_active[order], axis=1, bitorder="little")
            leaves["origin"] = tree.leaf_origins[order]
            leaves["values"] = np.packbits(tree.leaf_values[order], axis=1, bitorder="little")
            yield leaves.tobytes()
            return
        for start in range(0, len(order), _BATCH):
            batch = order[start : start + _BATCH]
            active = tree.leaf_active[batch]
            masks = np.packbits(active, axis=1, bitorder="little")
            values = self.value_type.unshaped(tree.leaf_values[batch])
            for mask, packed in zip(masks, self._packed(active, values), strict=True):
                yield mask.tobytes() + packed


_BATCH = 2048
_NOTHING = np.empty(0, np.int64)


def _check_places(grid: Grid) -> None:
    tree = grid.tree
    edges = np.concatenate([np.full(len(tree.leaf_origins), LEAF_EDGE), tree.tiles.edges])
    origins = np.concatenate([tree.leaf_origins, tree.tiles.origins])
    if not np.isin(edges, (LEAF_EDGE, LOWER_EDGE, UPPER_EDGE)).all():
        raise GridError(f"grid {grid.name!r}: tiles are 8, 128 or 4096 cells wide")
    if (origins % edges[:, None]).any():
        raise GridError(f"grid {grid.name!r}: a leaf or tile is not on a multiple of its width")
    if len(np.unique(origins, axis=0)) < len(origins):
        raise GridError(f"grid {grid.name!r}: two leaves or tiles share a place")


def _grouped(
    origins: AnyArray, edge: int, chosen: AnyArray | None = None
) -> dict[tuple[int, int, int], AnyArray]:
    """Indices of the `chosen` of `origins` by the node of width `edge` they lie in, sorted."""
    indices = np.arange(len(origins)) if chosen is None else chosen
    nodes = origins[indices].astype(np.int64) // edge * edge
    order = np.lexsort(nodes.T[::-1])
    nodes = nodes[order]
    starts = np.flatnonzero(np.r_[True, (nodes[1:] != nodes[:-1]).any(axis=1)][: len(nodes)])
    groups = np.split(indices[order], starts[1:]) if len(nodes) else []
    return {
        (x, y, z): group for (x, y, z), group in zip(nodes[starts].tolist(), groups, strict=True)
    }


def _metadata(grid: Grid, flags: Compression, writer: _TreeWriter) -> Metadata:
    """The grid's metadata with OpenVDB's statistics of this tree, in OpenVDB's order."""
    metadata = grid.metadata.without_statistics()
    lower, upper = grid.active_box()
    if grid.active_voxels == 0:
        lower, upper = (_INT_MAX,) * 3, (_INT_MIN + 1,) * 3
    x, y, z = upper
    metadata["name"] = Entry.of(grid.name)
    if grid.is_half or "is_saved_as_half_float" in metadata:
        metadata["is_saved_as_half_float"] = Entry.of(grid.is_half)
    metadata["file_bbox_min"] = Entry.of(lower, "vec3i")
    metadata["file_bbox_max"] = Entry.of((x - 1, y - 1, z - 1), "vec3i")
    metadata["file_compression"] = Entry.of(flags.describe())
    metadata["file_voxel_count"] = Entry.of(grid.active_voxels, "int64")
    bytes_in_memory = _bytes_in_memory(
        writer.value_type, len(writer.upper), len(writer.lower_origins), len(grid.tree.leaf_origins)
    )
    metadata["file_mem_bytes"] = Entry.of(bytes_in_memory, "int64")
    return Metadata(
        sorted(metadata.items(), key=lambda item: item[0].encode("utf-8", "surrogateescape"))
    )


def _bytes_in_memory(value_type: ValueType, uppers: int, lowers: int, leaves: int) -> int:
    """What the tree takes in OpenVDB 10. Reference: `tree/*.h`, `memUsage`."""
    slot = -(-value_type.size // 8) * 8
    root = 1288 + 2 * slot
    leaf = 144 if value_type.name == "bool" else 96 + LEAF_CELLS * value_type.size
    inner = sum(
        count * (slots * slot + slots // 4 + 12)
        for count, slots in ((uppers, UPPER_SLOTS), (lowers, LOWER_SLOTS))
    )
    return root + inner + leaves * leaf
