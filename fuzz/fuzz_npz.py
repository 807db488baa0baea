"""Fuzzing of Mantaflow's npz files.

An input is an archive; or, behind a first byte that says how to pack it, the array file in it.
The archive around that is built here, with its checksum.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import atheris
import numpy as np
from harness import fuzz, lengthened, shortened

with atheris.instrument_imports(include=["vnca", "zipfile", "numpy.lib"]):
    from vnca.core.errors import VncaError
    from vnca.io.npz import read_npz_smoke, read_npz_velocity
    from vnca.io.smoke_format import SmokeFormat

_NAME = b"x.npy"
_ARCHIVE, _STORED, _DEFLATED, _TOLD = range(4)
_LOCAL, _ENTRY, _END = "<4s5H3I2H", "<4s6H3I5H2I", "<4s4H2IH"


def build(data: bytes) -> bytes:
    """The archive, according to the first byte."""
    kind = data[0] % 5 if data else _ARCHIVE
    content = lengthened(data[1:])
    if kind == _ARCHIVE:
        return content
    told = len(content)
    if kind == _TOLD:  # a size that the array does not have
        told, content = int.from_bytes(content[:4], "little"), content[4:]
    method = 0 if kind == _STORED else 8
    packed = content
    if method:
        packer = zlib.compressobj(wbits=-15)
        packed = packer.compress(content) + packer.flush()
    facts = (method, 0, 0, zlib.crc32(content), len(packed), told, len(_NAME), 0)
    local = struct.pack(_LOCAL, b"PK\3\4", 20, 0, *facts) + _NAME + packed
    entry = struct.pack(_ENTRY, b"PK\1\2", 20, 20, 0, *facts, 0, 0, 0, 0, 0) + _NAME
    return local + entry + struct.pack(_END, b"PK\5\6", 0, 0, 1, 1, len(entry), len(local), 0)


def read(path: Path) -> None:
    """Read the file as a frame, or else as a velocity."""
    try:
        read_npz_smoke(path, SmokeFormat())
    except VncaError:
        read_npz_velocity(path)


def limit(size: int) -> int:
    """An array may be as large as what the file can unpack to."""
    return 1032 * size


def seeds() -> Iterator[bytes]:
    """Arrays of every kind of float, in either order, packed in every way."""
    random = np.random.default_rng(0)
    for dtype in ("f2", "f4", "f8", ">f4", "f16"):
        for shape in ((2, 3, 2), (2, 3, 2, 1), (2, 3, 2, 3)):
            array = BytesIO()
            values = random.random(shape).astype(dtype)
            np.lib.format.write_array(
                array, np.asfortranarray(values) if shape[-1] == 1 else values
            )
            member = shortened(array.getvalue())
            yield from (bytes([kind]) + member for kind in (_STORED, _DEFLATED))
            archive = BytesIO()
            np.savez_compressed(archive, x=values)
            yield bytes([_ARCHIVE]) + shortened(archive.getvalue())


if __name__ == "__main__":
    fuzz("npz", suffix=".npz", build=build, read=read, limit=limit, seeds=seeds(), longest=2048)
