"""Packed values: chunks of bytes, and below them the omission of inactive values.

Reference: OpenVDB `io/Compression.h` (`readCompressedValues`, `writeCompressedValues`) and
`io/Compression.cc` (`unzipFromStream`, `bloscFromStream`); c-blosc `README_HEADER.rst`.
"""

import struct
import threading
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import blosc
import blosc.blosc_extension
import numpy as np

from vnca.core import AnyArray, BoolArray
from vnca.core.errors import GridError
from vnca.io.vdb.layout import Compression, Cursor, NodeCode, ValueType, bits_of

_BLOSC_HEADER = struct.Struct("<4B3I")  # versions, flags, type size; bytes, block, packed bytes
_BLOSC_LEVEL, _ONE_BLOCK = 9, 32 * 1024
_BLOSC_THREADS = threading.Lock()
_BATCH = 2048  # leaves in flight while packing and unpacking; bounds temporary memory
_LARGEST_HALF = float(np.finfo(np.float16).max)


@dataclass(frozen=True)
class Codec:
    """How the nodes of one tree store their values.

    Arrays here are `[node, cell, component]`, also for scalars.

    Attributes:
        value_type: Type of the values in memory.
        is_half: Whether floating-point values are stored as half floats.
        flags: Packing of the chunks, and whether inactive values are omitted.
        background: `[component]`.
    """

    value_type: ValueType
    is_half: bool
    flags: Compression
    background: AnyArray

    def is_background(self, values: AnyArray) -> BoolArray:
        """Which of `values` `[..., component]` are background; it may be not a number."""
        same = np.asarray(values == self.background)
        if self.value_type.dtype.kind == "f" and np.isnan(self.background).any():
            same |= np.isnan(values) & np.isnan(self.background)
        # Along an axis of one, the other would take most of the time of reading a node.
        is_scalar = self.value_type.components == 1
        return same[..., 0] if is_scalar else np.logical_and.reduce(same, axis=-1)

    def read_values(self, cursor: Cursor, active: BoolArray, *, is_leaf: bool) -> AnyArray:
        """Values of the consecutive nodes at the cursor, whose masks are `active` `[n, cell]`.

        Raises:
            FileFormatError: If they are truncated or corrupt.
        """
        nodes, cells = active.shape
        # A leaf repeats its mask and has one byte of code; half floats may need no chunk at all.
        cursor.expect(nodes * (cells // 8 + 1 if is_leaf else 1))
        values = np.empty((nodes, cells, self.value_type.components), self.value_type.dtype)
        for start in range(0, nodes, _BATCH):
            batch = slice(start, start + _BATCH)
            self._read_batch(cursor, active[batch], values[batch], is_leaf)
        return values

    def _read_batch(
        self, cursor: Cursor, active: BoolArray, values: AnyArray, is_leaf: bool
    ) -> None:
        omits = Compression.ACTIVE_MASK in self.flags
        stored = active.copy() if omits else np.ones_like(active)
        if omits:
            values[...] = self.background
        chunks = []
        for node, (code, inactive, count) in enumerate(self._nodes(cursor, active, is_leaf)):
            if inactive is not None and omits:
                values[node] = inactive
            if code == NodeCode.ALL_VALUES:
                stored[node] = True
            chunks.append(self._read_chunk(cursor, count))
        packed = np.frombuffer(b"".join(chunks), self.value_type.stored_dtype(self.is_half))
        with np.errstate(invalid="ignore"):  # not-a-numbers are data here
            values[stored] = packed.reshape(-1, self.value_type.components)

    def skip_leaves(self, cursor: Cursor, active: BoolArray) -> AnyArray:
        """Move the cursor behind the leaves whose masks are `active`; nothing is unpacked.

        Returns:
            The byte where each of them begins, `[n + 1]`, and where the last one ends.

        Raises:
            FileFormatError: If they are truncated or corrupt.
        """
        positions = [cursor.position]
        for start in range(0, len(active), _BATCH):
            for _, _, count in self._nodes(cursor, active[start : start + _BATCH], is_leaf=True):
                length, _ = self._chunk_length(cursor, self._stored_size(count))
                cursor.seek(cursor.position + length)
                positions.append(cursor.position)
        return np.array(positions, np.int64)

    def _nodes(
        self, cursor: Cursor, active: BoolArray, is_leaf: bool
    ) -> Iterator[tuple[int, AnyArray | None, int]]:
        """Code, inactive values if the node has some, and how many values its chunk has.

        Who asks for the next node has moved the cursor behind the chunk of the one before.
        """
        cells = active.shape[1]
        omits = Compression.ACTIVE_MASK in self.flags
        counts = active.sum(axis=1).tolist() if omits else [cells] * len(active)
        masks = np.packbits(active, axis=1, bitorder="little") if is_leaf else active
        for node, count in enumerate(counts):
            if is_leaf and cursor.take(masks.shape[1]) != masks[node].tobytes():
                raise cursor.error("corrupt: the two masks of a leaf differ")
            code = cursor.take(1)[0]
            if code > NodeCode.ALL_VALUES:
                raise cursor.error(f"corrupt: node code {code}")
            inactive = None
            if NodeCode.BACKGROUND < code < NodeCode.ALL_VALUES:
                inactive = self._read_inactive_values(cursor, code, cells)
            yield code, inactive, cells if code == NodeCode.ALL_VALUES else count

    def _read_inactive_values(self, cursor: Cursor, code: int, cells: int) -> AnyArray:
        """What omitted cells hold, `[cell, component]` or `[component]`."""
        off, on = _negative(self.background), self.background
        if code in (NodeCode.ONE_VALUE, NodeCode.MASK_AND_ONE_VALUE, NodeCode.MASK_AND_TWO_VALUES):
            off = read_value(cursor, self.value_type)
        if code == NodeCode.MASK_AND_TWO_VALUES:
            on = read_value(cursor, self.value_type)
        if code < NodeCode.MASK_OF_BACKGROUNDS:
            return off
        return np.where(bits_of(cursor.take(cells // 8))[:, None], on, off)

    def _stored_size(self, count: int) -> int:
        """Bytes that `count` values take in the clear."""
        return (
            count * self.value_type.components * self.value_type.stored_dtype(self.is_half).itemsize
        )

    def _chunk_length(self, cursor: Cursor, size: int) -> tuple[int, bool]:
        """Bytes of the chunk that follows, which holds `size`, and whether they are packed."""
        if not self.flags & (Compression.ZIP | Compression.BLOSC):
            return size, False
        # OpenVDB writes no chunk at all where there is nothing to convert to half floats.
        stored = self.value_type.stored_dtype(self.is_half)
        if size == 0 and stored != self.value_type.dtype and stored.kind == "f":
            return 0, False
        length = cursor.unpack("q")
        if length > 0:
            return length, True
        if -length != size:
            raise cursor.error(f"corrupt: a chunk of {-length} bytes, expected {size}")
        return size, False

    def _read_chunk(self, cursor: Cursor, count: int) -> bytes:
        size = self._stored_size(count)
        length, is_packed = self._chunk_length(cursor, size)
        packed = cursor.take(length)
        if not is_packed:
            return packed
        if size == 0:
            return b""
        unpack = _unpack_blosc if Compression.BLOSC in self.flags else _unpack_zip
        if (data := unpack(packed, size)) is None:
            raise cursor.error(f"corrupt: a compressed chunk does not unpack to {size} bytes")
        return data

    def write_values(
        self, active: BoolArray, values: AnyArray, ignored: BoolArray | None = None
    ) -> Iterator[bytes]:
        """The code and chunk of each node, one item a node.

        Inactive values are omitted where all are background; else a node keeps all its values.

        Args:
            active: `[n, cell]`.
            values: `[n, cell, component]`.
            ignored: Cells whose value does not count because a child is there, `[n, cell]`.

        Raises:
            GridError: If a finite value is too large for a half float.
        """
        for start in range(0, len(active), _BATCH):
            batch = slice(start, start + _BATCH)
            implied = self.is_background(values[batch]) | active[batch]
            if ignored is not None:
                implied |= ignored[batch]
            omits = np.logical_and.reduce(implied, axis=1) & (Compression.ACTIVE_MASK in self.flags)
            stored = np.where(omits[:, None], active[batch], True)
            packed = memoryview(self._to_stored(values[batch][stored]).tobytes())
            bytes_a_value = (
                self.value_type.stored_dtype(self.is_half).itemsize * self.value_type.components
            )
            ends = np.cumsum(stored.sum(axis=1) * bytes_a_value).tolist()
            for omit, begin, end in zip(omits.tolist(), [0, *ends], ends, strict=False):
                code = NodeCode.BACKGROUND if omit else NodeCode.ALL_VALUES
                yield bytes([code]) + self._chunk(packed[begin:end].tobytes())

    def _to_stored(self, values: AnyArray) -> AnyArray:
        dtype = self.value_type.stored_dtype(self.is_half)
        if dtype.kind != "f" or dtype == values.dtype:
            return values.astype(dtype, copy=False)
        # Through float, as OpenVDB does, so that doubles round as there.
        with np.errstate(all="ignore"):
            stored = values.astype(np.float32, copy=False).astype(dtype)
        if (np.isinf(stored) & np.isfinite(values)).any():
            raise GridError(
                f"values up to {np.abs(values[np.isfinite(values)]).max():g} do not fit half "
                f"floats (at most {_LARGEST_HALF:g}); write the grid in full precision"
            )
        return stored

    def _chunk(self, data: bytes) -> bytes:
        """`data` behind its length, packed if that makes it smaller."""
        stored = self.value_type.stored_dtype(self.is_half)
        if not self.flags & (Compression.ZIP | Compression.BLOSC):
            return data
        if not data:
            is_converted = stored != self.value_type.dtype and stored.kind == "f"
            return b"" if is_converted else struct.pack("<q", 0)
        packed = (
            _pack_blosc(data, stored.itemsize)
            if Compression.BLOSC in self.flags
            else zlib.compress(data)
        )
        if len(packed) < len(data):
            return struct.pack("<q", len(packed)) + packed
        return struct.pack("<q", -len(data)) + data


def read_value(cursor: Cursor, value_type: ValueType) -> AnyArray:
    """A single value at the cursor, in full precision, `[component]`."""
    stored = np.frombuffer(cursor.take(value_type.size), value_type.stored_dtype(False))
    return stored.astype(value_type.dtype)


def _negative(value: AnyArray) -> AnyArray:
    """Reference: `math/Math.h`, `negative`."""
    return ~value if value.dtype == np.bool_ else -value


def _unpack_zip(packed: bytes, size: int) -> bytes | None:
    unpacker = zlib.decompressobj()
    try:
        data = unpacker.decompress(packed, size + 1)
    except zlib.error:
        return None
    return data if len(data) == size and unpacker.eof else None


def _unpack_blosc(packed: bytes, size: int) -> bytes | None:
    """`packed` in the clear; its header is checked first because the package trusts it."""
    if len(packed) < _BLOSC_HEADER.size:
        return None
    _, _, _, _, unpacked_size, _, packed_size = _BLOSC_HEADER.unpack_from(packed)
    if unpacked_size != size or packed_size != len(packed):
        return None
    try:
        data = blosc.decompress(packed)
    except blosc.blosc_extension.error:
        return None
    return data if len(data) == size else None


def _pack_blosc(data: bytes, itemsize: int) -> bytes:
    if len(data) <= _ONE_BLOCK:
        return blosc.compress(data, itemsize, _BLOSC_LEVEL, blosc.SHUFFLE, "lz4")
    # Several threads would append the blocks in the order they finish.
    with _BLOSC_THREADS:
        threads = blosc.set_nthreads(1)
        try:
            return blosc.compress(data, itemsize, _BLOSC_LEVEL, blosc.SHUFFLE, "lz4")
        finally:
            blosc.set_nthreads(threads)
