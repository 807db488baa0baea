"""Velocity of files, made into cells per frame at the centres of cells."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.core import AnyArray, BoolArray, FloatArray, Index
from vnca.core.errors import GridError, OptionError
from vnca.core.field import Field
from vnca.core.volume import Volume
from vnca.engine import native
from vnca.io import velocity as in_fields
from vnca.io import velocity as interpolation
from vnca.io.velocity import cells_per_frame, fit_velocity_scale, likely_velocity_scale

SHAPE = (4, 3, 5)
EVERYWHERE = np.ones(SHAPE, np.bool_)
CENTRES = np.stack(np.indices(SHAPE), axis=-1).astype(np.float64)
PLACES = np.random.default_rng(0).uniform(0, np.array(SHAPE) - 1, (50, 3))


def mask(shape: tuple[int, int, int], *cells: tuple[int, int, int]) -> BoolArray:
    result = np.zeros(shape, np.bool_)
    for cell in cells:
        result[cell] = True
    return result


def centred(
    faces: FloatArray, stored: BoolArray, staggered: tuple[bool, bool, bool] = (True, True, True)
) -> FloatArray:
    fields = Field.from_dense(faces, (3, -4, 5)), Field.from_dense(stored, (3, -4, 5))
    centres, at = in_fields.centred(*fields, staggered)
    np.testing.assert_array_equal(at.dense(), stored[:-1, :-1, :-1])
    return centres.dense()


def extrapolated(
    values: FloatArray, known: BoolArray, layers: int, origin: Index = (-3, 4, 6)
) -> tuple[FloatArray, BoolArray]:
    fields = Field.from_dense(values, origin), Field.from_dense(known, origin)
    found, filled = in_fields.extrapolated(*fields, layers)
    return found.dense(), filled.dense()


def test_a_linear_flow_on_faces_is_exact_at_centres() -> None:
    x, y, z = np.indices((6, 5, 7), dtype=np.float32)
    # Faces lie half a cell below the centres that share their index.
    faces = np.stack([x - 0.5, 2 * (y - 0.5), x + 3 * (z - 0.5)], axis=-1)
    centres = centred(faces, np.ones((6, 5, 7), np.bool_))
    expected = np.stack([x, 2 * y, x + 3 * z], axis=-1)[:-1, :-1, :-1]
    np.testing.assert_allclose(centres, expected, atol=1e-6)


def test_faces_that_are_not_stored_do_not_slow_the_edge_of_the_smoke() -> None:
    faces = np.zeros((4, 3, 3, 3), np.float32)
    stored = mask((4, 3, 3), (1, 1, 1), (2, 1, 1))
    faces[1, 1, 1], faces[2, 1, 1] = (2, 5, 7), (4, 5, 7)
    centres = centred(faces, stored)
    np.testing.assert_array_equal(centres[1, 1, 1], (3, 5, 7))
    np.testing.assert_array_equal(centres[2, 1, 1], (4, 5, 7))
    assert not centres[0].any()


def test_components_at_centres_are_left_alone() -> None:
    values = np.random.default_rng(0).standard_normal((4, 4, 4, 3)).astype(np.float32)
    centres = centred(values, np.ones((4, 4, 4), np.bool_), (False, True, False))
    inner = values[:-1, :-1, :-1]
    np.testing.assert_array_equal(centres[..., [0, 2]], inner[..., [0, 2]])
    np.testing.assert_array_equal(centres[..., 1], 0.5 * (inner[..., 1] + values[:-1, 1:, :-1, 1]))


@settings(deadline=None, max_examples=30)
@given(
    st.tuples(*[st.floats(-100, 100, width=32)] * 3), st.integers(0, 2**32 - 1), st.integers(0, 4)
)
def test_a_constant_wind_is_continued_exactly(
    wind: tuple[float, float, float], seed: int, layers: int
) -> None:
    known = np.random.default_rng(seed).random((7, 6, 5)) < 0.05
    constant = np.broadcast_to(np.float32(wind), (7, 6, 5, 3))
    garbage = np.where(known[..., None], constant, np.float32(1e30))
    velocity, filled = extrapolated(garbage, known, layers)
    assert (velocity[filled] == np.float32(wind)).all()
    assert not velocity[~filled].any()


def test_velocity_reaches_just_as_far_as_asked() -> None:
    known = mask((9, 9, 9), (4, 4, 4))
    steps = np.abs(np.indices(known.shape) - 4).sum(axis=0)
    for layers in range(5):
        _, filled = extrapolated(np.ones((9, 9, 9, 3), np.float32), known, layers)
        np.testing.assert_array_equal(filled, steps <= layers)


def test_a_new_cell_is_the_mean_of_its_known_neighbours() -> None:
    known = mask((3, 3, 1), (0, 1, 0), (1, 0, 0))
    velocity = np.zeros((3, 3, 1, 3), np.float32)
    velocity[0, 1, 0], velocity[1, 0, 0] = (2, 0, 4), (4, 1, 0)
    filled, _ = extrapolated(velocity, known, 1)
    np.testing.assert_array_equal(filled[1, 1, 0], (3, 0.5, 2))
    np.testing.assert_array_equal(filled[2, 0, 0], (4, 1, 0))
    np.testing.assert_array_equal(filled[known], velocity[known])


@settings(deadline=None, max_examples=30)
@given(
    st.tuples(*[st.integers(1, 20)] * 3),
    st.tuples(*[st.integers(-20, 20)] * 3),
    st.integers(0, 2**32 - 1),
    st.integers(0, 10),
)
def test_bricks_continue_a_velocity_as_an_array_does_to_the_bit(
    shape: Index, origin: Index, seed: int, layers: int
) -> None:
    random = np.random.default_rng(seed)
    known = random.random(shape) < 0.01
    expected = random.standard_normal((*shape, 3)).astype(np.float32) * known[..., None]
    filled, found = known.copy(), extrapolated(expected, known, layers, origin)
    for _ in range(layers):
        wide, there = np.pad(expected, [(1, 1)] * 3 + [(0, 0)]), np.pad(filled, 1)
        total, count = np.zeros((*shape, 3)), np.zeros(shape)
        for axis in range(3):
            for start in (0, 2):
                place = tuple(
                    slice(start, start + n) if a == axis else slice(1, 1 + n)
                    for a, n in enumerate(shape)
                )
                total += wide[place]
                count += there[place]
        front = (count > 0) & ~filled
        expected[front] = total[front] / count[front, None]
        filled |= front
    np.testing.assert_array_equal(found[0], expected)
    np.testing.assert_array_equal(found[1], filled)


@pytest.mark.parametrize("shape", [(0, 0, 0), (1, 1, 1), (3, 1, 2)])
def test_nothing_known_stays_still(shape: tuple[int, int, int]) -> None:
    velocity, filled = extrapolated(np.ones((*shape, 3), np.float32), np.zeros(shape, bool), 3)
    assert velocity.shape == (*shape, 3)
    assert not velocity.any()
    assert not filled.any()


def test_units_become_cells_per_frame() -> None:
    stretched = np.diag([0.5, 0.25, 0.1, 1.0])
    wind = np.array([1.0, 1.0, 1.0])

    def converted(units: str, fps: float = 20, time_scale: float = 1) -> list[float]:
        matrix = cells_per_frame(
            units,  # pyright: ignore[reportArgumentType]
            fps=fps,
            time_scale=time_scale,
            index_to_world=stretched,
        )
        return (matrix @ wind).tolist()

    assert converted("cells/frame") == [1, 1, 1]
    assert converted("m/s") == pytest.approx([0.1, 0.2, 0.5])
    assert converted("m/s", time_scale=0.5) == pytest.approx([0.05, 0.1, 0.25])
    assert converted("mantaflow", fps=25) == pytest.approx([0.1] * 3)
    assert converted("mantaflow", fps=24, time_scale=0.4) == pytest.approx([1 / 24] * 3)
    with pytest.raises(OptionError, match="velocity_units: expected one of cells/frame, m/s"):
        converted("km/h")
    with pytest.raises(OptionError, match="fps: expected a positive number, got 0"):
        converted("m/s", fps=0)
    with pytest.raises(OptionError, match="time_scale: expected a positive number, got nan"):
        converted("m/s", time_scale=float("nan"))


def test_metres_per_second_follow_a_rotated_grid() -> None:
    rotated = np.eye(4)
    rotated[:3, :3] = 0.1 * np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])  # index x is world y
    matrix = cells_per_frame("m/s", fps=1, time_scale=1, index_to_world=rotated)
    np.testing.assert_allclose(matrix @ [0, 1, 0], [10, 0, 0], atol=1e-12)


def swirl(angle: float, *, refilled: bool = False, frame: int = 0) -> Volume:
    """Blobs turned about the z axis; the velocity turns them by 0.2 a frame."""
    x, y, z = np.indices((28, 28, 10), dtype=np.float32)
    x, y, z = x - 13.5, y - 13.5, z - 4.5
    u = x * np.cos(angle) + y * np.sin(angle)
    v = y * np.cos(angle) - x * np.sin(angle)
    density = np.exp(-((u - 7) ** 2 + v**2 + z**2) / 6) + np.exp(-(u**2 + (v + 8) ** 2 + z**2) / 5)
    if refilled:
        density = np.maximum(density, np.exp(-((x + 8) ** 2 + y**2 + z**2) / 4))
    velocity = 0.2 * np.stack([-y, x, 0 * z], axis=-1)
    velocity[density < 1e-3] = 0  # as in files: stored under the smoke only
    return Volume(density.astype(np.float32), velocity, (0, 0, 0), np.eye(4), frame)


def scaled(volume: Volume, factor: float) -> Volume:
    assert volume.velocity is not None
    return replace(volume, velocity=volume.velocity * np.float32(factor))


@pytest.mark.parametrize("scale", [0.4, 0.8, 1.0, 2.5])
@pytest.mark.parametrize("refilled", [False, True], ids=["", "with a source"])
def test_a_wrong_velocity_scale_is_recovered(scale: float, refilled: bool) -> None:
    first, second = swirl(0, refilled=refilled), swirl(0.2, refilled=refilled)
    assert fit_velocity_scale(scaled(first, 1 / scale), second) == pytest.approx(scale, rel=0.03)


@pytest.mark.parametrize(("factor", "told"), [(1, 1), (0.8, 1), (24, 1 / 32), (0.1, 8)])
def test_units_that_are_far_off_are_noticed_and_others_are_not(factor: float, told: float) -> None:
    found = likely_velocity_scale(scaled(swirl(0), factor), swirl(0.2))
    assert found == 1 if told == 1 else found / told in (0.5, 1, 2)


def test_nothing_is_noticed_where_nothing_can_be_seen() -> None:
    first = swirl(0)
    assert likely_velocity_scale(first, first) == 1
    assert likely_velocity_scale(replace(first, velocity=None), swirl(0.2)) == 1
    assert likely_velocity_scale(scaled(first, 0), swirl(0.2)) == 1


def test_the_fit_follows_boxes_that_move() -> None:
    def cut(volume: Volume, low: int, high: int) -> Volume:
        assert volume.velocity is not None
        inner = np.s_[low:high, 1:27]
        return Volume(
            volume.density[inner], volume.velocity[inner], (low, 1, 0), np.eye(4), volume.frame
        )

    fitted = fit_velocity_scale(cut(swirl(0), 2, 28), cut(swirl(0.2), 0, 27))
    assert fitted == pytest.approx(1, rel=0.03)


def test_a_fit_without_motion_or_velocity_is_refused() -> None:
    still = scaled(swirl(0, frame=7), 0)
    with pytest.raises(GridError, match="frames 7 and 8: no moving smoke"):
        fit_velocity_scale(still, swirl(0.2, frame=8))
    with pytest.raises(GridError, match="frame 7: no velocity"):
        fit_velocity_scale(replace(still, velocity=None), swirl(0.2))
    empty = np.zeros((0, 0, 0), np.float32), np.zeros((0, 0, 0, 3), np.float32)
    nothing = Volume(*empty, (0, 0, 0), np.eye(4), 1)
    with pytest.raises(GridError, match="no moving smoke"):
        fit_velocity_scale(nothing, replace(nothing, frame=2))


@pytest.mark.parametrize("factor", [-1, 0.1], ids=["mirrored", "far too slow"])
def test_a_velocity_no_scale_can_mend_is_refused(factor: float) -> None:
    with pytest.raises(GridError, match=r"no velocity scale up to 4 .* check `velocity_units`"):
        fit_velocity_scale(scaled(swirl(0), factor), swirl(0.2))


def test_extrapolation_keeps_single_precision() -> None:
    values: FloatArray = np.ones((3, 3, 3, 3), np.float32)
    velocity, _ = extrapolated(values, mask((3, 3, 3), (1, 1, 1)), 1)
    assert velocity.dtype == np.float32


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


@pytest.mark.skipif(native.unavailable() is not None, reason="no native extension")
@settings(deadline=None, max_examples=60)
@given(
    st.tuples(*[st.integers(1, 20)] * 3),
    st.tuples(*[st.integers(-20, 20)] * 3),
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.0, 0.3, 5.0, 1e9]),
    st.booleans(),
)
def test_smoke_is_traced_back_natively_to_the_bits_of_numpy(
    shape: Index, origin: Index, seed: int, speed: float, each_its_own: bool
) -> None:
    random = np.random.default_rng(seed)
    values = (speed * random.standard_normal((*shape, 3))).astype(np.float32)
    values[random.random(shape) < 0.5] = 0
    velocity = Field.from_dense(values, origin)
    cells = (origin + random.integers(-3, np.array(shape) + 3, (200, 3))).astype(np.int32)
    time = random.uniform(-2, 2, 200).astype(np.float32) if each_its_own else 1.5
    right = in_fields.carried_to_by_numpy(cells, velocity, time)
    for threads in (1, 3):
        found = in_fields.carried_to(cells, velocity, time, threads=threads)
        np.testing.assert_array_equal(found.view(np.int32), right.view(np.int32))


def test_where_there_is_no_velocity_nothing_has_come_from_anywhere() -> None:
    nothing = Field.from_dense(np.zeros((0, 0, 0, 3), np.float32), (0, 0, 0))
    assert not in_fields.carried_to(np.zeros((4, 3), np.int32), nothing, 1.0).any()
