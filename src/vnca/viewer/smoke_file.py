"""A sequence of smoke in one small file, which a page reads a frame at a time.

The file is `vncasmk1`, the length of a header in JSON as an unsigned 32-bit number, the header, and
the frames one after the other, each a zlib stream; all numbers are little-endian. The header has

- `name`, `fps`: what to call it, and its pace;
- `lattice_to_world`, `box`: where its cells lie, as in a model file;
- `density`, `speed`: what the greatest byte of a density, and of a component of velocity, stands
  for; no speed where there is no velocity;
- `fields`: what else there is at the cells, of each its `name`, its `width` in components, and its
  `scale`, the greatest number in it; left out where there are none;
- `frames`: of each its `number`, the `offset` of its stream from the end of the header, its
  `length` in bytes, and how many `bricks` it has.

A stream has the coordinates of the bricks, counted from the brick that holds the lowest cell of the
box, three unsigned 16-bit numbers each; then densities, 512 bytes a brick; then each component of
velocity likewise; then each component of the fields, 512 signed 16-bit numbers a brick, of which
32767 stands for the scale. A density is density · (byte / 255)², a component of velocity, whose
byte is signed, speed · sign · (byte / 127)²: so thin smoke and slow motion keep their digits.
"""

import json
import math
import struct
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vnca.core import AnyArray, Box
from vnca.core.bricks import CELLS, EDGE
from vnca.core.errors import FileFormatError, SequenceError
from vnca.core.field import Field, dilated
from vnca.core.files import existing_file, whole_file
from vnca.core.lattice import Region
from vnca.core.volume import Volume

MAGIC = b"vncasmk1"
MOST_BRICKS = 2**16
"""Along an axis of the box: what a coordinate holds."""
_DENSITY_LEVELS, _SPEED_LEVELS, _FIELD_LEVELS = 255, 127, 32767
_FAR = 1
"""Cells from the smoke up to which velocity and fields are kept, as cells of rules are active."""


@dataclass(frozen=True)
class NamedField:
    """What else there is at the cells: its name, components, and the greatest number in it."""

    name: str
    width: int
    scale: float


@dataclass(frozen=True)
class Stored:
    """A frame of a file: its number, and its stream."""

    number: int
    offset: int
    length: int
    bricks: int


