"""From what a rule painted, place by place, to the fields of a painted frame."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.field import Field
from vnca.core.volume import Volume, dense, field_of
from vnca.direction import Direction, Moment
from vnca.direction.colour import Editing
from vnca.direction.mixing import Parts, per_colour
from vnca.direction.silhouette import masses, of_mass, total
from vnca.io.velocity import extrapolated

if TYPE_CHECKING:
    from vnca.painting.state import RollState

UNPAINTED = 1.0
"""Linear colour of smoke far from all that the rule paints: white."""
COLOUR_DILATION = 3
"""How many cells beyond the active ones their colour goes on, so that faint smoke is no pale seam
where a renderer interpolates it."""


@dense("density", "colour", what=lambda painting: f"frame {painting.smoke.frame}")
@dataclass(frozen=True, eq=False)
class Painting:
    """One painted frame, on the same cells as its smoke.

    Attributes:
        smoke: The frame as it was read, on the grid of the painting.
        density: `[x, y, z]`, painted, in the units of the file; the array is made when it is asked
            for, as the smoke's is.
        colour: Likewise, linear RGB `[x, y, z, 3]`; beside the active cells continued from them,
            white farther away.
        state: What it leaves to the next frame.
        coarse: The frame on the grid of the automaton; None where that is not known.
        emission: The light that it gives, linear RGB `[x, y, z, 3]`, where any was asked for.
    """

    smoke: Volume
    density: FloatArray
    colour: FloatArray
    state: "RollState"
    coarse: Volume | None = None
    emission: Field | None = None

    @classmethod
    def of_fields(
        cls,
        smoke: Volume,
        density: Field,
        colour: Field,
        state: "RollState",
        coarse: Volume,
        emission: Field | None = None,
    ) -> "Painting":
        """A painting given by where there is smoke and colour."""
        painted: Any = density
        coloured: Any = colour
        return cls(smoke, painted, coloured, state, coarse, emission)

    @cached_property
    def density_field(self) -> Field:
        """The density where there is any."""
        return field_of(self, "density", self.smoke.origin)

    @cached_property
    def colour_field(self) -> Field:
        """The colour where it is not white."""
        return field_of(self, "colour", self.smoke.origin, outside=UNPAINTED)


def composed(
    smoke: Volume,
    parts: Parts,
    direction: Direction,
    moment: Moment,
    places: Callable[[AnyArray], AnyArray],
    editing: Editing,
    *,
    reach: int,
    mass: tuple[float, float] | None = None,
) -> tuple[Field, Field, Field | None]:
    """Density, colour and, if anything burns, light of a frame.

    Args:
        smoke: The frame, on the grid of the painting.
        parts: What was painted on that grid.
        direction: What is asked of the painting.
        moment: The frame, as it is asked about.
        places: Where points of that grid lie in index coordinates of the moment's smoke.
        editing: What is done with colours as a whole.
        reach: How many cells beyond what was painted its colour goes on.
        mass: The smoke in all, as painted and before, if the frame is but a part.
    """
    box = smoke.box
    # Unsigned, what lies below the box is above it.
    steps = (parts.at - np.array(box.lower, np.int32)).astype(np.uint32)
    inside = (steps < np.array(box.shape, np.uint32)).all(axis=1)
    at, colour, factors = parts.at[inside], parts.colour[inside], parts.factors[inside]
    there = places(at)
    colour = direction.coloured(colour, moment, there, editing)
    strength = per_colour(direction.value("strength", moment, there))
    colour = UNPAINTED + strength * (colour - UNPAINTED)
    factors = direction.outlined(factors, moment, there)
    known = np.ones(len(at), bool)
    fields = ((colour, UNPAINTED), (factors, 1.0), (known, False))
    colour, factors, painted = Field.all_from_cells(at, box, *fields)
    colour = _continued(colour, painted, reach)
    before = smoke.density_field
    density = replace(before, values=before.values * factors.blocks(before.bricks))
    density, colour = direction.fluffed(density, colour, factors, moment, places)
    if direction.keep_mass:
        now, was = mass or (total(masses(density)), total(masses(before)))
        density = replace(density, values=of_mass(density, now, was))
    light = None
    if direction.burns:
        light = Field.from_cells(at, direction.emission(moment, there), box, outside=0.0)
        light = _continued(light, painted, reach)
    return density, colour, light


def _continued(field: Field, known: Field, reach: int) -> Field:
    """Known vectors going on for some cells around; what the field has outside farther away."""
    wide, known = extrapolated(field, known, reach)
    wide.values[~known.values] = field.outside
    return replace(wide, outside=field.outside)
