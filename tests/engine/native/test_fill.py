"""Values continued into unknown cells: the same bits as in numpy, and nothing out of range."""

import numpy as np
import pytest

from vnca.core import AnyArray
from vnca.core.bricks import CELLS, sorted_bricks
from vnca.core.errors import ShapeError
from vnca.core.marks import Marks, packed, unpacked
from vnca.engine import native
from vnca.io.velocity import fill_with_means

pytestmark = pytest.mark.skipif(
    native.unavailable() is not None, reason="the native kernel was not built"
)


def problem() -> dict[str, AnyArray]:
    random = np.random.default_rng(3)
    bricks = sorted_bricks(random.integers(-2, 2, (20, 3), np.int32))
    marks = Marks(bricks)
    known = np.zeros((len(bricks) + 1) * CELLS, bool)
    known[:-CELLS] = random.random(len(bricks) * CELLS) < 0.2
    values = random.standard_normal((len(known), 3), np.float32)
    bits = packed(known[:-CELLS].reshape(-1, 8, 8, 8))
    cells = np.flatnonzero(unpacked(marks.beside(bits) & ~bits))
    beside = np.stack(list(marks.rows_beside.values())) * CELLS
    return {"values": values, "known": known, "cells": cells, "beside": beside}


def test_the_bits_are_those_of_numpy() -> None:
    given = problem()
    assert len(given["cells"]) > 1000
    right = given["values"].copy()
    fill_with_means(**{**given, "values": right})
    native.fill(**given)
    np.testing.assert_array_equal(given["values"].view(np.int32), right.view(np.int32))


@pytest.mark.parametrize(
    ("name", "value"),
    [("cells", -1), ("cells", 2**40), ("beside", -1), ("beside", 2**40)],
)
def test_places_out_of_range_are_refused(name: str, value: int) -> None:
    given = problem()
    given[name][...] = value
    with pytest.raises(ShapeError, match="cells: expected places of unknown cells"):
        native.fill(**given)


def test_a_known_cell_is_not_filled() -> None:
    given = problem()
    given["cells"][5] = np.flatnonzero(given["known"])[0]
    with pytest.raises(ShapeError, match="cells: expected places of unknown cells"):
        native.fill(**given)


def test_arrays_of_other_kinds_are_refused() -> None:
    given = problem()
    with pytest.raises(ShapeError, match="cells: expected int64"):
        native.fill(**{**given, "cells": given["cells"].astype(np.int32)})
    with pytest.raises(ShapeError, match="known: expected shape"):
        native.fill(**{**given, "known": given["known"][:-1]})
