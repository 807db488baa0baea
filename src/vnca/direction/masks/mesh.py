"""A mesh as a value: 1 inside of it, falling to 0 outside."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vnca.core import AnyArray, BoolArray, Box
from vnca.core.errors import GridError
from vnca.core.field import MOST_CELLS, Field
from vnca.direction.distance import distances
from vnca.direction.masks.shapes import HARD, edge
from vnca.direction.mixing import Answer
from vnca.direction.moment import Inputs, Moment, between
from vnca.direction.values import Value
from vnca.io.mesh import Mesh, read_mesh

_FARTHEST = 64
"""Cells over which the edge may fall."""
_ASIDE = np.array([0.37e-5, 0.61e-5])
"""Columns are looked at a little beside their middle, where no vertex lies."""
_PAIRS_AT_ONCE = 2**22


@dataclass(frozen=True)
class Solid(Value):
    """The inside of a closed mesh, in the world of the smoke's files; still."""

    path: str
    soft: Value = HARD
    up: str = ""

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        soft = self.soft.at(moment, places)
        cell = moment.smoke.cell_length
        most = min(_FARTHEST, math.ceil(float(np.max(soft)) / cell) + 1)
        away = between(self._distances(moment, most), places)
        if most == 1:
            # Half a cell from the last centre inside is the surface.
            return np.clip(1 - away, 0, 1).astype(np.float32)
        return edge((away - 0.5) * cell, soft)

    def require(self, inputs: Inputs) -> None:
        """Refuse what cannot be read as a mesh.

        Raises:
            VncaError: If it cannot.
        """
        self._mesh(inputs)

    def files(self, inputs: Inputs) -> Iterator[Path]:
        """What it reads."""
        yield Path(self.path)

    def _mesh(self, inputs: Inputs) -> Mesh:
        key = "mesh", self.path, self.up
        if key not in inputs.kept:
            up: Any = self.up or None
            inputs.kept[key] = read_mesh(Path(self.path), up)
        return inputs.kept[key]

    def _distances(self, moment: Moment, most: int) -> Field:
        """How far cells lie from the nearest inside, in cells, up to `most`."""
        key = self, moment.box, most
        if key not in moment.inputs.kept:
            corners = np.concatenate(
                [s.points[s.faces] for s in self._mesh(moment.inputs).surfaces]
            )
            if moment.inputs.up == "y":
                corners = np.stack([-corners[..., 1], corners[..., 0], corners[..., 2]], axis=-1)
            to_cells = np.linalg.inv(moment.smoke.index_to_world)
            corners = corners @ to_cells[:3, :3].T + to_cells[:3, 3]
            box = moment.box.grown(2)
            if math.prod(box.shape) > MOST_CELLS:
                raise GridError(f"{self.path}: the smoke is scattered too far for a mesh as a mask")
            inside = inside_of(corners, box)
            far = np.where(inside, np.float32(0), np.float32(np.inf))
            whole = np.ones(box.shape, bool)
            field = Field.from_dense(far, box.lower, outside=np.float32(np.inf), held=whole)
            moment.inputs.kept[key] = distances(field, most)
        return moment.inputs.kept[key]


def inside_of(corners: AnyArray, box: Box) -> BoolArray:
    """Which cells of a box have their centre inside closed triangles, `[x, y, z]`.

    Below a centre that is inside, the surface is crossed an odd number of times.

    Args:
        corners: `[f, 3, 3]`, of each triangle, in index coordinates.
        box: The cells.
    """
    lower, (columns_x, columns_y, height) = np.array(box.lower), box.shape
    crossed = np.zeros((columns_x, columns_y, height + 1), np.int32)
    corners = corners.astype(np.float64) - lower
    corners[..., :2] -= _ASIDE
    first = np.maximum(np.ceil(corners[..., :2].min(axis=1)), 0).astype(int)
    last = np.floor(corners[..., :2].max(axis=1)).astype(int)
    last = np.minimum(last, np.array([columns_x, columns_y]) - 1)
    counts = np.maximum(last - first + 1, 0)
    pairs = counts.prod(axis=1)
    for some in np.array_split(np.arange(len(corners)), 1 + int(pairs.sum()) // _PAIRS_AT_ONCE):
        of = np.repeat(some, pairs[some])
        number = np.arange(len(of)) - np.repeat(np.cumsum(pairs[some]) - pairs[some], pairs[some])
        column = first[of] + np.stack(np.divmod(number, np.maximum(counts[of, 1], 1)), axis=-1)
        a, b, c = corners[of].transpose(1, 0, 2)
        shares = np.stack([_turn(b, c, column), _turn(c, a, column), _turn(a, b, column)], axis=-1)
        area = shares.sum(axis=-1)
        hit = ((shares > 0).all(axis=-1) | (shares < 0).all(axis=-1)) & (area != 0)
        shares, of, column = shares[hit] / area[hit, None], of[hit], column[hit]
        z = (shares * corners[of][..., 2]).sum(axis=-1)
        above = np.clip(np.ceil(z), 0, height).astype(int)
        np.add.at(crossed, (column[:, 0], column[:, 1], above), 1)
    return crossed.cumsum(axis=2)[..., :height] % 2 == 1


def _turn(a: AnyArray, b: AnyArray, p: AnyArray) -> AnyArray:
    """Twice the area of triangles seen from above, with a sign for which way they turn."""
    return (b[:, 0] - a[:, 0]) * (p[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (p[:, 0] - a[:, 0])
