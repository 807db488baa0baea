from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.core.camera import Orthographic, Perspective, frame_box, turntable, view_axes
from vnca.core.errors import OptionError

ANGLES = (st.floats(-360, 360), st.floats(-90, 90))
CAMERAS = [
    Orthographic((3, 4, 5), 20, 35, height=12),
    Perspective((3, 4, 5), -70, -15, distance=30, field_of_view=40),
]


@pytest.mark.parametrize("camera", CAMERAS, ids=["orthographic", "perspective"])
@pytest.mark.parametrize("size", [(6, 9), (7, 4)])
def test_projection_puts_a_point_on_a_ray_back_on_its_pixel(camera, size) -> None:
    origins, directions = camera.rays(*size)
    assert origins.dtype == directions.dtype == np.float64
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1, rtol=1e-6)
    for depth in (2.0, 25.0):
        row, column, found = camera.project(origins + depth * directions, *size)
        np.testing.assert_allclose(row, np.arange(size[0])[:, None] + np.zeros(size), atol=1e-4)
        np.testing.assert_allclose(column, np.arange(size[1]) + np.zeros(size), atol=1e-4)
        np.testing.assert_allclose(found, depth, rtol=1e-5)


@pytest.mark.parametrize("camera", CAMERAS, ids=["orthographic", "perspective"])
def test_a_band_of_rays_is_part_of_the_whole(camera) -> None:
    for part, whole in zip(camera.rays(7, 4, slice(2, 5)), camera.rays(7, 4), strict=True):
        np.testing.assert_array_equal(part, whole[2:5])


@pytest.mark.parametrize("perspective", [False, True])
@pytest.mark.parametrize(
    ("angles", "right", "top"),
    [
        ((0, 0), (1, 0, 0), (0, 0, 1)),
        ((90, 0), (0, 1, 0), (0, 0, 1)),
        ((180, 0), (-1, 0, 0), (0, 0, 1)),
        ((-90, 0), (0, -1, 0), (0, 0, 1)),
        ((0, 90), (1, 0, 0), (0, 1, 0)),
        ((0, -90), (1, 0, 0), (0, -1, 0)),
    ],
)
def test_views_are_the_right_way_up_and_round(perspective, angles, right, top) -> None:
    target = np.array([8.0, 9.0, 10.0])
    camera = (
        Perspective((8, 9, 10), *angles, distance=20, field_of_view=45)
        if perspective
        else Orthographic((8, 9, 10), *angles, height=16)
    )
    row, column, _ = camera.project(np.stack([target, target + right, target + top]), 65, 65)
    assert (row[0], column[0]) == pytest.approx((32, 32))
    assert column[1] > 33
    assert row[1] == pytest.approx(32)
    assert row[2] < 31
    assert column[2] == pytest.approx(32)


def test_positive_elevation_stands_above() -> None:
    origins, directions = Perspective((0, 0, 0), 0, 30, distance=10).rays(1, 1)
    assert origins[0, 0, 2] == pytest.approx(5)
    assert directions[0, 0, 2] == pytest.approx(-0.5)


def test_points_behind_a_perspective_camera_have_no_pixel() -> None:
    camera = Perspective((0, 0, 0), distance=10)
    row, column, depth = camera.project(np.array([0.0, -12.0, 0.0]), 8, 8)
    assert np.isnan(row)
    assert np.isnan(column)
    assert depth == pytest.approx(-2)


@settings(deadline=None, max_examples=60)
@given(*ANGLES, st.sampled_from([None, 20.0, 75.0]), st.sampled_from([(48, 48), (40, 90)]))
def test_framed_box_fills_the_picture_and_stays_inside(azimuth, elevation, view, size) -> None:
    rows, columns = size
    lower, upper, margin = (2.0, -3.0, 0.0), (10.0, 5.0, 30.0), 0.05
    camera = frame_box(
        lower, upper, azimuth, elevation, margin=margin, aspect=columns / rows, field_of_view=view
    )
    corners = np.array(list(product(*zip(lower, upper, strict=True))))
    row, column, depth = camera.project(corners, rows, columns)
    # Fractions of the picture, 0 to 1 from edge to edge.
    row, column = (row + 0.5) / rows, (column + 0.5) / columns
    free = [row.min(), 1 - row.max(), column.min(), 1 - column.max()]
    assert min(free) >= margin - 1e-6
    assert max(free[0], free[1]) < margin + 1e-6 or max(free[2], free[3]) < margin + 1e-6
    assert depth.min() > camera.near


@settings(deadline=None, max_examples=60)
@given(st.floats(-180, 180), st.floats(0, 90), st.sampled_from([3.0, 10.0, 40.0]))
def test_a_turntable_sees_a_box_as_large_from_all_sides(azimuth, steepest, tall) -> None:
    lower, upper, margin = (2.0, -3.0, 0.0), (10.0, 9.0, tall), 0.05
    corners = np.array(list(product(*zip(lower, upper, strict=True))))
    views = {"steepest": steepest, "margin": margin}
    assert turntable(lower, upper, azimuth, steepest, **views).height == pytest.approx(
        turntable(lower, upper, **views).height
    )
    for elevation in np.linspace(-steepest, steepest, 9):
        camera = turntable(lower, upper, azimuth, elevation, **views)
        row, column, _ = camera.project(corners, 100, 100)
        for at in (row + 0.5) / 100, (column + 0.5) / 100:
            assert at.min() >= margin - 1e-6
            assert at.max() <= 1 - margin + 1e-6


def test_a_turntable_is_no_farther_away_than_its_widest_view_asks_for() -> None:
    level = turntable((0, 0, 0), (30, 40, 20), margin=0.0, steepest=0)
    assert level.height == pytest.approx(50)
    assert level.target == (15, 20, 10)
    assert turntable((0, 0, 0), (30, 40, 20), margin=0.0).height == pytest.approx(
        np.hypot(50, 20), rel=1e-9
    )


@pytest.mark.parametrize(
    "make",
    [
        lambda: Orthographic((0, 0, 0), height=0),
        lambda: Perspective((0, 0, 0), distance=-1),
        lambda: Perspective((0, 0, 0), distance=1, field_of_view=180),
        lambda: frame_box((0, 0, 0), (1, 0, 1)),
        lambda: frame_box((0, 0, 0), (1, 1, 1), margin=0.5),
        lambda: frame_box((0, 0, 0), (1, 1, 1), aspect=0),
        lambda: frame_box((0, 0, 0), (1, 1, 1), field_of_view=0),
        lambda: turntable((0, 0, 0), (1, 0, 1)),
    ],
)
def test_impossible_cameras_are_refused(make) -> None:
    with pytest.raises(OptionError):
        make()


@pytest.mark.parametrize("field_of_view", [None, 40.0])
def test_the_height_of_a_camera_is_what_it_shows_at_its_target(field_of_view) -> None:
    camera = frame_box((0, 0, 0), (4, 9, 5), 30, 20, field_of_view=field_of_view)
    _, up, _ = view_axes(30, 20)
    edges = np.array(camera.target) + np.outer([0.5, -0.5], camera.height * up)
    row, column, _ = camera.project(edges, 64, 48)
    np.testing.assert_allclose(row, [-0.5, 63.5], atol=1e-9)
    np.testing.assert_allclose(column, 23.5, atol=1e-9)
