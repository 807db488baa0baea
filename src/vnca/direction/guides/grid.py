"""A grid of vectors as a guide."""

from dataclasses import dataclass

import numpy as np

from vnca.core import AnyArray
from vnca.direction.guides import unit
from vnca.direction.masks.grids import require_grid, stored_vectors
from vnca.direction.mixing import Answer
from vnca.direction.moment import Inputs, Moment
from vnca.direction.values import Value


@dataclass(frozen=True)
class VectorGrid(Value):
    """A grid of vectors that the frame has, or its file: directions of the file's world."""

    name: str

    def at(self, moment: Moment, places: AnyArray) -> Answer:
        """See `Value.at`."""
        components = stored_vectors(moment, self.name)
        if components is None or not len(places):
            return np.zeros((len(places), 3), np.float32)
        vectors = np.stack([each.at(moment, places) for each in components], axis=1)
        return unit(moment.in_cells(vectors))

    def require(self, inputs: Inputs) -> None:
        """Refuse a grid that frames lack, as their headers tell.

        Raises:
            GridError: If a frame lacks it, or all do; or it holds no vectors.
            FileFormatError: If a file cannot be read.
        """
        require_grid(inputs, inputs.paths, self.name, vectors=True)
