"""Marching and shading in the native core against what `march` computes in torch."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor

from vnca.core.camera import frame_box
from vnca.core.errors import ShapeError
from vnca.engine import native as core
from vnca.engine.native import decoding, marching
from vnca.rendering import march, native
from vnca.rendering.light import Light, LightVolume
from vnca.rendering.view import Mode, render
from vnca.training.scenes import colours, density_factors

pytestmark = pytest.mark.skipif(
    core.unavailable() is not None, reason="the native kernel was not built"
)
SIDES = ((0.0, 0.0), (90.0, 0.0), (30.0, 40.0), (200.0, -85.0))
HOW = {"near": 0.0, "step": 0.7, "extinction": 0.9}


def smoke(seed: int = 0, shape: tuple[int, int, int] = (7, 9, 6)) -> Tensor:
    """A density with holes, thin and dense."""
    random = np.random.default_rng(seed)
    density = random.uniform(0, 3, shape) * (random.uniform(size=shape) < 0.4)
    return torch.from_numpy((density**2).astype(np.float32))


def rays(density: Tensor, side: tuple[float, float]) -> tuple[Tensor, Tensor, Tensor]:
    """Origins, directions and offsets of a view."""
    camera = frame_box([-0.5] * 3, [n - 0.5 for n in density.shape], *side)
    origins, directions = camera.rays(12, 12)
    offsets = torch.from_numpy(np.random.default_rng(1).uniform(0, 1, 144).astype(np.float32))
    return *(
        torch.from_numpy(a.astype(np.float32).reshape(-1, 3)) for a in (origins, directions)
    ), offsets


def some_rays(count: int) -> marching.Rays:
    points, offsets = np.zeros((count, 3), np.float32), np.zeros(count, np.float32)
    return marching.Rays(points, points, offsets, near=0, step=1, extinction=1, most=1)


def by_ray(found: list[march.Samples] | list[native.Samples]) -> dict[int, list[Tensor]]:
    """Points, densities and depths of each ray that has any."""
    result = {}
    for group in found:
        for at, ray in enumerate(group.ray.tolist()):
            if isinstance(group, march.Samples):
                some = group.row == at
                depth = group.depth[at, group.column[some]]
                values = [group.points[some], group.density[some], depth]
            else:
                some = slice(*group._seen.starts[at : at + 2].tolist())
                depth = torch.from_numpy(group._seen.depth[some])
                values = [group.points[some], group.density[some], depth]
            if len(values[1]):
                result[ray] = values
    return result


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("of_each", [True, False])
def test_the_same_samples_are_found(side: tuple[float, float], of_each: bool) -> None:
    density = smoke()
    origins, directions, offsets = rays(density, side)
    offset = offsets if of_each else 0.25
    asked = (density, origins, directions)
    expected = by_ray(list(march.samples_along(*asked, offset=offset, **HOW)))
    found = by_ray(list(native.samples_along(*asked, offset=offset, **HOW)))
    assert found.keys() == expected.keys()
    for ray, values in expected.items():
        assert len(values[1]) == len(found[ray][1])
        for ours, theirs in zip(found[ray], values, strict=True):
            torch.testing.assert_close(ours, theirs, rtol=0, atol=2e-5)


@pytest.mark.parametrize(("extinction", "expected"), [(0.1, 41), (0.5, 16), (2.0, 5)])
def test_what_is_hidden_is_left_out(extinction: float, expected: int) -> None:
    """The first sample has half of the density of those behind it."""
    density = torch.ones(40, 3, 3)
    asked = (density, torch.tensor([[-5.0, 1.0, 1.0]]), torch.tensor([[1.0, 0.0, 0.0]]))
    how = {"near": 0.0, "step": 1.0, "offset": 0.5, "extinction": extinction}
    for way in (march, native):
        (group,) = way.samples_along(*asked, **how)
        assert len(group.points) == expected


def test_samples_lie_within_a_cell_of_smoke() -> None:
    """So a table of the cells around them needs a cell more on each side, and no other."""
    density = smoke(6, (5, 4, 6)).clamp_min(0.1)
    low, high = torch.tensor([-1.0] * 3), torch.tensor(density.shape, dtype=torch.float32)
    for azimuth in range(0, 360, 15):
        for elevation in (-90.0, -45.0, 0.0, 30.0, 90.0):
            origins, directions, offsets = rays(density, (float(azimuth), elevation))
            for way in (march, native):
                how = {**HOW, "extinction": 0.0, "step": 0.5}
                for offset in (0.0, offsets):
                    for group in way.samples_along(
                        density, origins, directions, offset=offset, **how
                    ):
                        assert bool((group.density > 0).all())
                        assert bool((group.points >= low).all())
                        assert bool((group.points < high).all())


@pytest.mark.parametrize("paper", [False, True])
def test_light_and_its_gradients_are_the_same(paper: bool) -> None:
    density = smoke(2)
    origins, directions, offsets = rays(density, (30.0, 40.0))
    results = []
    for way in (march, native):
        torch.manual_seed(0)
        groups = list(way.samples_along(density, origins, directions, offset=offsets, **HOW))
        assert len(groups) == 1
        (group,) = groups
        painted = (group.density * 1.2).requires_grad_()
        colour = torch.sin(group.points * 3.1).requires_grad_()
        light = group.light(painted, colour, extinction=0.8, paper=paper)
        picture = [torch.zeros(144, 3), torch.ones(144), torch.full((144,), math.inf)]
        picture = [p.index_put((group.ray,), one) for p, one in zip(picture, light, strict=True)]
        weights = torch.linspace(-1, 2, 144)
        (picture[0].sum(1) * weights + picture[1] * weights.flip(0)).sum().backward()
        results.append((*picture, painted.grad, colour.grad))
    for ours, theirs in zip(results[1], results[0], strict=True):
        assert theirs is not None
        assert ours is not None
        torch.testing.assert_close(ours, theirs, rtol=2e-5, atol=2e-5)


@pytest.mark.parametrize("mode", ["emission-absorption", "paper"])
@pytest.mark.parametrize("shaded", [False, True])
@pytest.mark.parametrize("lit", [False, True])
def test_pictures_and_gradients_are_the_same(
    mode: Mode, shaded: bool, lit: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = smoke(3)
    camera = frame_box([-0.5] * 3, [n - 0.5 for n in given.shape], 20.0, 30.0)
    light = None
    if lit:
        light = LightVolume(given.numpy(), Light(azimuth=10.0, elevation=50.0), gamma=1.5)
    results = []
    for natively in (True, False):
        if not natively:
            monkeypatch.setattr(native, "serves", lambda density: False)
        density = given.clone().requires_grad_()
        colour = torch.linspace(0, 1, 3).expand(*given.shape, 3).clone().requires_grad_()

        def shader(points: Tensor) -> tuple[Tensor, Tensor]:
            return 1 + 0.4 * torch.sin(points[:, 0]), torch.cos(points).abs()

        view = render(
            density, shader if shaded else colour, camera, rows=10, columns=8, gamma=1.5,
            mode=mode, offset=0.3, supersampling=2, light=light,
        )  # fmt: skip
        (view.over([0.2, 0.1, 0.3]) ** 2).sum().backward()
        results.append((view.colour, view.opacity, view.depth, density.grad, colour.grad))
    for ours, theirs in zip(*results, strict=True):
        if ours is not None or not shaded:
            torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=1e-4)


def test_threads_do_not_change_a_bit() -> None:
    density = smoke(4, (20, 20, 20))
    origins, directions, offsets = (a.numpy() for a in rays(density, (30.0, 10.0)))
    origins, directions, offsets = (
        np.tile(a.T, 20).T.copy() for a in (origins, directions, offsets)
    )
    results = []
    for threads in (1, 2, 3):
        marcher = marching.Marcher(density.numpy(), threads)
        seen = marcher.along(marching.Rays(origins, directions, offsets, 0, 0.5, 1, 7))
        assert seen is not None
        colour = np.sin(seen.points)
        shading = marching.Shading(seen.starts, seen.density, colour, seen.depth, 0.7, False)
        light = marching.composite(shading, threads=threads)
        back = marching.composite_backward(shading, *light[:2], threads=threads)
        results.append([*seen, *light, *back])
    for others in results[1:]:
        for one, other in zip(results[0], others, strict=True):
            np.testing.assert_array_equal(one, other)


def test_nothing_is_found_without_smoke() -> None:
    density = torch.zeros(3, 4, 5)
    asked = (density, torch.zeros(1, 3), torch.ones(1, 3))
    assert list(native.samples_along(*asked, offset=0.0, **HOW)) == []
    assert marching.Marcher(density.numpy()).along(some_rays(1)) is None


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e30])
def test_rays_that_lead_nowhere_find_nothing(value: float) -> None:
    density = torch.ones(3, 3, 3)
    for origin, direction in ((1.0, value), (value, 1.0), (value, value), (value, 0.0), (1.0, 0.0)):
        asked = (torch.full((1, 3), origin), torch.full((1, 3), direction))
        for group in native.samples_along(density, *asked, offset=0.5, **HOW):
            assert bool(group.points.isfinite().all())
            assert bool(((group.points > -2) & (group.points < 4)).all())


def wrong(change: str) -> Callable[[], object]:
    """A call with an array that does not fit."""
    marcher = marching.Marcher(np.ones((2, 2, 2), np.float32))
    rays = some_rays(4)
    points, offsets = rays.origins, rays.offsets
    starts, depth = np.array([0, 2, 4]), np.zeros(4, np.float32)
    shading = marching.Shading(starts, depth, points, depth, 1.0, False)
    calls = {
        "density": lambda: marching.Marcher(np.ones((2, 2), np.float32)),
        "type": lambda: marching.Marcher(np.ones((2, 2, 2))),
        "rays": lambda: marcher.along(rays._replace(directions=points[:3])),
        "offsets": lambda: marcher.along(rays._replace(offsets=offsets[:3])),
        "step": lambda: marcher.along(rays._replace(step=0)),
        "starts": lambda: marching.composite(shading._replace(starts=np.array([0, 5, 4]))),
        "end": lambda: marching.composite(shading._replace(starts=np.array([0, 2, 5]))),
        "colour": lambda: marching.composite(shading._replace(colour=points[:3])),
        "gradient": lambda: marching.composite_backward(shading, points, offsets),
        "seen": lambda: decoding.show(points, 0.5),
    }
    return calls[change]


@pytest.mark.parametrize(
    "change",
    ["density", "type", "rays", "offsets", "step", "starts", "end", "colour", "gradient", "seen"],
)
def test_arrays_that_do_not_fit_are_refused(change: str) -> None:
    with pytest.raises(ShapeError, match=r"marching|compositing|showing"):
        wrong(change)()


@pytest.mark.parametrize("instructions", decoding.decode_instructions())
def test_what_is_shown_and_its_gradient(instructions: str) -> None:
    random = np.random.default_rng(5)
    seen = torch.from_numpy(random.normal(0, 0.4, (5003, 4)).astype(np.float32))
    # Just inside and just outside of what is clamped, and around the foot of the sRGB curve.
    near = [-0.5001, -0.4999, -0.4597, -0.4595, 0.4999, 0.5001]
    seen[: len(near)] = torch.tensor(near)[:, None]
    reference = seen.clone().requires_grad_()
    expected = colours(reference), density_factors(reference)
    weights = [torch.from_numpy(random.normal(size=e.shape).astype(np.float32)) for e in expected]
    sum((w * e).sum() for w, e in zip(weights, expected, strict=True)).backward()  # type: ignore[union-attr]
    found = decoding.show(seen.numpy(), 0.5, instructions=instructions)
    gradient = decoding.show_backward(
        seen.numpy(), 0.5, *(w.numpy() for w in weights), instructions=instructions
    )
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, theirs.detach().numpy(), rtol=2e-6, atol=1e-7)
    assert reference.grad is not None
    np.testing.assert_allclose(gradient, reference.grad.numpy(), rtol=2e-5, atol=1e-6)