def write_smoke_file(
    path: Path, frames: Iterable[Volume], region: Region, *, name: str, fps: float
) -> None:
    """Write a sequence; it is gone through twice, for the scales and then for the frames.

    Args:
        path: The file.
        frames: On the lattice of the region; an iterable that can be gone through again.
        region: Where they lie.
        name: What to call it.
        fps: Frames a second.

    Raises:
        SequenceError: If there is no smoke, or its box is too large.
        OutputError: If the file cannot be written.
    """
    lower, upper = (np.asarray(corner) for corner in region.box)
    if ((upper - lower) // EDGE + 2 > MOST_BRICKS).any():
        raise SequenceError(f"{name}: its box, {region.box}, is larger than a page can show")
    density, speed, fields = _scales(frames)
    if not density:
        raise SequenceError(f"{name}: there is no smoke in any frame")
    streams, listed, offset = [], [], 0
    for smoke in frames:
        stream, bricks = _packed(smoke, region.box, density, speed, fields)
        listed.append({"number": smoke.frame, "offset": offset, "length": len(stream)})
        listed[-1]["bricks"] = bricks
        streams.append(stream)
        offset += len(stream)
    header = {
        "name": name,
        "fps": fps,
        "lattice_to_world": region.lattice.to_world.tolist(),
        "box": region.box,
        "density": density,
        "speed": speed,
        "frames": listed,
        **({"fields": [asdict(field) for field in fields]} if fields else {}),
    }
    written = json.dumps(header).encode()
    with whole_file(path) as temporary, temporary.open("wb") as file:
        file.write(MAGIC + struct.pack("<I", len(written)) + written)
        file.writelines(streams)


def _scales(frames: Iterable[Volume]) -> tuple[float, float, list[NamedField]]:
    """The greatest density, component of velocity, and number of each field."""
    density = speed = 0.0
    fields: dict[str, NamedField] = {}
    for smoke in frames:
        density = max(density, float(smoke.density_field.values.max(initial=0)))
        if smoke.velocity_field is not None:
            speed = max(speed, float(np.abs(smoke.velocity_field.values).max(initial=0)))
        for name, field in smoke.named_fields.items():
            scale = float(np.abs(field.values).max(initial=0))
            before = fields.get(name, NamedField(name, math.prod(field.values.shape[4:]), 0.0))
            fields[name] = replace(before, scale=max(before.scale, scale))
    return density, speed, list(fields.values())


def _packed(
    smoke: Volume, box: Box, density: float, speed: float, fields: Sequence[NamedField]
) -> tuple[bytes, int]:
    """A frame's stream, and how many bricks are in it."""
    first = np.array(box.lower) // EDGE
    given = smoke.density_field
    levels = np.rint(_DENSITY_LEVELS * np.sqrt(np.maximum(given.values, 0) / density))
    levels = replace(given, values=levels.astype(np.uint8), outside=np.uint8(0)).within(box)
    near = dilated(replace(levels, values=levels.values > 0, outside=False).trimmed(), _FAR)
    bricks = near.bricks
    parts = [(bricks - first).astype("<u2").tobytes(), levels.blocks(bricks).tobytes()]
    if speed:
        motion = smoke.velocity_field
        moved = np.zeros((len(bricks), EDGE, EDGE, EDGE, 3), np.int8)
        if motion is not None:
            values = motion.blocks(bricks) * near.values[..., None]
            steps = np.rint(_SPEED_LEVELS * np.sqrt(np.abs(values) / speed))
            moved = (np.sign(values) * steps).astype(np.int8)
        parts += [np.ascontiguousarray(moved[..., axis]).tobytes() for axis in range(3)]
    for told in fields:
        parts += _components(told, smoke.named_fields.get(told.name), near)
    return zlib.compress(b"".join(parts), 9), len(bricks)


def _components(told: NamedField, field: Field | None, near: Field) -> Iterator[bytes]:
    """Each component of a field near the smoke."""
    count = len(near.bricks)
    levels = np.zeros((count, EDGE, EDGE, EDGE, told.width), "<i2")
    if field is not None and told.scale:
        values = field.blocks(near.bricks).reshape(levels.shape) * near.values[..., None]
        levels = np.rint(_FIELD_LEVELS / told.scale * values).astype("<i2")
    for k in range(told.width):
        yield np.ascontiguousarray(levels[..., k]).tobytes()


class SmokeFile:
    """A file that `write_smoke_file` wrote.

    Attributes:
        header: As it is written.
        fields: What there is beside density and velocity.
        frames: What is stored of each.
    """

    def __init__(self, path: Path) -> None:
        """Read the header.

        Raises:
            FileFormatError: If it is not such a file.
        """
        self._path = existing_file(path)
        data = self._path.read_bytes()
        if data[:8] != MAGIC or len(data) < 12:
            raise FileFormatError(f"{path}: not a sequence for the page of vnca")
        end = 12 + struct.unpack("<I", data[8:12])[0]
        try:
            self.header: dict[str, Any] = json.loads(data[12:end])
            self.frames = [Stored(**each) for each in self.header["frames"]]
            self.fields = [NamedField(**each) for each in self.header.get("fields", [])]
        except (ValueError, TypeError, KeyError) as error:
            raise FileFormatError(f"{path}: damaged header ({error})") from error
        self._streams = data[end:]

    def volumes(self) -> Iterator[Volume]:
        """The frames, as the page has them: rounded to bytes.

        Raises:
            FileFormatError: If a frame is damaged.
        """
        header = self.header
        (x, y, z), (u, v, w) = header["box"]
        box = Box((x, y, z), (u, v, w))
        for frame in self.frames:
            stream = self._streams[frame.offset : frame.offset + frame.length]
            components = sum(field.width for field in self.fields)
            planes = 4 if header["speed"] else 1
            size = frame.bricks * (6 + CELLS * (planes + 2 * components))
            try:
                data = np.frombuffer(zlib.decompress(stream, bufsize=size), np.uint8)
            except zlib.error as error:
                raise FileFormatError(f"{self._path}: frame {frame.number}: {error}") from error
            if len(data) != size:
                raise FileFormatError(f"{self._path}: frame {frame.number} is damaged")
            yield self._volume(frame, data, box)

    def _volume(self, frame: Stored, data: AnyArray, box: Box) -> Volume:
        count, header = frame.bricks, self.header
        lowest = np.array(box.lower) // EDGE
        bricks = data[: 6 * count].view("<u2").reshape(-1, 3).astype(np.int32) + lowest
        bricks = bricks.astype(np.int32)
        planes = 4 if header["speed"] else 1
        end = count * (6 + planes * CELLS)
        cells = data[6 * count : end].reshape(planes, count, EDGE, EDGE, EDGE)
        parts = np.square(cells[0].astype(np.float32) / np.float32(_DENSITY_LEVELS))
        density = Field(bricks, np.float32(header["density"]) * parts, box)
        motion = None
        if header["speed"]:
            part = cells[1:].view(np.int8).astype(np.float32) / np.float32(_SPEED_LEVELS)
            part = np.float32(header["speed"]) * part * np.abs(part)
            motion = Field(bricks, np.ascontiguousarray(part.transpose(1, 2, 3, 4, 0)), box)
        to_world = np.array(header["lattice_to_world"])
        levels = data[end:].view("<i2").reshape(-1, count, EDGE, EDGE, EDGE)
        fields, first = {}, 0
        for told in self.fields:
            part = levels[first : first + told.width].astype(np.float32) / _FIELD_LEVELS
            values = np.moveaxis(np.float32(told.scale) * part, 0, -1)
            held = values[..., 0] if told.width == 1 else np.ascontiguousarray(values)
            fields[told.name] = Field(bricks, held, box)
            first += told.width
        return Volume.of_fields(density, motion, to_world, frame.number, fields)
