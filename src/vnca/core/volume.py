"""One frame of smoke, whatever file it came from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from vnca.core import AnyArray, Box, FloatArray, Index
from vnca.core.errors import ShapeError
from vnca.core.field import Field, refined

T = TypeVar("T")


def dense(*names: str, what: Callable[[Any], str]) -> Callable[[type[T]], type[T]]:
    """A decorator for dataclasses: what some attributes hold may be fields.

    Read, those are arrays all the same, each made the first time; `field_of` gives the field.

    Args:
        names: Of the attributes.
        what: What a message calls an instance whose arrays are too large.
    """

    def decorated(kind: type[T]) -> type[T]:
        for name in names:
            setattr(kind, name, _Dense(name, what))
        return kind

    return decorated


def field_of(instance: object, name: str, origin: Index, *, outside: float = 0) -> Any:
    """What such an attribute holds, as a field; None where that is what it holds.

    Args:
        instance: Whose attribute.
        name: Its name.
        origin: Index coordinates of the first cell, if it is an array.
        outside: The most frequent value, if it is an array.
    """
    held = instance.__dict__[name]
    if held is None or isinstance(held, Field):
        return held
    return Field.from_dense(held, origin, outside=outside)


def shape_of(instance: object, name: str) -> tuple[int, ...] | None:
    """The shape of such an attribute, which is not made an array for that; None of None."""
    held = instance.__dict__[name]
    return None if held is None else held.shape


class _Dense:
    def __init__(self, name: str, what: Callable[[Any], str]) -> None:
        self._name = name
        self._what = what

    def __get__(self, instance: Any, owner: type) -> Any:
        if instance is None:
            return self
        held = instance.__dict__[self._name]
        if not isinstance(held, Field):
            return held
        made = f"{self._name} as an array"
        if made not in instance.__dict__:
            instance.__dict__[made] = held.dense(what=self._what(instance))
        return instance.__dict__[made]

    def __set__(self, instance: Any, value: Any) -> None:
        instance.__dict__[self._name] = value


@dense("density", "velocity", what=lambda smoke: f"frame {smoke.frame}")
@dataclass(frozen=True, eq=False)
class Volume:
    """Density and velocity on a grid, up along +z.

    Both are arrays of all cells of a box. Smoke from files is kept as fields instead, which take
    the memory that the smoke takes, however large its box is (`density_field`, `velocity_field`);
    the arrays are made when they are asked for, and a box of far more cells than there is smoke
    in it is refused then (`GridError`).

    Attributes:
        density: `[x, y, z]`, non-negative, in the units of its file.
        velocity: `[x, y, z, 3]` at cell centres, cells per frame, or None where the file has none.
        origin: Index coordinates of cell `[0, 0, 0]`; anchors the frame in its sequence.
        index_to_world: 4×4, `world = index_to_world @ (i, j, k, 1)` for cell centres. The world is
            the file's, turned so that up is +z where it is another axis.
        frame: Frame number in its sequence.
        fields: What else there is at the cells, by name, such as a temperature: numbers, each an
            array `[x, y, z]` or `[x, y, z, c]`, or a field. A rule can be conditioned on them.
    """

    density: FloatArray
    velocity: FloatArray | None
    origin: Index
    index_to_world: AnyArray
    frame: int
    fields: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        density, velocity = shape_of(self, "density"), shape_of(self, "velocity")
        if density is None or len(density) != 3:
            raise ShapeError(f"density: expected [x, y, z], got shape {density}")
        if velocity is not None and velocity != (*density, 3):
            raise ShapeError(
                f"velocity: expected {(*density, 3)} to match the density, got {velocity}"
            )
        for name, values in self.fields.items():
            if values.shape[:3] != density or len(values.shape) > 4:
                raise ShapeError(
                    f"fields: {name}: expected {density} to match the density, perhaps with a last "
                    f"axis of components, got {values.shape}"
                )

    @classmethod
    def of_fields(
        cls,
        density: Field,
        velocity: Field | None,
        index_to_world: AnyArray,
        frame: int,
        fields: Mapping[str, Field] | None = None,
    ) -> "Volume":
        """Smoke given by where there is any; all fields cover one box."""
        smoke: Any = density
        motion: Any = velocity
        return cls(smoke, motion, density.origin, index_to_world, frame, fields or {})

    @property
    def box(self) -> Box:
        """The cells the arrays cover, in index space."""
        shape = shape_of(self, "density") or ()
        x, y, z = (o + n for o, n in zip(self.origin, shape, strict=True))
        return Box(self.origin, (x, y, z))

    @cached_property
    def density_field(self) -> Field:
        """The density where there is any."""
        return field_of(self, "density", self.origin)

    @cached_property
    def velocity_field(self) -> Field | None:
        """The velocity where there is any."""
        return field_of(self, "velocity", self.origin)

    @cached_property
    def named_fields(self) -> Mapping[str, Field]:
        """`fields`, each where it is not zero."""
        return {
            name: held if isinstance(held, Field) else Field.from_dense(held, self.origin)
            for name, held in self.fields.items()
        }

    @property
    def voxel_size(self) -> tuple[float, float, float]:
        """World length of a cell along x, y and z."""
        x, y, z = np.linalg.norm(self.index_to_world[:3, :3], axis=0)
        return float(x), float(y), float(z)

    @property
    def cell_length(self) -> float:
        """World length of the edge of a cube as large as a cell."""
        return length_of_cells(self.index_to_world)

    @property
    def cells_to_world(self) -> AnyArray:
        """4×4 like `index_to_world`, for cells counted from the first of the arrays."""
        matrix = self.index_to_world.copy()
        matrix[:3, 3] += matrix[:3, :3] @ self.origin
        return matrix

    def within(self, box: Box) -> "Volume":
        """The same smoke over another box, which holds its own."""
        density, velocity = self.density_field, self.velocity_field
        return Volume.of_fields(
            replace(density, box=box),
            None if velocity is None else replace(velocity, box=box),
            self.index_to_world,
            self.frame,
            {name: replace(held, box=box) for name, held in self.named_fields.items()},
        )

    def refined(self, factor: int) -> "Volume":
        """The same smoke in the same place, on a grid `factor` times as fine along each axis.

        Values are interpolated linearly between cell centres; beyond the outermost they stay. In
        cells of the finer grid velocity is `factor` times as fast.
        """
        if factor == 1:
            return self
        velocity = self.velocity_field
        if velocity is not None:
            velocity = refined(velocity, factor)
            np.multiply(velocity.values, factor, out=velocity.values)
        return Volume.of_fields(
            refined(self.density_field, factor),
            velocity,
            refined_transform(self.index_to_world, factor),
            self.frame,
            {name: refined(held, factor) for name, held in self.named_fields.items()},
        )


def length_of_cells(index_to_world: AnyArray) -> float:
    """World length of the edge of a cube as large as a cell of a 4×4 matrix."""
    return float(np.cbrt(abs(np.linalg.det(index_to_world[:3, :3]))))


def refined_transform(index_to_world: AnyArray, factor: int) -> AnyArray:
    """The 4×4 matrix of cells `factor` times as fine: cell i is centred on (i + ½)/factor − ½."""
    finer = np.diag([1 / factor, 1 / factor, 1 / factor, 1.0])
    finer[:3, 3] = 0.5 / factor - 0.5
    return index_to_world @ finer
