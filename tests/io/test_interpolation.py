import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.core.bricks.field import Field
from vnca.core.typing import AnyArray, BoolArray, FloatArray
from vnca.io import interpolation

SHAPE = (4, 3, 5)
EVERYWHERE = np.ones(SHAPE, np.bool_)


def interpolated(
    values: FloatArray, known: BoolArray, places: AnyArray
) -> tuple[FloatArray, BoolArray]:
    """In an array whose first cell is (-3, 4, 30)."""
    origin = (-3, 4, 30)
    fields = Field.from_dense(values, origin), Field.from_dense(known, origin)
    return interpolation.interpolated(*fields, places + origin)


def linear(places: AnyArray) -> FloatArray:
    values = places @ np.array([[1.0, 0.5], [-2.0, 3.0], [0.25, -1.0]]) + (3.0, -4.0)
    return values.astype(np.float32)


CENTRES = np.stack(np.indices(SHAPE), axis=-1).astype(np.float64)
PLACES = np.random.default_rng(0).uniform(0, np.array(SHAPE) - 1, (50, 3))


def test_what_is_linear_stays_linear() -> None:
    found, known = interpolated(linear(CENTRES), EVERYWHERE, PLACES)
    np.testing.assert_allclose(found, linear(PLACES), rtol=1e-5, atol=1e-5)
    assert known.all()


def test_beyond_the_outermost_centres_the_outermost_cells_count() -> None:
    found, known = interpolated(linear(CENTRES), EVERYWHERE, np.array([[-9, 1, 1], [2, 1, 40.5]]))
    np.testing.assert_allclose(found, linear(np.array([[0, 1, 1], [2, 1, 4]])))
    assert known.all()


def test_a_grid_of_one_cell_has_one_value() -> None:
    found, known = interpolated(
        np.full((1, 1, 1, 1), 7, np.float32), np.ones((1, 1, 1), np.bool_), PLACES
    )
    np.testing.assert_array_equal(found, 7)
    assert known.all()


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32 - 1), st.floats(0, 1))
def test_unknown_cells_have_no_share(seed: int, share: float) -> None:
    random = np.random.default_rng(seed)
    known = random.random(SHAPE) < share
    values = np.where(known[..., None], linear(CENTRES), np.float32(1e9))
    found, is_known = interpolated(values, known, PLACES)
    for place, value, there in zip(PLACES, found, is_known, strict=True):
        below = place.astype(int)
        cells = [below + corner for corner in np.ndindex(2, 2, 2)]
        weights = [float(np.prod(1 - np.abs(place - cell))) for cell in cells]
        some = [(w, tuple(c)) for w, c in zip(weights, cells, strict=True) if known[tuple(c)]]
        total = sum(weight for weight, _ in some)
        if not some or total < 1e-6:
            assert not there
            assert not value.any()
        else:
            assert there
            expected = sum(weight * linear(np.array(cell)) for weight, cell in some) / total
            np.testing.assert_allclose(value, expected, rtol=1e-4, atol=1e-4)
