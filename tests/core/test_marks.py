"""Marks as bits, against the same cells in an array."""

import numpy as np
import pytest

from vnca.core import BoolArray
from vnca.core.field import Field
from vnca.core.marks import Marks, packed, unpacked


def marked(share: float, seed: int = 0) -> tuple[BoolArray, Field]:
    """Cells of 3 × 2 × 4 bricks, of which some hold nothing; and the bricks that do."""
    random = np.random.default_rng(seed)
    cells = random.random((24, 16, 32)) < share
    cells[8:16, 8:, 8:16] = False
    return cells, Field.from_dense(cells, (-8, 16, 0), outside=False)


def test_bits_hold_what_is_packed() -> None:
    values = marked(0.4)[1].values
    assert packed(values).shape == (len(values), 8)
    np.testing.assert_array_equal(unpacked(packed(values)), values)
    assert packed(values[:0]).shape == (0, 8)
    assert unpacked(packed(values[:0])).shape == (0, 8, 8, 8)


@pytest.mark.parametrize("share", [0.001, 0.05, 0.9])
def test_what_lies_beside_is_found_across_bricks(share: float) -> None:
    cells, field = marked(share)
    marks, bits = Marks(field.bricks), packed(field.values)
    around = np.zeros_like(cells)
    for axis in range(3):
        wide = np.pad(cells, [(1, 1) if a == axis else (0, 0) for a in range(3)])
        low, high = (wide.take(range(at, at + cells.shape[axis]), axis) for at in (0, 2))
        found = Field(field.bricks, unpacked(marks.next_to(bits, axis)), field.box, False)
        held = Field(field.bricks, np.ones_like(field.values), field.box, False).dense()
        np.testing.assert_array_equal(found.dense(), (low | high) & held)
        around |= low | high
    found = Field(field.bricks, unpacked(marks.beside(bits)), field.box, False)
    np.testing.assert_array_equal(found.dense(), around & held)


def test_nothing_is_marked_where_there_are_no_bricks() -> None:
    bits = packed(np.zeros((0, 8, 8, 8), bool))
    assert Marks(np.empty((0, 3), np.int32)).dilated(bits, 3).shape == (0, 8)
