import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.core import AnyArray
from vnca.core.errors import BackendUnavailableError
from vnca.io.mesh.obj_ply import triangulated

DART = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.5, 0], [0, 2, 0.0]])
"""A square of area 4 with a notch of area 1.5 in its upper side."""


def cut(ring: AnyArray) -> AnyArray:
    return triangulated(ring, np.array([len(ring)]), np.arange(len(ring)))


def normals(ring: AnyArray, triangles: AnyArray) -> AnyArray:
    """As long as the areas."""
    a, b, c = ring[triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


def star(angles: AnyArray, radii: AnyArray) -> AnyArray:
    """A simple polygon, anticlockwise around the origin, in the plane z = 0."""
    return np.stack([radii * np.cos(angles), radii * np.sin(angles), 0 * angles], 1)


def turned(seed: int) -> AnyArray:
    """A random rotation."""
    basis, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return basis * np.sign(np.linalg.det(basis))


@pytest.mark.parametrize("first", range(5))
@pytest.mark.parametrize("direction", [1, -1])
def test_a_notch_stays_open_wherever_the_polygon_begins(first: int, direction: int) -> None:
    ring = np.roll(DART, first, axis=0)[::direction]
    np.testing.assert_allclose(normals(ring, cut(ring)).sum(0), [0, 0, 2.5 * direction])
    assert (np.sign(normals(ring, cut(ring))[:, 2]) == direction).all()


@pytest.mark.parametrize("first", range(4))
def test_quads_are_split_where_they_are_hollow(first: int) -> None:
    arrow = np.roll([[0, 0, 0], [2, -1, 0], [0.5, 0, 0], [2, 1, 0.0]], first, axis=0)
    np.testing.assert_allclose(np.abs(normals(arrow, cut(arrow))[:, 2]).sum(), 0.5)


@settings(deadline=None, max_examples=150)
@given(st.data(), st.integers(4, 24), st.integers(0, 2**31))
def test_area_and_winding_of_any_simple_polygon_are_kept(
    data: st.DataObject, corners: int, seed: int
) -> None:
    # None of half a turn or more, across which a side might cut others.
    gaps = data.draw(st.lists(st.floats(0.7, 2), min_size=corners, max_size=corners))
    radii = data.draw(st.lists(st.floats(0.1, 10), min_size=corners, max_size=corners))
    flat = star(2 * np.pi * np.cumsum(gaps) / np.sum(gaps), np.array(radii))
    x, y, _ = flat.T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    ring = 1e-3 * flat @ turned(seed).T + [5, -7, 11]
    found = normals(ring, cut(ring))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1).sum() * 1e6, area, rtol=1e-6)
    np.testing.assert_allclose(1e6 * found.sum(0), area * turned(seed)[:, 2], atol=1e-6 * area)


def test_corners_on_a_straight_side_change_nothing() -> None:
    ring = np.insert(DART, [1, 1, 3], [[0.5, 0, 0], [1.5, 0, 0], [1.5, 1.25, 0]], axis=0)
    for first in range(len(ring)):
        rolled = np.roll(ring, first, axis=0)
        np.testing.assert_allclose(np.abs(normals(rolled, cut(rolled))[:, 2]).sum(), 2.5)


def comb(teeth: int) -> AnyArray:
    """Anticlockwise, of area 1.5 a tooth; no point sees all of it."""
    up = [[[x + 1, 1], [x + 1, 2], [x, 2], [x, 1]] for x in range(2 * (teeth - 1), -1, -2)]
    return np.insert(np.concatenate([[[0, 0], [2 * teeth - 1, 0]], *up]), 2, 0.0, axis=1)


@pytest.mark.parametrize("first", [0, 1, 5, 9, 12])
def test_a_polygon_that_no_corner_sees_all_of_is_covered(first: int) -> None:
    ring = np.roll(comb(6).astype(float), first, axis=0)
    found = normals(ring, cut(ring))
    np.testing.assert_allclose(found[:, 2].sum(), 11 + 6)
    assert (found[:, 2] >= 0).all()


@pytest.mark.parametrize("first", range(0, 26, 5))
def test_no_corner_is_left_out_even_if_the_plane_does_not_show_it(first: int) -> None:
    ring = comb(6).astype(float)
    ring = np.insert(ring, 2, [[11, 0.5, 0]], axis=0)
    ring = np.insert(ring, 1, [[3, 0, 0], [5, 0, 0]], axis=0)
    flat = np.roll(ring, first, axis=0)
    bent = np.roll(ring + np.outer(ring[:, 0] == 5, [0, 0, 0.4]), first, axis=0)
    for each in (flat, bent):
        triangles = cut(each)
        assert set(triangles.ravel()) == set(range(len(ring)))
        assert len(triangles) == len(ring) - 2
        np.testing.assert_allclose(normals(each, triangles)[:, 2].sum(), 17)


def test_a_bent_polygon_keeps_its_corners() -> None:
    ring = DART + np.outer([0.1, -0.1, 0.1, 0, -0.1], [0, 0, 1])
    triangles = cut(ring)
    assert set(triangles.ravel()) == set(range(5))
    np.testing.assert_allclose(normals(ring, triangles)[:, 2].sum(), 2.5)


@pytest.mark.parametrize(
    "ring",
    [
        np.zeros((6, 3)),
        np.linspace([0, 0, 0], [1, 2, 3], 7),
        np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0.0]]),
        np.array([[0, 0, 0], [1, 0, 0], [np.nan, 1, 0], [0, 1, 0], [0, 0.5, 0]]),
        np.array([[0, 0, 0], [np.inf, 0, 0], [1, 1, 0], [0.1, 0.1, 0], [0, 1, 0]]),
    ],
    ids=["point", "line", "crossed", "nan", "inf"],
)
def test_what_is_no_polygon_still_gives_triangles_of_its_corners(ring: AnyArray) -> None:
    with np.errstate(invalid="ignore"):
        triangles = cut(ring)
    assert len(triangles) > 0
    assert triangles.min() >= 0
    assert triangles.max() < len(ring)


def test_many_kinds_of_polygons_stay_in_order() -> None:
    points = np.concatenate([DART, [[9, 9, 9]]])
    corners = np.array([0, 1, 5, 0, 1, 2, 3, 4, 0, 5, 1, 2, 5, 4, 3, 2, 1, 0, 0])
    counts = np.array([3, 5, 2, 3, 5, 1])
    triangles = triangulated(points, counts, corners)
    polygon = np.searchsorted(np.cumsum(counts), triangles[:, 0], "right")
    assert polygon.tolist() == [0, 1, 1, 1, 3, 4, 4, 4]
    assert (np.searchsorted(np.cumsum(counts), triangles, "right") == polygon[:, None]).all()


def test_corners_that_are_not_there_are_refused() -> None:
    for corner in (-1, 5):
        with pytest.raises(ValueError, match="not there"):
            triangulated(DART, np.array([4]), np.array([0, 1, 2, corner]))


def test_only_polygons_that_no_corner_sees_need_the_library(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "mapbox_earcut", None)
    assert len(cut(DART)) == 3
    with pytest.raises(BackendUnavailableError, match=r"vnca\[texture\]"):
        cut(comb(6))
