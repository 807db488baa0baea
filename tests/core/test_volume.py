from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vnca.core import AnyArray
from vnca.core.errors import ShapeError
from vnca.core.volume import Volume

SHAPE = (5, 3, 4)
MATRIX = np.array([[0.5, 0.1, 0, 3], [0, 0.25, 0, -2], [0, 0, 2, 7], [0, 0, 0, 1.0]])


def places(volume: Volume) -> AnyArray:
    """World coordinates of the cell centres `[x, y, z, 3]`."""
    cells = np.moveaxis(np.indices(volume.density.shape), 0, -1) + volume.origin
    return cells @ volume.index_to_world[:3, :3].T + volume.index_to_world[:3, 3]


def ramp() -> Volume:
    """Density and velocity that are linear in world coordinates, from cell (-2, 4, 9) on."""
    still = Volume(np.zeros(SHAPE, np.float32), None, (-2, 4, 9), MATRIX, 8)
    at = places(still)
    velocity = at @ np.array([[1, 2, 0], [0, -1, 3], [2, 0, 1]])
    return replace(still, density=rising(at), velocity=velocity.astype(np.float32))


def rising(at: AnyArray) -> AnyArray:
    return (50 + at @ [3, 2, 1]).astype(np.float32)


@pytest.mark.parametrize("factor", [1, 2, 3, 4])
def test_finer_smoke_is_the_same_smoke_in_the_same_place(factor: int) -> None:
    coarse = ramp()
    fine = coarse.refined(factor)
    assert fine.box == coarse.box.refined(factor)
    assert fine.frame == coarse.frame
    np.testing.assert_allclose(fine.voxel_size, np.array(coarse.voxel_size) / factor)
    # Each cell is divided: the centres of its parts lie around its own.
    parts = places(fine).reshape(*(n for cells in SHAPE for n in (cells, factor)), 3)
    np.testing.assert_allclose(parts.mean(axis=(1, 3, 5)), places(coarse))
    inside = (slice(factor // 2, -(factor // 2) or None),) * 3
    at = places(fine)[inside]
    np.testing.assert_allclose(fine.density[inside], rising(at), rtol=1e-5)
    matrix = factor * np.array([[1, 2, 0], [0, -1, 3], [2, 0, 1]])
    assert fine.velocity is not None
    np.testing.assert_allclose(fine.velocity[inside], at @ matrix, rtol=1e-5, atol=1e-4)


def test_smoke_does_not_fade_towards_the_border_of_its_box() -> None:
    fine = ramp().refined(2)
    np.testing.assert_array_equal(fine.density[0, 0, 0], ramp().density[0, 0, 0])
    np.testing.assert_array_equal(fine.density[-1, -1, -1], ramp().density[-1, -1, -1])


@settings(max_examples=40, deadline=None)
@given(
    arrays(np.float32, (3, 1, 2), elements=st.floats(0, 2.0**99, width=32)),
    st.integers(min_value=1, max_value=4),
)
def test_interpolation_finds_nothing_beyond_what_is_there(density: AnyArray, factor: int) -> None:
    fine = Volume(density, None, (0, 0, 0), np.eye(4), 0).refined(factor)
    assert fine.velocity is None
    assert fine.density.dtype == np.float32
    assert density.min() <= fine.density.min()
    assert fine.density.max() <= density.max()


def test_a_frame_without_smoke_has_none_on_a_finer_grid() -> None:
    nothing = Volume(
        np.zeros((0, 0, 0), np.float32), np.zeros((0, 0, 0, 3), np.float32), (0, 0, 0), np.eye(4), 0
    )
    fine = nothing.refined(3)
    assert fine.box.is_empty
    assert fine.velocity is not None


def test_the_length_of_a_cell_is_that_of_a_cube_as_large() -> None:
    assert ramp().cell_length == pytest.approx(np.cbrt(0.5 * 0.25 * 2))
    assert ramp().refined(2).cell_length == pytest.approx(ramp().cell_length / 2)


def test_named_fields_are_refined_as_the_smoke_is_and_cover_its_cells() -> None:
    density = np.random.default_rng(0).random((4, 4, 4), np.float32)
    smoke = Volume(density, None, (1, 2, 3), np.eye(4), 1, fields={"heat": 2 * density})
    fine = smoke.refined(2)
    np.testing.assert_allclose(fine.named_fields["heat"].dense(), 2 * fine.density, rtol=1e-6)
    assert fine.named_fields["heat"].box == fine.box
    with pytest.raises(ShapeError, match=r"fields: heat: expected \(4, 4, 4\) .* got \(3, 4, 4\)"):
        Volume(density, None, (1, 2, 3), np.eye(4), 1, fields={"heat": density[:3]})
