"""Safetensors files of arrays that are nowhere whole in memory.

The package safetensors writes what is in memory only. Reference: its README, "Format".
"""

import json
import struct
from collections.abc import Iterable, Mapping
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from vnca.core import AnyArray

_NAMES = {np.dtype(np.int32): "I32", np.dtype(np.float32): "F32"}
_ALIGNMENT = 8


class Streamed(NamedTuple):
    """An array that comes in pieces.

    Attributes:
        dtype: int32 or float32.
        shape: Of all of it.
        pieces: Along the first axis.
    """

    dtype: np.dtype
    shape: tuple[int, ...]
    pieces: Iterable[AnyArray]


def write_tensors(
    file: BinaryIO, tensors: Mapping[str, Streamed], metadata: Mapping[str, str]
) -> None:
    """Write arrays by their names, and metadata.

    Raises:
        OSError: If the disk is full.
    """
    header: dict[str, object] = {"__metadata__": dict(metadata)}
    end = 0
    for name, tensor in tensors.items():
        begin, end = end, end + int(np.prod(tensor.shape)) * tensor.dtype.itemsize
        header[name] = {
            "dtype": _NAMES[tensor.dtype],
            "shape": tensor.shape,
            "data_offsets": (begin, end),
        }
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % _ALIGNMENT)
    file.write(struct.pack("<Q", len(text)) + text)
    begin = file.tell()
    for tensor in tensors.values():
        for piece in tensor.pieces:
            data: Any = np.ascontiguousarray(piece, tensor.dtype.newbyteorder("<"))
            file.write(data.reshape(-1).view(np.uint8))
    assert file.tell() == begin + end, "pieces of other shapes than were told"
