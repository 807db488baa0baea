import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import vnca.meshes as raster
from vnca.core import AnyArray
from vnca.core.camera import Orthographic
from vnca.meshes import fragments, visible, weights_at


def covered(corners: AnyArray, rows: int, columns: int) -> AnyArray:
    """How many triangles cover each pixel."""
    count = np.zeros((rows, columns), int)
    for part in fragments(corners, rows, columns):
        np.add.at(count, (part.row, part.column), 1)
    return count


def inside(corners: AnyArray, rows: int, columns: int) -> AnyArray:
    """The same by asking every pixel, with a margin for those on an edge."""
    row, column = np.mgrid[:rows, :columns].reshape(2, -1)
    least = np.stack(
        [weights_at(np.broadcast_to(c, (row.size, 3, 2)), column, row).min(1) for c in corners]
    )
    return (least > 1e-9).sum(0).reshape(rows, columns), (least > -1e-9).sum(0).reshape(
        rows, columns
    )


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_pixels_are_covered_exactly_where_their_centres_are_inside(seed: int, count: int) -> None:
    corners = np.random.default_rng(seed).uniform(-6, 22, (count, 3, 2))
    found = covered(corners, 13, 17)
    surely, perhaps = inside(corners, 13, 17)
    assert (found >= surely).all()
    assert (found <= perhaps).all()


def test_a_square_of_two_triangles_has_no_hole(monkeypatch: pytest.MonkeyPatch) -> None:
    square = np.array([[0.3, 0.2], [9.6, 1.1], [8.4, 9.7], [1.2, 8.8]])
    corners = square[[[0, 1, 2], [0, 2, 3]]]
    whole = covered(corners, 11, 11)
    assert whole.sum() > 50
    filled = (
        np.maximum.accumulate(whole > 0, 1) & np.maximum.accumulate(whole[:, ::-1] > 0, 1)[:, ::-1]
    )
    np.testing.assert_array_equal(whole > 0, filled)
    monkeypatch.setattr(raster, "_BATCH", 3)
    np.testing.assert_array_equal(covered(corners, 11, 11), whole)


@pytest.mark.parametrize("flat", [[[1, 1]] * 3, [[1, 2], [5, 2], [3, 2]], [[2, 1], [2, 5], [2, 3]]])
def test_triangles_without_area_do_no_harm(flat: list[list[float]]) -> None:
    corners = np.array([flat], float)
    count = covered(corners, 8, 8)
    assert count.sum() <= 5
    weights = weights_at(corners, np.array([2]), np.array([2]))
    np.testing.assert_array_equal(weights, [[1, 0, 0]])


def test_huge_triangles_cover_the_whole_picture() -> None:
    corners = np.array([[[-1e9, -1e9], [3e9, -1e9], [-1e9, 3e9]]])
    assert (covered(corners, 5, 7) == 1).all()


def test_weights_add_up_and_give_back_the_point() -> None:
    random = np.random.default_rng(0)
    corners, at = random.normal(size=(50, 3, 2)), random.normal(size=(50, 2))
    weights = weights_at(corners, at[:, 0], at[:, 1])
    np.testing.assert_allclose(weights.sum(1), 1)
    np.testing.assert_allclose(np.einsum("nk,nkc->nc", weights, corners), at, atol=1e-6)


def test_the_nearest_triangle_is_seen() -> None:
    # The camera looks along +y; the triangle listed first is behind.
    triangle = np.array([[-9, 0, -9], [9, 0, -9], [0, 0, 9.0]])
    points = np.concatenate([triangle + np.array([0, 5, 0]), triangle / 2])
    seen = visible(
        points, np.arange(6).reshape(2, 3), Orthographic((0, 0, 0), height=20), rows=40, columns=40
    )
    assert seen.triangle[20, 20] == 1
    assert seen.triangle[0, 0] == -1
    assert seen.triangle[36, 20] == 0


def test_a_sphere_looks_like_a_disc_with_its_near_side() -> None:
    ball = trimesh.creation.icosphere(3, radius=10)
    camera = Orthographic((0, 0, 0), azimuth=30, elevation=20, height=24)
    seen = visible(ball.vertices, ball.faces, camera, rows=96, columns=96)
    assert seen.covered.sum() == pytest.approx(np.pi * 40**2, rel=0.01)
    points = seen.interpolate(ball.vertices, ball.faces)
    forward = camera.rays(1, 1)[1][0, 0]
    assert (points @ forward < 0.5).all()
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 10, rtol=0.02)
    row, column, _ = camera.project(points, 96, 96)
    np.testing.assert_allclose(np.stack([row, column], -1), np.argwhere(seen.covered), atol=1e-4)
