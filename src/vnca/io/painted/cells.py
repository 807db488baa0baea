"""The cells of a painted frame: from those that were painted to those of its file."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vnca.core import AnyArray
from vnca.core.errors import ShapeError
from vnca.core.field import Field, dilated, divided
from vnca.core.lattice import Lattice, Placement
from vnca.core.volume import Volume, refined_transform
from vnca.io.smoke_format import UpAxis, on_lattice, own_cells, upright_world
from vnca.io.vdb import VALUE_TYPES, Grid, Transform
from vnca.io.velocity import extrapolated

_HALF_MOST = float(np.finfo(np.float16).max)


def finer(of_file: Transform, refine: int) -> Transform:
    """The transform of painted cells; `of_file` is that of the file's."""
    if refine == 1:
        return of_file
    return Transform.from_matrix(refined_transform(of_file.index_to_world, refine))


class Stored(NamedTuple):
    """What a file is to store of a painting: values, and where they are active.

    Attributes:
        density: In the file's type.
        colours: By their names.
    """

    density: tuple[Field, Field]
    colours: dict[str, tuple[Field, Field]]


@dataclass(frozen=True, eq=False)
class PaintedCells:
    """What was painted, and where its cells lie.

    Attributes:
        density: Of cells `refine` times as fine as those of the lattice.
        colours: Of the same cells, each under the name that it gets.
        lattice: None for those of the source, along our axes.
        up: Which axis of the source's world points up.
        refine: How fine they are.
        beyond: How many cells around those of the source there may be smoke.
    """

    density: Field
    colours: Mapping[str, Field]
    lattice: Lattice | None
    up: UpAxis
    refine: int
    beyond: int

    def in_file(
        self, transform: Transform, density: Field, what: str
    ) -> tuple[Field, dict[str, Field]]:
        """Density and colours of the file's cells, or as fine ones.

        Args:
            transform: Of the file's cells.
            density: Theirs before they were painted, as the file has it.
            what: What a message calls them.

        Raises:
            ShapeError: If some of them were not painted.
        """
        world, cells = upright_world(transform.index_to_world, self.up), density.box
        ours = own_cells(world, what)[1]
        if self.lattice is not None and not cells.is_empty:
            ours = self.lattice.to_world
        needed = Placement.between(world, ours, cells, what).box(cells).refined(self.refine)
        painted = self.density.box
        if painted.union(needed) != painted:
            raise ShapeError(f"{what}: smoke in {needed}, but only {painted} was painted")
        over = cells.refined(self.refine)
        if not over.is_empty:
            over = over.grown(self.beyond)
        source, target = (refined_transform(matrix, self.refine) for matrix in (world, ours))
        back = Placement.between(source, target, over, what).inverse
        # Of a colour that has several names there is one field.
        named = {id(colour): colour for colour in self.colours.values()}
        moved = {key: back.field(colour, over, "nearest") for key, colour in named.items()}
        colours = {name: moved[id(colour)] for name, colour in self.colours.items()}
        if back.is_whole or self.beyond:
            return back.field(self.density, over), colours
        positive = np.maximum(density.values.astype(np.float32), 0)
        plain = Volume.of_fields(replace(density, values=positive), None, world, 0)
        change = self._change(on_lattice(plain, Lattice(ours), what).refined(self.refine))
        # Of what is nothing everywhere, nothing comes of interpolation.
        change = back.field(change, over, "nearest")
        finer = plain.refined(self.refine).density_field
        return replace(finer, values=finer.values * (1 + change.blocks(finer.bricks))), colours

    def active(self, density: Field, of_file: Field, background: AnyArray | float = 0) -> Field:
        """Which cells to store; `of_file` are active in the file."""
        if self.refine == 1 and not self.beyond:
            return of_file
        dense = replace(density, values=density.values != 0, outside=False).trimmed()
        # A cell that is not stored would not be empty.
        keeps = background or self.refine == 1
        return dense.union(divided(of_file, self.refine)) if keeps else dense

    def stored(self, old: Grid, before: Field, active: Field, what: str) -> "Stored":
        """What a VDB file is to store, of the kind of its density.

        Args:
            old: The density of the source, or a part of it.
            before: Its values.
            active: Its active cells.
            what: What a message calls it.
        """
        density, colours = self.in_file(old.transform, before, what)
        active = self.active(density, active, old.tree.background)
        colours, coloured = with_rim(colours, active)
        dtype = VALUE_TYPES[old.value_type].dtype
        if dtype.kind != "f":
            dtype = np.dtype(np.float32)
        if old.is_half or dtype.itemsize == 2:
            density = _as_half(density)
            colours = {name: _as_half(colour) for name, colour in colours.items()}
        density = replace(density, values=density.values.astype(dtype))
        return Stored(
            (density, active), {name: (colour, coloured) for name, colour in colours.items()}
        )

    def _change(self, plain: Volume) -> Field:
        """What the painting multiplied the density by, less 1; 0 where there was none."""
        before = plain.density_field
        factor, painted = np.ones_like(before.values), self.density.blocks(before.bricks)
        np.divide(painted, before.values, out=factor, where=before.values > 0)
        return Field(before.bricks, factor - 1, self.density.box)


def with_rim(colours: Mapping[str, Field], active: Field) -> tuple[dict[str, Field], Field]:
    """Colours that go on for a cell around the smoke, and the cells that have one.

    Renderers interpolate density and colour one by one: beside black, the border of opaque smoke
    would be dark.
    """
    box = active.box.grown(1)
    active = replace(active, box=box)
    # A cell at a corner is three steps away.
    wide = {n: extrapolated(replace(c, box=box), active, 3)[0] for n, c in colours.items()}
    return wide, dilated(active, 1)


def _as_half(field: Field) -> Field:
    """Values that a half float can hold."""
    return replace(field, values=np.clip(field.values, -_HALF_MOST, _HALF_MOST))
