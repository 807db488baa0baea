"""From the axes and the world of a file to ours, where up is +z, and onto a lattice.

A file's world with y up is turned: ours is (x, y, z) = its (z, x, y), a rotation without flips. Its
cells keep their places in it, but are counted along our axes: in a file whose index axes are
exchanged or mirrored, too, cells go to the right, back and up. Writers go the same way back.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Literal, TypeAlias

from vnca.core.lattice import Lattice, Placement, upright_turn
from vnca.core.typing import AnyArray
from vnca.core.volume import Volume

UpAxis: TypeAlias = Literal["z", "y"]

# For each axis of our world, the file's.
_WORLD_AXES: dict[UpAxis, list[int]] = {"z": [0, 1, 2, 3], "y": [2, 0, 1, 3]}


def upright_world(index_to_world: AnyArray, up: UpAxis) -> AnyArray:
    """4×4, from a file's cells to the world, where `up` points up there and +z does here."""
    return index_to_world[_WORLD_AXES[up]]


def own_cells(index_to_world: AnyArray, what: str) -> tuple[Placement, AnyArray]:
    """How a grid's own cells are counted along our axes, and their 4×4 `index_to_world`.

    Args:
        index_to_world: 4×4, from the grid's cells to our world.
        what: What a message calls it.
    """
    turn = upright_turn(index_to_world)
    return Placement(turn.T, True, what), index_to_world @ turn


def on_lattice(smoke: Volume, lattice: Lattice, what: str) -> Volume:
    """A frame on the cells of a lattice, to which its own are moved or its smoke interpolated.

    Velocity is in cells per frame of the lattice then. Smoke fades over a cell into what its box
    leaves out, as in OpenVDB; velocity goes on as at the border.

    Args:
        smoke: The frame.
        lattice: The lattice.
        what: What a message calls the frame.

    Raises:
        GridError: If its axes are not at right angles, or it takes too many cells.
    """
    if smoke.box.is_empty:
        return replace(smoke, origin=(0, 0, 0), index_to_world=lattice.to_world)
    place = Placement.between(smoke.index_to_world, lattice.to_world, smoke.box, what)
    over = place.box(smoke.box)
    velocity = smoke.velocity_field
    if velocity is not None:
        velocity = place.field(velocity, over, "nearest")
        velocity = replace(velocity, values=place.vectors(velocity.values))
    density = place.field(smoke.density_field, over)
    return Volume.of_fields(density, velocity, lattice.to_world, smoke.frame)


def on_one_lattice(frames: Iterable[Volume]) -> Iterator[Volume]:
    """Frames on the lattice of the first that has smoke, whose cells must be cubic.

    Raises:
        GridError: If they are not, or a frame can have no place on them.
    """
    lattice = None
    for smoke in frames:
        what = f"frame {smoke.frame}"
        if lattice is None and not smoke.box.is_empty:
            lattice = Lattice.as_it_is(smoke.index_to_world, what)
        yield smoke if lattice is None else on_lattice(smoke, lattice, what)
