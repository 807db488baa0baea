import numpy as np
import pytest
import torch
from torch.nn import functional

from vnca.core.camera import Orthographic, Perspective, frame_box
from vnca.core.errors import ShapeError
from vnca.rendering.view import projected_velocity, render

SHAPE = (20, 20, 20)


def everywhere(*velocity: float) -> torch.Tensor:
    return torch.tensor(velocity, dtype=torch.float32).expand(*SHAPE, 3)


def camera(azimuth: float = 0.0, elevation: float = 0.0) -> Orthographic | Perspective:
    return frame_box((-0.5,) * 3, (19.5,) * 3, azimuth, elevation)


def seen(density: torch.Tensor, velocity: torch.Tensor, view, **options):
    return projected_velocity(
        density, velocity, view, **{"rows": 40, "columns": 40, "gamma": 3.0, **options}
    )


@pytest.mark.parametrize(
    ("azimuth", "velocity", "right", "down"),
    [
        (0, (1, 0, 0), 1, 0),  # from the front, x is to the right
        (0, (0, 0, 1), 0, -1),  # up in the smoke is up in the picture
        (0, (0, 1, 0), 0, 0),  # away from the camera: nothing moves
        (90, (0, 1, 0), 1, 0),  # from the +x side, y is to the right
        (180, (1, 0, 0), -1, 0),  # from behind, x is to the left
    ],
)
def test_smoke_moves_the_way_it_is_seen_from(azimuth, velocity, right, down) -> None:
    view = camera(azimuth)
    flow, opacity = seen(torch.ones(SHAPE), everywhere(*velocity), view)
    assert isinstance(view, Orthographic)
    a_cell = 40 / view.height  # pixels
    expected = torch.tensor([right, down]) * a_cell
    torch.testing.assert_close(flow[20, 20], expected.float(), atol=1e-4, rtol=1e-4)
    assert opacity[20, 20] > 0.99
    assert not flow[0, 0].any()  # the margin of the picture


def test_a_wide_picture_has_square_pixels() -> None:
    view = frame_box((-0.5,) * 3, (19.5,) * 3, aspect=2.0)
    flow, _ = seen(torch.ones(SHAPE), everywhere(1, 0, 1), view, rows=30, columns=60)
    assert flow.shape == (30, 60, 2)
    torch.testing.assert_close(flow[15, 30, 0], -flow[15, 30, 1])


def test_what_is_near_is_seen_larger_and_moves_further() -> None:
    view = frame_box((-0.5,) * 3, (19.5,) * 3, field_of_view=60)
    far, near = torch.zeros(SHAPE), torch.zeros(SHAPE)
    far[:, 18], near[:, 1] = 1, 1
    flows = [seen(d, everywhere(0.1, 0, 0), view)[0][20, 20, 0] for d in (near, far)]
    assert isinstance(view, Perspective)
    a_pixel = 2 * np.tan(np.pi / 6) / 40
    for flow, y in zip(flows, (1, 18), strict=True):
        depth = view.distance + y - 9.5
        assert float(flow) == pytest.approx(0.1 / (depth * a_pixel), rel=0.03)


def test_smoke_in_front_hides_what_moves_behind_it() -> None:
    density, velocity = torch.zeros(SHAPE), torch.zeros(*SHAPE, 3)
    density[:, 2:8], velocity[:, 2:8, :, 0] = 1.0, 1.0
    density[:, 12:18], velocity[:, 12:18, :, 0] = 1.0, -1.0
    assert seen(density, velocity, camera(0))[0][20, 20, 0] > 1
    assert seen(density, velocity, camera(180))[0][20, 20, 0] > 1  # the other one, from behind
    through = seen(density, velocity, camera(0), gamma=1e-4)[0][20, 20, 0]
    assert abs(through) < 0.01  # thin smoke: both alike


def test_cells_of_any_shape_move_as_far_as_they_do_in_the_world() -> None:
    place = np.eye(4)
    place[:3] = [[-0.2, 0.1, 0, 4], [0, 0.1, 0, -3], [0, 0.05, 0.4, 2]]
    corners = np.stack(np.meshgrid(*[(-0.5, 19.5)] * 3), -1).reshape(-1, 3)
    corners = corners @ place[:3, :3].T + place[:3, 3]
    view = frame_box(corners.min(0).tolist(), corners.max(0).tolist(), 20, 10)
    assert isinstance(view, Orthographic)
    velocity = (0.5, 0.3, -0.4)
    flow, _ = seen(
        torch.ones(SHAPE), everywhere(*velocity), view, gamma=9.0, step=0.1, cells_to_world=place
    )
    middle = np.array(view.target)
    ends = np.stack([middle, middle + place[:3, :3] @ velocity])
    row, column, _ = view.project(ends, 40, 40)
    expected = torch.tensor([column[1] - column[0], row[1] - row[0]]).float()
    torch.testing.assert_close(flow[20, 20], expected, atol=1e-3, rtol=1e-3)


def solid_texture(shift: torch.Tensor) -> torch.Tensor:
    """A smooth solid texture at the cell centres, moved by `shift` cells."""
    axes = (torch.arange(float(n)) for n in SHAPE)
    at = torch.stack(torch.meshgrid(*axes, indexing="ij"), -1) - shift
    waves = torch.tensor([[0.5, 0.2, 0.4], [-0.3, 0.5, 0.6], [0.2, -0.6, 0.5]])
    return 0.5 + 0.25 * (torch.sin(at @ waves) + torch.sin(at @ waves.flip(0)))


@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 0), (25, 0), (0, 40)])
def test_a_known_texture_that_is_carried_moves_by_the_projected_velocity(
    azimuth, elevation
) -> None:
    # The camera sees the front of an opaque wall, so the texture moves along the wall.
    view, density = camera(azimuth, elevation), torch.zeros(SHAPE)
    density[:, 9:11] = 1
    velocity = torch.tensor([0.7, 0.0, 0.4])
    flow, opacity = seen(density, everywhere(*velocity.tolist()), view)
    before, after = (
        render(density, solid_texture(shift), view, rows=40, columns=40, gamma=3.0).colour
        for shift in (torch.zeros(3), velocity)
    )
    row, column = torch.meshgrid(torch.arange(40.0), torch.arange(40.0), indexing="ij")
    at = torch.stack([column + flow[..., 0], row + flow[..., 1]], -1)
    warped = functional.grid_sample(
        after.permute(2, 0, 1)[None], ((2 * at + 1) / 40 - 1)[None], align_corners=False
    )[0].permute(1, 2, 0)
    inside = (opacity > 0.99).float()[None]
    inside = -functional.max_pool2d(-inside, 7, stride=1, padding=3)[0] > 0
    moved = (after - before)[inside].abs().mean()
    left = (warped - before)[inside].abs().mean()
    assert inside.sum() > 100
    assert left < 0.2 * moved


def test_no_smoke_moves_nothing() -> None:
    flow, opacity = seen(torch.zeros(SHAPE), everywhere(1, 0, 0), camera())
    assert not flow.any()
    assert not opacity.any()


@pytest.mark.usefixtures("unchecked_shapes")
def test_velocity_of_another_grid_is_refused() -> None:
    with pytest.raises(ShapeError, match="velocity to project"):
        seen(torch.ones(SHAPE), torch.zeros(20, 20, 19, 3), camera())
