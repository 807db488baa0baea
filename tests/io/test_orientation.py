import numpy as np
import pytest

from vnca.io.orientation import (
    UpAxis,
    box_to_file,
    box_to_internal,
    index_to_internal,
    matrix_to_internal,
    to_file,
    to_internal,
)
from vnca.typing import Box


def test_what_is_up_in_a_file_is_up_inside() -> None:
    density = np.zeros((3, 4, 5), np.float32)
    density[1, 3, 2] = 1  # at the top of a file with y up
    assert np.argwhere(to_internal(density, "y")).tolist() == [[2, 1, 3]]
    assert to_internal(density, "y").shape == (5, 3, 4)
    assert to_internal(density, "z").shape == (3, 4, 5)


def test_velocity_turns_with_its_grid_and_colour_does_not() -> None:
    upwards = np.broadcast_to(np.float32([0, 7, 0]), (2, 3, 4, 3))
    assert to_internal(upwards, "y", vectors=True)[0, 0, 0].tolist() == [0, 0, 7]
    assert to_internal(upwards, "y")[0, 0, 0].tolist() == [0, 7, 0]
    assert to_internal(upwards, "z", vectors=True)[0, 0, 0].tolist() == [0, 7, 0]


def test_turning_does_not_mirror() -> None:
    assert np.linalg.det(matrix_to_internal(np.eye(4), "y")) == 1


def test_a_cell_keeps_its_place_in_the_world_which_turns_with_it() -> None:
    matrix = np.random.default_rng(0).standard_normal((4, 4))
    cell = (3, -5, 8)
    inside = index_to_internal(cell, "y")
    assert inside == (8, 3, -5)
    x, y, z, one = matrix @ (*cell, 1)
    np.testing.assert_allclose(matrix_to_internal(matrix, "y") @ (*inside, 1), (z, x, y, one))


@pytest.mark.parametrize("up", ["z", "y"])
def test_the_way_back_is_the_inverse(up: UpAxis) -> None:
    values = np.random.default_rng(1).random((2, 3, 4, 3))
    for vectors in (False, True):
        there = to_internal(values, up, vectors=vectors)
        assert there.flags.c_contiguous
        np.testing.assert_array_equal(to_file(there, up, vectors=vectors), values)
    box = Box((1, -2, 3), (4, 5, 6))
    assert box_to_file(box_to_internal(box, up), up) == box
    assert box_to_internal(box, up).shape == to_internal(np.empty(box.shape), up).shape
