"""GLB files: binary glTF 2.0, as its JSON document and one block of bytes.

The document stays the JSON it was in the file: whatever is not understood here (animations,
skins, lights, extensions, extras) is written back as it came.

Reference: Khronos glTF 2.0 specification, sections 3.6 (accessors) and 4 (GLB).
"""

import base64
import json
import math
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote_to_bytes

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import FileFormatError
from vnca.core.files import existing_file, whole_file
from vnca.core.records import whole

_MAGIC, _VERSION = 0x46546C67, 2
_JSON, _BIN = 0x4E4F534A, 0x004E4942
_DTYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
DAMAGE = (KeyError, TypeError, AttributeError, ValueError, IndexError, OverflowError)
"""What using a document raises whose JSON holds other things than glTF says."""
_LISTS = (
    "accessors", "bufferViews", "buffers", "images", "materials", "meshes", "nodes", "samplers",
    "scenes", "textures",
)  # fmt: skip
_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")


class Glb:
    """A glTF document with its binary block.

    Attributes:
        path: Where it came from, for messages.
        document: The JSON, to be read and changed in place.
    """

    def __init__(self, path: Path, document: dict[str, Any], blob: bytes = b"") -> None:
        self.path = path
        self.document = document
        self._blob = bytearray(blob)

    @classmethod
    def read(cls, path: Path) -> "Glb":
        """Read a `.glb` file.

        Raises:
            FileFormatError: If it is missing, not GLB, damaged, compressed by meshopt or in several
                files.
        """
        return cls.parse(existing_file(path).read_bytes(), path)

    @classmethod
    def parse(cls, data: bytes, path: Path) -> "Glb":
        """The document in the bytes of a GLB file; `path` is for messages.

        Buffers that the JSON holds as text are read too, bytes behind the end that the file names
        are not. Meshes compressed by Draco stay so.

        Raises:
            FileFormatError: If it is not GLB, damaged, compressed by meshopt or in several files.
        """
        if len(data) < 20 or struct.unpack_from("<I", data)[0] != _MAGIC:
            raise FileFormatError(f"{path}: not a GLB file")
        version, end = struct.unpack_from("<II", data, 4)
        if version != _VERSION:
            raise FileFormatError(f"{path}: GLB version {version}; only 2 is read")
        chunks, at = {}, 12
        while at + 8 <= len(data) and (at < end or _JSON not in chunks):
            length, kind = struct.unpack_from("<II", data, at)
            if at + 8 + length > len(data):
                raise FileFormatError(f"{path}: the file is cut off")
            chunks.setdefault(kind, data[at + 8 : at + 8 + length])
            at += 8 + length + -length % 4
        try:
            # It should end in spaces, but some writers fill up with zeros, as the other chunk does.
            document = json.loads(
                chunks[_JSON].rstrip(b"\0"), parse_float=_finite, parse_constant=_finite
            )
        except _NotFiniteError as error:
            raise FileFormatError(
                f"{path}: has numbers that are not finite ({error}); repair the mesh first"
            ) from error
        except (KeyError, ValueError, RecursionError) as error:
            raise FileFormatError(f"{path}: damaged, its JSON cannot be read") from error
        if not isinstance(document, dict):
            raise FileFormatError(f"{path}: damaged, its JSON is not a document")
        glb = cls(path, document)
        try:
            glb._require_lists()
            glb._require_plain()
            glb._gather(chunks.get(_BIN, b""))
        except DAMAGE as error:
            raise FileFormatError(
                f"{path}: damaged, its JSON is no glTF document ({error})"
            ) from error
        return glb

    def to_bytes(self) -> bytes:
        """The GLB file.

        Raises:
            FileFormatError: If the document is nested too deep.
        """
        self.document["buffers"] = self._buffers()
        try:
            text = json.dumps(self.document, separators=(",", ":"), allow_nan=False).encode()
        except RecursionError as error:  # What was read may be nested just too deep to be written.
            raise FileFormatError(f"{self.path}: its JSON is nested too deep") from error
        text += b" " * (-len(text) % 4)
        blob = bytes(self._blob) + bytes(-len(self._blob) % 4)
        chunks = struct.pack("<II", len(text), _JSON) + text
        if blob:
            chunks += struct.pack("<II", len(blob), _BIN) + blob
        return struct.pack("<III", _MAGIC, _VERSION, 12 + len(chunks)) + chunks

    def write(self, path: Path) -> None:
        """Write a `.glb` file, whole or not at all.

        Raises:
            OutputError: If it cannot be written.
        """
        data = self.to_bytes()
        with whole_file(path) as temporary:
            temporary.write_bytes(data)

    def items(self, kind: str) -> list[dict[str, Any]]:
        """A list of the document, such as `meshes`; adding to it changes the document."""
        return self.document.setdefault(kind, [])

    def item(self, kind: str, index: Any) -> dict[str, Any]:
        """An entry of such a list.

        Raises:
            FileFormatError: If there is none of that index.
        """
        entries = self.document.get(kind, [])
        if type(index) is not int or not 0 <= index < len(entries):
            raise FileFormatError(f"{self.path}: damaged, there is no {index} among its {kind}")
        return entries[index]

    def type_of(self, accessor: int) -> np.dtype[Any]:
        """The type that an accessor's values are stored in; KeyError if glTF has no such type."""
        return np.dtype(_DTYPES[self.item("accessors", accessor)["componentType"]])

    def stored(self, accessor: int) -> AnyArray:
        """Values `[count, components]` of an accessor, of the type they are stored in.

        Raises:
            FileFormatError: If it reaches beyond the file, or is of an unknown type.
        """
        entry = self.item("accessors", accessor)
        try:
            dtype, width = self.type_of(accessor), _COMPONENTS[entry["type"]]
            count = whole(entry, "count")
            if "bufferView" in entry:
                values = self._viewed(entry, dtype, count, width).copy()
            elif count * width * dtype.itemsize <= max(len(self._blob), 1):
                values = np.zeros((count, width), dtype)
            else:
                raise ValueError("too many values")
            if sparse := entry.get("sparse"):
                self._scatter(values, sparse)
        except DAMAGE as error:
            raise FileFormatError(
                f"{self.path}: damaged, accessor {accessor} cannot be read ({error})"
            ) from error
        return values

    def array(self, accessor: int) -> AnyArray:
        """Values `[count, components]` of an accessor as float64, normalised if it says so.

        Raises:
            FileFormatError: If it reaches beyond the file, or is of an unknown type.
        """
        values = self.stored(accessor)
        if self.item("accessors", accessor).get("normalized") and values.dtype.kind in "iu":
            return np.maximum(values / np.iinfo(values.dtype).max, -1.0)
        return values.astype(np.float64)

    def add_array(self, values: AnyArray, like: int | None = None, *, bounds: bool = False) -> int:
        """Store `[count, components]`; the accessor is returned.

        Args:
            values: float32, or integers of a type glTF has.
            like: An accessor whose type, name and extras are taken over.
            bounds: Record least and greatest values, as positions need them.

        Raises:
            ValueError: If bounds are not finite.
        """
        kind = next(code for code, name in _DTYPES.items() if np.dtype(name) == values.dtype)
        shape = next(name for name, width in _COMPONENTS.items() if width == values.shape[1])
        original = dict(self.item("accessors", like)) if like is not None else {}
        for lost in ("byteOffset", "sparse", "min", "max"):
            original.pop(lost, None)
        # Vertices have to begin on multiples of four bytes.
        size = values.shape[1] * values.dtype.itemsize
        padded = np.zeros((len(values), size + -size % 4), np.uint8)
        padded[:, :size] = np.ascontiguousarray(values).view(np.uint8).reshape(len(values), size)
        view = self.add_bytes(padded.tobytes())
        if size % 4:
            self.items("bufferViews")[view]["byteStride"] = padded.shape[1]
        entry = {"componentType": kind, "type": shape, **original,
                 "bufferView": view, "count": len(values)}  # fmt: skip
        if bounds:
            if not np.isfinite(values).all():
                raise ValueError("positions that are not finite")
            entry |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        self.items("accessors").append(entry)
        return len(self.items("accessors")) - 1

    def add_bytes(self, data: bytes) -> int:
        """Store bytes; the buffer view is returned."""
        self._blob += bytes(-len(self._blob) % 4)
        view = {"buffer": 0, "byteOffset": len(self._blob), "byteLength": len(data)}
        self._blob += data
        self.items("bufferViews").append(view)
        return len(self.items("bufferViews")) - 1

    def bytes_of(self, view: int) -> bytes:
        """What a buffer view holds.

        Raises:
            FileFormatError: If it reaches beyond the file.
        """
        start, length = self._extent(view, len(self._blob))
        return bytes(self._blob[start : start + length])

    def picture(self, index: int) -> bytes:
        """The file of a picture that is in this one.

        Raises:
            FileFormatError: If it is in a file of its own, or reaches beyond this one.
        """
        entry = self.item("images", index)
        if "bufferView" in entry:
            return self.bytes_of(entry["bufferView"])
        return self._embedded(entry["uri"])

    def drop_extension(self, name: str) -> None:
        """No longer list an extension that nothing uses any more."""
        for listed in ("extensionsUsed", "extensionsRequired"):
            if name in self.document.get(listed, []):
                self.document[listed] = [kept for kept in self.document[listed] if kept != name]

    def _viewed(
        self, entry: dict[str, Any], dtype: np.dtype[Any], count: int, width: int
    ) -> AnyArray:
        """Values in the buffer view that an entry names, from its offset on."""
        data, offset = self.bytes_of(entry["bufferView"]), whole(entry, "byteOffset", 0)
        row = dtype.itemsize * width
        stride = whole(self.item("bufferViews", entry["bufferView"]), "byteStride", 0) or row
        if count < 1 or stride < row or offset + (count - 1) * stride + row > len(data):
            raise ValueError("out of its buffer")
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))

    def _scatter(self, values: AnyArray, sparse: dict[str, Any]) -> None:
        """Put the few values in that differ from the rest."""
        count, kind = whole(sparse, "count"), np.dtype(_DTYPES[sparse["indices"]["componentType"]])
        if kind.kind != "u":
            raise ValueError("sparse indices of another type than unsigned numbers")
        rows = self._viewed(sparse["indices"], kind, count, 1)
        values[rows[:, 0]] = self._viewed(sparse["values"], values.dtype, count, values.shape[1])

    def _buffers(self) -> list[dict[str, Any]]:
        first = dict(next(iter(self.document.get("buffers", [])), {}))
        return [{**first, "byteLength": len(self._blob)}] if self._blob else []

    def _extent(self, view: int, size: int) -> tuple[int, int]:
        """Where a buffer view begins in a buffer of `size` bytes, and its length."""
        entry = self.item("bufferViews", view)
        try:
            start, length = whole(entry, "byteOffset", 0), whole(entry, "byteLength")
            if start + length > size:
                raise ValueError("out of the file")
        except DAMAGE as error:
            raise FileFormatError(f"{self.path}: damaged, buffer view {view}: {error}") from error
        return start, length

    def _embedded(self, uri: str) -> bytes:
        """What a URI holds that is no address but the data themselves.

        Reference: RFC 2397.
        """
        head, _, text = uri.partition(",")
        if not head.startswith("data:"):
            raise FileFormatError(
                f"{self.path}: has data outside the file ({uri}); export it as one GLB file"
            )
        data = unquote_to_bytes(text)
        return (
            base64.b64decode(data + b"=" * (-len(data) % 4)) if head.endswith(";base64") else data
        )

    def _gather(self, chunk: bytes) -> None:
        """Put all buffers into one block."""
        buffers = self.document.get("buffers", [])
        parts = [self._embedded(b["uri"]) if "uri" in b else b"" for b in buffers]
        if buffers and "uri" not in buffers[0]:
            parts[0] = chunk
        starts = []
        for part in parts:
            self._blob += bytes(-len(self._blob) % 8)
            starts.append(len(self._blob))
            self._blob += part
        for view, entry in enumerate(self.document.get("bufferViews", [])):
            buffer = whole(entry, "buffer", 0)
            if buffer:
                start, _ = self._extent(view, len(parts[buffer]))
                entry |= {"buffer": 0, "byteOffset": starts[buffer] + start}
        if buffers:
            first = {key: value for key, value in buffers[0].items() if key != "uri"}
            self.document["buffers"] = [first]

    def _require_lists(self) -> None:
        """Refuse a document whose lists are no lists of entries."""
        for kind in _LISTS:
            entries = self.document.get(kind, [])
            if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
                raise ValueError(f"its `{kind}` should be a list of entries")

    def _require_plain(self) -> None:
        """Refuse data that meshopt compressed; where plain ones stand beside them, keep those."""
        required = self.document.get("extensionsRequired", [])
        for name in _MESHOPT:
            if name in required:
                raise FileFormatError(
                    f"{self.path}: its meshes are compressed ({name}), which is not read; export "
                    "it without that, or with Draco"
                )
            for entry in self.document.get("bufferViews", []):
                entry.get("extensions", {}).pop(name, None)
            self.drop_extension(name)


class _NotFiniteError(Exception):
    """JSON of Python's kind, with NaN and Infinity, or a number that is too large."""


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise _NotFiniteError(text)
    return value
