import math
from itertools import pairwise

import numpy as np
import pytest
import torch

from vnca.core.camera import Orthographic, Perspective, frame_box
from vnca.core.errors import OptionError, ShapeError
from vnca.rendering.march import sample
from vnca.rendering.view import render

ABOVE = (0, 90)


def ball(shape=(12, 12, 12), radius=4.0, dtype=torch.float32) -> torch.Tensor:
    axes = [torch.arange(n, dtype=dtype) - (n - 1) / 2 for n in shape]
    x, y, z = torch.meshgrid(*axes, indexing="ij")
    return (radius - (x**2 + y**2 + z**2).sqrt()).clamp(0, 1)


def camera_on(shape, azimuth=0.0, elevation=0.0, field_of_view=None):
    upper = [n - 0.5 for n in shape]
    return frame_box((-0.5,) * 3, upper, azimuth, elevation, field_of_view=field_of_view)


def white(density: torch.Tensor) -> torch.Tensor:
    return density.new_ones(*density.shape, 3)


@pytest.mark.parametrize("step", [1.0, 0.5, 0.25])
@pytest.mark.parametrize("offset", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("angles", [(0, 0), (90, 0), (180, 0), (270, 0), ABOVE])
def test_slab_has_the_analytic_opacity_from_every_side(step, offset, angles) -> None:
    density = torch.full((6, 6, 6), 0.5, dtype=torch.float64)
    camera = Orthographic((2.5, 2.5, 2.5), *angles, height=1)
    view = render(
        density, white(density), camera, rows=1, columns=1, gamma=0.4, step=step, offset=offset
    )
    # Interpolation fades linearly over a cell at either end, so the smoke is 6 cells thick.
    assert view.opacity.item() == pytest.approx(1 - math.exp(-0.4 * 0.5 * 6), rel=1e-5)


def placed(*columns: tuple[float, float, float], at=(0.0, 0.0, 0.0)) -> np.ndarray:
    """The 4×4 that takes the axes of the cells to these vectors and cell (0, 0, 0) to `at`."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.transpose(columns), at
    return matrix


PLACES = {
    "uneven": placed((0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.4)),
    "mirrored": placed((-0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2), at=(3, -1, 7)),
    "turned": placed((0, 0, 0.3), (0.3, 0, 0), (0, 0.3, 0), at=(0, 4, 0)),
    "far away": placed((0.05, 0, 0), (0, 0.05, 0), (0, 0, 0.05), at=(1e5, -2e5, 3e4)),
    "sheared": placed((1, 0, 0), (0.7, 1, 0), (0.2, -0.4, 0.5), at=(1, 2, 3)),
}


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
@pytest.mark.parametrize("angles", [(0, 0), (90, 0), ABOVE, (35, 20)])
def test_what_a_slab_absorbs_depends_on_its_thickness_in_the_world(place, angles) -> None:
    ray = np.linalg.inv(place[:3, :3]) @ Orthographic((0, 0, 0), *angles).rays(1, 1)[1][0, 0]
    shape = [21, 21, 21]
    shape[np.abs(ray).argmax()] = 4  # the ray goes through this side of it, far from the others
    thickness = 4 / np.abs(ray).max()
    middle = place @ [*((n - 1) / 2 for n in shape), 1]
    camera = Orthographic(tuple(middle[:3].tolist()), *angles, height=1e-3 * thickness)
    density = torch.full(shape, 0.5, dtype=torch.float64)
    options = {"rows": 1, "columns": 1, "step": thickness / 400, "cells_to_world": place}
    view = render(density, white(density), camera, gamma=2.2 / thickness, **options)
    assert view.opacity.item() == pytest.approx(1 - math.exp(-0.5 * 2.2), rel=1e-3)


@pytest.mark.parametrize("field_of_view", [None, 35.0])
@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_a_marked_cell_appears_where_it_is_in_the_world(place, field_of_view) -> None:
    shape, cell = (12, 14, 16), (2, 3, 13)
    density = torch.zeros(shape)
    density[cell] = 1
    corners = np.stack(np.meshgrid(*[(-0.5, n - 0.5) for n in shape]), -1).reshape(-1, 3)
    corners = corners @ place[:3, :3].T + place[:3, 3]
    camera = frame_box(
        corners.min(0).tolist(), corners.max(0).tolist(), 35, 20, field_of_view=field_of_view
    )
    edge = np.cbrt(abs(np.linalg.det(place)))
    options = {"gamma": 1 / edge, "step": 0.1 * edge, "cells_to_world": place}
    view = render(density, white(density), camera, rows=96, columns=96, **options)
    rows, columns = torch.meshgrid(torch.arange(96.0), torch.arange(96.0), indexing="ij")
    total = view.opacity.sum()
    row, column, depth = camera.project((place @ (*cell, 1))[:3], 96, 96)
    assert (rows * view.opacity).sum() / total == pytest.approx(row, abs=0.3)
    assert (columns * view.opacity).sum() / total == pytest.approx(column, abs=0.3)
    mean_depth = (view.depth.where(view.opacity > 0, 0) * view.opacity).sum() / total
    assert mean_depth == pytest.approx(depth, abs=0.2 * edge)


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_smoke_looks_the_same_on_whatever_cells_it_is_given(place) -> None:
    """A soft ball of the world, on the cells of a place and on cubic ones."""
    radius = 5 * np.linalg.norm(place[:3, :3], axis=0).max()
    middle = place[:3, 3]
    camera = Orthographic(tuple(middle.tolist()), 35, 20, height=2 * radius)
    views = []
    for linear in (place[:3, :3], radius / 20 * np.eye(3)):
        reach = np.ceil(radius * np.linalg.norm(np.linalg.inv(linear), axis=1)) + 1
        axes = (np.arange(-n, n + 1) for n in reach)
        index = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
        at = index @ linear.T / radius
        density = torch.from_numpy(np.maximum(1 - np.square(at).sum(-1), 0) ** 2)
        colour = torch.from_numpy(0.5 + 0.5 * np.sin(2 * at))
        there = np.eye(4)
        there[:3, :3], there[:3, 3] = linear, middle - linear @ reach
        options = {"gamma": 3 / radius, "step": 0.03 * radius, "cells_to_world": there}
        views.append(render(density, colour, camera, rows=24, columns=24, **options).rgba)
    assert views[1][..., 3].max() > 0.9
    torch.testing.assert_close(*views, rtol=0, atol=0.06)
    assert (views[0] - views[1]).square().mean().sqrt() < 0.02


@pytest.mark.parametrize("field_of_view", [None, 35.0])
@pytest.mark.parametrize("angles", [(0, 0), (90, 0), (180, 0), (-90, 0), (0, 80), (35, 20)])
def test_a_marked_cell_appears_where_the_camera_says(angles, field_of_view) -> None:
    shape, cell = (12, 14, 16), (2, 3, 13)
    density = torch.zeros(shape)
    density[cell] = 1
    camera = camera_on(shape, *angles, field_of_view=field_of_view)
    view = render(density, white(density), camera, rows=64, columns=64, gamma=1.0, step=0.25)
    rows, columns = torch.meshgrid(torch.arange(64.0), torch.arange(64.0), indexing="ij")
    total = view.opacity.sum()
    row, column, depth = camera.project(torch.tensor(cell).numpy(), 64, 64)
    assert (rows * view.opacity).sum() / total == pytest.approx(row, abs=0.3)
    assert (columns * view.opacity).sum() / total == pytest.approx(column, abs=0.3)
    mean_depth = (view.depth.where(view.opacity > 0, 0) * view.opacity).sum() / total
    assert mean_depth == pytest.approx(depth, abs=0.1)


@pytest.mark.parametrize(("azimuth", "seen"), [(0, 0), (180, 1)])
def test_nearer_smoke_hides_farther_smoke_from_both_sides(azimuth, seen) -> None:
    density = torch.zeros(5, 9, 5)
    colour = torch.zeros(5, 9, 5, 3)
    density[:, :4], density[:, 5:] = 20, 20
    colour[:, :4, :, 0], colour[:, 5:, :, 1] = 1, 1
    view = render(density, colour, camera_on((5, 9, 5), azimuth), rows=9, columns=9, gamma=1.0)
    expected = [0.0, 0.0, 0.0]
    expected[seen] = 1.0
    assert view.colour[4, 4].tolist() == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("step", [1.0, 0.5])
@pytest.mark.parametrize("azimuth", [0, 33])
def test_a_red_cloud_is_red_up_to_its_edge(step, azimuth) -> None:
    density = ball()
    red = torch.tensor([0.8, 0.1, 0.05])
    colour = torch.where(density[..., None] > 0, red, torch.nan_to_num(red) * 0)
    camera = camera_on(density.shape, azimuth, 20)
    view = render(density, colour, camera, rows=40, columns=40, gamma=0.5, step=step)
    seen = view.opacity > 1e-4
    assert seen.any()
    straight = view.colour[seen] / view.opacity[seen, None]
    torch.testing.assert_close(straight, red.expand_as(straight), rtol=2e-3, atol=1e-4)


def test_skipping_empty_space_changes_nothing() -> None:
    """A faint fog everywhere switches the skipping off, and hardly adds anything."""
    density = ball((14, 13, 12), dtype=torch.float64)
    density[1, 1, 1] = 0.4
    camera = camera_on(density.shape, 25, 15, field_of_view=30)
    options = {"rows": 24, "columns": 30, "gamma": 0.6, "step": 0.7, "offset": 0.2}
    colour = white(density)
    a = render(density, colour, camera, **options)
    b = render(density + 1e-9, colour, camera, **options)
    torch.testing.assert_close(a.opacity, b.opacity, rtol=0, atol=1e-7)
    torch.testing.assert_close(a.colour, b.colour, rtol=0, atol=1e-7)


def test_large_pictures_are_marched_in_groups_without_a_seam(monkeypatch) -> None:
    density = ball()
    options = {"rows": 20, "columns": 20, "gamma": 0.6}
    whole = render(density, white(density), camera_on(density.shape), **options)
    monkeypatch.setattr("vnca.rendering.march.SAMPLES_AT_ONCE", 64)
    parts = render(density, white(density), camera_on(density.shape), **options)
    torch.testing.assert_close(whole.rgba, parts.rgba)


@pytest.mark.parametrize("mode", ["emission-absorption", "paper"])
def test_render_gradients_match_finite_differences(mode) -> None:
    generator = torch.Generator().manual_seed(0)
    density = 0.1 + torch.rand(3, 2, 3, dtype=torch.float64, generator=generator)
    colour = torch.rand(3, 2, 3, 3, dtype=torch.float64, generator=generator)
    camera = camera_on(density.shape, 30, 20, field_of_view=40)

    def picture(d, c):
        view = render(d, c, camera, rows=4, columns=3, gamma=0.4, mode=mode)
        return view.over((0.3, 0.6, 0.9)), view.depth[view.depth.isfinite()]

    assert torch.autograd.gradcheck(picture, (density.requires_grad_(), colour.requires_grad_()))


def test_gradients_are_finite_where_smoke_fades_to_nothing() -> None:
    density = ball(radius=5)
    density[density > 0] *= torch.logspace(-38, 0, int((density > 0).sum()))
    density.requires_grad_()
    colour = torch.rand(12, 12, 12, 3, generator=torch.Generator().manual_seed(0))
    colour.requires_grad_()
    view = render(density, colour, camera_on(density.shape, 10), rows=24, columns=24, gamma=0.5)
    (view.over((1.0, 1.0, 1.0)).square().sum() + view.depth[view.depth.isfinite()].sum()).backward()
    assert density.grad is not None
    assert colour.grad is not None
    assert density.grad.isfinite().all()
    assert colour.grad.isfinite().all()
    assert density.grad.abs().max() > 0


def test_paper_mode_sums_over_the_cells_of_a_column() -> None:
    generator = torch.Generator().manual_seed(3)
    density = torch.rand(3, 5, 2, dtype=torch.float64, generator=generator)
    colour = torch.rand(3, 5, 2, 3, dtype=torch.float64, generator=generator)
    # One pixel a cell; the target's y is whole, so samples fall on cell centres.
    camera = Orthographic((1, 2, 0.5), height=2)
    view = render(density, colour, camera, rows=2, columns=3, gamma=0.7, mode="paper")
    for x in range(3):
        for z in range(2):
            pixel, absorbed = torch.zeros(3, dtype=torch.float64), 0.0
            for y in range(5):
                absorbed += 0.7 * density[x, y, z]
                pixel += colour[x, y, z] * density[x, y, z] * math.exp(-absorbed)
            torch.testing.assert_close(view.colour[1 - z, x], pixel)


@pytest.mark.parametrize("azimuth", [0, 40])
def test_more_gamma_makes_smoke_denser_everywhere_and_never_thinner(azimuth) -> None:
    density = ball()
    camera = camera_on(density.shape, azimuth)
    views = [
        render(density, white(density), camera, rows=24, columns=24, gamma=gamma)
        for gamma in (0.0, 0.1, 0.5, 2.0)
    ]
    assert views[0].opacity.max() == 0
    for thin, thick in pairwise(views):
        assert (thick.opacity >= thin.opacity).all()
        assert (thick.colour >= thin.colour - 1e-6).all()
    # The paper's brightness control: there, absorbing more only darkens.
    dim, bright = (
        render(density, white(density), camera, rows=24, columns=24, gamma=gamma, mode="paper")
        for gamma in (0.5, 0.1)
    )
    assert (bright.colour >= dim.colour).all()


def test_background_shows_through_as_much_as_the_smoke_lets_it() -> None:
    density = ball()
    view = render(
        density, white(density) * 0, camera_on(density.shape), rows=20, columns=20, gamma=0.3
    )
    over = view.over((0.2, 0.4, 0.6))
    assert over[0, 0].tolist() == pytest.approx([0.2, 0.4, 0.6])
    through = 1 - view.opacity[10, 10].item()
    assert over[10, 10].tolist() == pytest.approx([0.2 * through, 0.4 * through, 0.6 * through])
    picture = torch.rand(20, 20, 3)
    torch.testing.assert_close(view.over(picture)[0, 0], picture[0, 0])


@pytest.mark.parametrize(
    "camera",
    [
        camera_on((4, 4, 4)),
        Perspective((2, -40, 2), 180, distance=10, field_of_view=10),
        Orthographic((50, 2, 2), height=4),
    ],
    ids=["no smoke", "looking away", "looking past"],
)
def test_a_view_without_smoke_is_transparent(camera) -> None:
    density = torch.full((4, 4, 4), 0.0 if camera.target[0] == 1.5 else 1.0)
    view = render(density, white(density), camera, rows=5, columns=6, gamma=1.0)
    assert view.rgba.shape == (5, 6, 4)
    assert view.rgba.abs().max() == 0
    assert view.depth.isinf().all()


def test_smoke_behind_a_perspective_camera_is_not_seen() -> None:
    density = torch.ones(4, 20, 4)
    inside = Perspective((1.5, 15, 1.5), distance=5, field_of_view=20)
    view = render(density, white(density), inside, rows=1, columns=1, gamma=0.1, step=0.5)
    assert view.opacity.item() == pytest.approx(1 - math.exp(-0.1 * 9.5), abs=0.03)


def test_rendering_twice_gives_the_same_bits() -> None:
    results = []
    for _ in range(2):
        density = ball((20, 20, 20), 8).requires_grad_()
        view = render(
            density, white(density), camera_on((20,) * 3, 33, 12), rows=48, columns=48, gamma=0.5
        )
        view.over((0.5, 0.5, 0.5)).square().sum().backward()
        results.append((view.rgba, view.depth, density.grad))
    for a, b in zip(*results, strict=True):
        assert torch.equal(a, b)


@pytest.mark.parametrize(
    "wrong",
    [
        {"gamma": -1.0},
        {"step": 0.0},
        {"offset": 1.0},
        {"rows": 0},
        {"mode": "nice"},
        {"mode": "paper", "step": 0.5},
    ],
    ids=str,
)
@pytest.mark.usefixtures("unchecked_shapes")
def test_impossible_options_are_refused(wrong) -> None:
    density = ball()
    options = {"rows": 4, "columns": 4, "gamma": 1.0} | wrong
    with pytest.raises(OptionError, match=r"gamma|step|offset|size|mode"):
        render(density, white(density), camera_on(density.shape), **options)


@pytest.mark.usefixtures("unchecked_shapes")
def test_colour_of_other_cells_is_refused() -> None:
    density = ball()
    with pytest.raises(ShapeError, match="volume to render"):
        render(density, white(density)[1:], camera_on((12,) * 3), rows=4, columns=4, gamma=1.0)


def field_shader(factor: torch.Tensor, colour: torch.Tensor):
    """What arrays of factors and colours show between cells, and the points that were asked for."""
    asked: list[torch.Tensor] = []

    def shade(points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        asked.append(points)
        seen = sample(torch.cat([factor[..., None], colour], -1), points)
        return seen[:, 0], seen[:, 1:]

    return shade, asked


def test_a_shader_that_shows_one_colour_shows_what_an_array_of_it_does() -> None:
    density = ball(dtype=torch.float64)
    camera = camera_on(density.shape, 20, 10)
    options = {"rows": 24, "columns": 24, "gamma": 0.7, "step": 0.5, "offset": 0.3}
    wide = density.new_full((14, 14, 14), 1.5)
    ochre = density.new_tensor([0.6, 0.4, 0.1])
    shade, _ = field_shader(wide[1:-1, 1:-1, 1:-1], ochre.expand(*density.shape, 3))
    seen = render(density, shade, camera, **options)  # type: ignore[arg-type]
    expected = render(1.5 * density, ochre.expand(*density.shape, 3), camera, **options)  # type: ignore[arg-type]
    for ours, theirs in zip(
        (seen.colour, seen.opacity), (expected.colour, expected.opacity), strict=True
    ):
        torch.testing.assert_close(ours, theirs, atol=5e-4, rtol=0)


def test_only_what_can_be_seen_is_shaded() -> None:
    density = torch.ones(20, 20, 20)
    camera = camera_on(density.shape)
    ones = torch.ones(20, 20, 20)
    counts = []
    for gamma in (0.01, 5.0):
        shade, asked = field_shader(ones, white(density))
        view = render(density, shade, camera, rows=8, columns=8, gamma=gamma)
        counts.append(sum(map(len, asked)))
    assert view.opacity[4, 4] > 0.999
    assert counts[1] < counts[0] / 3


def test_gradients_reach_a_shader() -> None:
    density = ball()
    factor = torch.ones(12, 12, 12, requires_grad=True)
    colour = torch.full((12, 12, 12, 3), 0.5, requires_grad=True)
    shade, _ = field_shader(factor, colour)
    view = render(density, shade, camera_on(density.shape), rows=8, columns=8, gamma=0.3)
    (view.colour.sum() + view.opacity.sum()).backward()
    for tensor in (factor, colour):
        assert tensor.grad is not None
        assert tensor.grad.abs().sum() > 0


@pytest.mark.parametrize("along", [2, 3])
def test_a_supersampled_view_is_the_mean_of_a_larger_one(along: int) -> None:
    """Smoke so fine in depth that it matters little where along the rays samples begin."""
    density = ball()
    colour = torch.rand(12, 12, 12, 3, generator=torch.Generator().manual_seed(0))
    camera = camera_on(density.shape, 30, 20)
    options = {"gamma": 0.5, "step": 0.05}
    seen = render(density, colour, camera, rows=6, columns=6, supersampling=along, **options)  # type: ignore[arg-type]
    large = render(density, colour, camera, rows=6 * along, columns=6 * along, **options)  # type: ignore[arg-type]

    def mean(values: torch.Tensor) -> torch.Tensor:
        return values.view(6, along, 6, along, *values.shape[2:]).mean((1, 3))

    torch.testing.assert_close(seen.opacity, mean(large.opacity), atol=2e-3, rtol=0)
    torch.testing.assert_close(seen.colour, mean(large.colour), atol=2e-3, rtol=0)
    there = torch.isfinite(seen.depth)
    assert torch.equal(there, seen.opacity > 1e-12)
    assert ((seen.depth[there] > -8) & (seen.depth[there] < 8)).all()


def test_samples_of_a_pixel_begin_at_different_depths() -> None:
    """A sheet thinner than a step is seen in full nowhere, but in every pixel."""
    density = torch.zeros(9, 9, 9)
    density[:, 4] = 1
    camera = Orthographic((4.0, 4.0, 4.0), 0, 0, height=4)
    options = {"rows": 8, "columns": 8, "gamma": 0.5, "step": 4.0, "offset": 0.0}
    once = render(density, white(density), camera, **options)  # type: ignore[arg-type]
    often = render(density, white(density), camera, supersampling=4, **options)  # type: ignore[arg-type]
    exact = 1 - math.exp(-0.5)
    assert abs(float(once.opacity.mean()) - exact) > 0.2
    assert float(often.opacity.std()) < 1e-4
    assert float(often.opacity.mean()) == pytest.approx(exact, abs=0.15)
