"""Arrays larger than a shader binds at once: whole rows in several buffers, read as one array."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import OutOfMemoryError
from vnca.engine.wgsl import device
from vnca.engine.wgsl.device import Buffer


@dataclass(frozen=True)
class Layout:
    """How rows lie in buffers.

    Attributes:
        count: How many rows there are.
        width: Bytes a row.
        each: Rows in each buffer but the last.
    """

    count: int
    width: int
    each: int

    @classmethod
    def of(cls, count: int, width: int, *, beside: int = 0) -> "Layout":
        """As few parts as can be bound, also of rows of so many bytes beside these."""
        each = max(device.binding_bytes() // max(width, beside), 1)
        return cls(count, width, each)

    @property
    def parts(self) -> int:
        """How many buffers there are; one at least."""
        return max(-(-self.count // self.each), 1)

    def declared(self, name: str, element: str, first: int, *, width: str = "") -> str:
        """The bindings in WGSL, and a function `NAME_at` that reads an element.

        Its arguments are the row and, where there is a width, the place of the element in it.

        Args:
            name: Of the array.
            element: Type of its elements.
            first: Number of the first binding, in group 0.
            width: Elements of a row, in WGSL; none where a row is one element.
        """
        row = "row" if self.parts == 1 else f"row % {self.each}u"
        at, place = (f"({row}) * {width} + place", ", place: u32") if width else (row, "")
        lines = [
            f"@group(0) @binding({first + part}) "
            f"var<storage, read> {name}_{part}: array<{element}>;"
            for part in range(self.parts)
        ]
        lines += [f"fn {name}_at(row: u32{place}) -> {element} {{", f"  let at = {at};"]
        lines += [
            f"  if (row >= {part * self.each}u) {{ return {name}_{part}[at]; }}"
            for part in range(self.parts - 1, 0, -1)
        ]
        return "\n".join([*lines, f"  return {name}_0[at];", "}", ""])


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of numbers on the device.

    Attributes:
        layout: How they lie.
        buffers: What holds them, in their order.
    """

    layout: Layout
    buffers: tuple[Buffer, ...]

    @classmethod
    def of(cls, array: AnyArray, each: int | None = None) -> "Rows":
        """An array on the device, by its first axis; so many rows a part, or as many as can be."""
        width = array.itemsize * math.prod(array.shape[1:])
        layout = Layout.of(len(array), width)
        layout = layout if each is None else replace(layout, each=each)
        begins = range(0, layout.parts * layout.each, layout.each)
        return cls(layout, tuple(Buffer.of(array[at : at + layout.each]) for at in begins))

    def blank(self) -> "Rows":
        """As many rows of zeros, in the same parts."""
        return Rows(self.layout, tuple(Buffer.empty(buffer.size) for buffer in self.buffers))

    def read(self, kind: Any) -> AnyArray:
        """The numbers as a flat array of a type."""
        return np.concatenate([buffer.read(kind) for buffer in self.buffers])

    def bindings(self, first: int) -> dict[int, Buffer]:
        """The buffers by the numbers of their bindings, from the first on."""
        return {first + part: buffer for part, buffer in enumerate(self.buffers)}


def require_bindings(count: int) -> None:
    """Raise `OutOfMemoryError` if a shader may not bind so many arrays."""
    most = device.device().limits["max-storage-buffers-per-shader-stage"]
    if count > most:
        size = f"{device.binding_bytes() / 2**20:.3g} MiB"
        raise OutOfMemoryError(
            f"backend wgsl: arrays in {count} parts of {size}, and {device.name()} binds at most "
            f"{most}; paint at a lower `refine`, or use another backend"
        )
