"""Pictures of films, drawn by the native core, are held to those of tensors."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

from vnca.core import AnyArray, FloatArray
from vnca.core.camera import Camera, frame_box, world_box
from vnca.core.errors import BackendUnavailableError, OptionError, ShapeError
from vnca.engine import native
from vnca.engine.native.marching import Marcher, Rays
from vnca.rendering import film, march
from vnca.rendering.light import Light, LightVolume
from vnca.rendering.view import render

SHAPE = (13, 9, 11)
SIDES = [(0.0, 0.0, None), (37.0, 25.0, 30.0), (200.0, -70.0, None)]
PLACE = np.array([[0.5, 0, 0.1, 3], [0, 1.0, 0, -2], [0, 0.2, 0.7, 5], [0, 0, 0, 1]])
TOWARDS = Light(azimuth=30.0, elevation=35.0, strength=1.3, ambient=0.2)


def smoke(seed: int = 0, shape: tuple[int, ...] = SHAPE) -> tuple[FloatArray, FloatArray]:
    """Density with holes, thin and dense, to the faces of its box; and colours everywhere."""
    random = np.random.default_rng(seed)
    density = random.uniform(0, 2, shape) ** 2 * (random.uniform(size=shape) < 0.5)
    return density.astype(np.float32), random.uniform(size=(*shape, 3)).astype(np.float32)


def camera_of(
    place: AnyArray | None, azimuth: float, elevation: float, field_of_view: float | None
) -> Camera:
    box = np.full(3, -0.5), np.array(SHAPE) - 0.5
    lower, upper = world_box(*box, np.eye(4) if place is None else place)
    view = {"field_of_view": field_of_view, "aspect": 1.3}
    return frame_box(lower.tolist(), upper.tolist(), azimuth, elevation, **view)


@pytest.mark.parametrize("lit", [False, True])
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("place", [None, PLACE])
@pytest.mark.parametrize("supersampling", [1, 2])
def test_a_picture_of_arrays_is_that_of_tensors(
    lit: bool,
    side: tuple[float, float, float | None],
    place: AnyArray | None,
    supersampling: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    density, colour = smoke()
    light = None
    if lit:
        light = LightVolume(density, TOWARDS, gamma=0.8, cells_to_world=place, spacing=2.0)
    how: dict[str, Any] = {
        "rows": 20, "columns": 26, "gamma": 0.8, "step": 0.4, "cells_to_world": place,
        "supersampling": supersampling, "light": light,
    }  # fmt: skip
    camera = camera_of(place, *side)
    found = film.render(density, colour, camera, **how)
    monkeypatch.setattr("vnca.rendering.native.serves", lambda density: False)
    expected = render(torch.from_numpy(density), torch.from_numpy(colour), camera, **how)
    assert 0.2 < found.opacity.mean() < 0.98
    np.testing.assert_allclose(found.colour, expected.colour, atol=5e-4)
    np.testing.assert_allclose(found.opacity, expected.opacity, atol=5e-4)
    background = [0.2, 0.5, 0.1]
    np.testing.assert_allclose(found.over(background), expected.over(background), atol=5e-4)
    np.testing.assert_array_equal(found.rgba[..., :3], found.colour)
    np.testing.assert_array_equal(found.rgba[..., 3], found.opacity)


def test_light_is_interpolated_as_a_field_is() -> None:
    """In smoke so thin that it hides nothing, each ray is the mean of the light on its way."""
    density = np.full(SHAPE, 1e-4, np.float32)
    white = np.ones((*SHAPE, 3), np.float32)
    random = np.random.default_rng(1)
    light = LightVolume(density, TOWARDS, gamma=1.0)
    shadow = random.uniform(0, 1, light.shade.shadow.shape).astype(np.float32)
    light.shade = light.shade._replace(shadow=shadow)
    points = random.uniform(-0.9, np.array(SHAPE) - 0.1, (500, 3)).astype(np.float32)
    forward = np.tile(np.float32([1, 0, 0]), (500, 1))
    # One sample a ray: the next one would be far beyond the box.
    rays = Rays(points, forward, np.zeros(1, np.float32), 0.0, 1e3, 1.0, 7.0)
    pixels, passes = Marcher(density).film(white, rays, light.shade)
    taken = march.sample(
        torch.from_numpy(shadow)[..., None],
        torch.from_numpy((points + light.shade.first) / light.shade.times).float(),
    )[:, 0]
    shone = light.shade.full - taken.numpy()
    np.testing.assert_allclose(pixels, ((1 - passes) * shone)[:, None].repeat(3, 1), atol=2e-7)
    np.testing.assert_allclose(passes, 1 - 1e-4 * _inside(points), atol=1e-7)


def _inside(points: FloatArray) -> AnyArray:
    """What trilinear interpolation of ones that end at the box gives."""
    top = np.array(SHAPE)
    return np.clip(np.minimum(points + 1, top - points), 0, 1).prod(-1)


@pytest.fixture
def no_native(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "unavailable", lambda precision="float32": "it was not built")


@pytest.fixture
def draw() -> Callable[..., film.Picture]:
    density, colour = smoke()
    camera = camera_of(None, 20.0, 20.0, None)

    def picture(**options: Any) -> film.Picture:
        how = {"rows": 10, "columns": 13, "gamma": 0.8} | options
        return film.render(how.pop("density", density), how.pop("colour", colour), camera, **how)

    return picture


def test_without_the_native_core_torch_draws_the_same(
    draw: Callable[..., film.Picture], request: pytest.FixtureRequest
) -> None:
    density, _ = smoke()
    light = LightVolume(density, TOWARDS, gamma=0.8)
    expected = draw(light=light)
    request.getfixturevalue("no_native")
    for found, one in zip(draw(light=light), expected, strict=True):
        np.testing.assert_allclose(found, one, atol=5e-4)


def test_where_the_native_core_is_torch_draws_nothing(
    draw: Callable[..., film.Picture], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("torch was asked")

    monkeypatch.setattr("vnca.rendering.view.render", refuse)
    draw()


@pytest.mark.usefixtures("no_native")
def test_with_neither_one_line_says_so(
    draw: Callable[..., film.Picture], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(film, "find_spec", lambda name: None)
    with pytest.raises(BackendUnavailableError, match=r"no torch \(pip install .*not built"):
        draw()
    monkeypatch.undo()
    monkeypatch.setattr(film, "find_spec", lambda name: None)
    with pytest.raises(BackendUnavailableError, match="CPU, not on cuda"):
        film.require_renderer("cuda")


def test_a_box_without_smoke_shows_nothing(draw: Callable[..., film.Picture]) -> None:
    picture = draw(density=np.zeros(SHAPE, np.float32))
    assert not picture.rgba.any()


def test_threads_do_not_change_a_bit() -> None:
    density, colour = smoke(3, (24, 20, 22))
    random = np.random.default_rng(2)
    target = random.uniform(0, 20, (3000, 3))
    way = random.normal(size=(3000, 3))
    lines = (a.astype(np.float32) for a in (target - 20 * way, way))
    rays = Rays(*lines, np.zeros(1, np.float32), 0.0, 0.1, 0.05, 7.6)
    shade = LightVolume(density, TOWARDS, gamma=0.5, spacing=2.0).shade
    first, *others = (Marcher(density, threads).film(colour, rays, shade) for threads in (1, 2, 3))
    assert first[1].min() < 0.5
    for other in others:
        for one, two in zip(first, other, strict=True):
            np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("most", [1, 300, 450])
def test_bands_of_a_picture_do_not_change_a_bit(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    density, colour = smoke()
    how: dict[str, Any] = {"rows": 20, "columns": 26, "gamma": 0.8, "supersampling": 2}
    at_once = film.render(density, colour, camera_of(None, *SIDES[1]), **how)
    monkeypatch.setattr(film, "_RAYS_AT_ONCE", most)
    in_bands = film.render(density, colour, camera_of(None, *SIDES[1]), **how)
    np.testing.assert_array_equal(in_bands.rgba, at_once.rgba)


@pytest.mark.parametrize(
    "wrong",
    [{"gamma": -1.0}, {"gamma": np.nan}, {"step": 0.0}, {"rows": 0}],
)
def test_options_out_of_range_are_refused(
    draw: Callable[..., film.Picture], wrong: dict[str, Any]
) -> None:
    with pytest.raises(OptionError, match=r"gamma|step|size"):
        draw(**wrong)


def test_what_does_not_cover_the_same_cells_is_refused(draw: Callable[..., film.Picture]) -> None:
    other, colour = smoke(shape=(4, 5, 6))
    with pytest.raises(ShapeError, match="volume to render"):
        draw(colour=colour)
    with pytest.raises(ShapeError, match="light: "):
        draw(light=LightVolume(other, TOWARDS, gamma=1.0))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("shadow", np.zeros((3, 4), np.float32)),
        ("shadow", np.zeros((0, 4, 4), np.float32)),
        ("shadow", np.zeros((3, 4, 4))),
        ("first", (0.0, 0.0)),
    ],
)
def test_a_light_that_does_not_fit_is_refused(field: str, value: Any) -> None:
    density, colour = smoke()
    shade = LightVolume(density, TOWARDS, gamma=1.0).shade._replace(**{field: value})
    lines = np.zeros((5, 3), np.float32), np.ones((5, 3), np.float32)
    rays = Rays(*lines, np.zeros(1, np.float32), 0.0, 1.0, 1.0, 7.0)
    with pytest.raises(ShapeError, match="filming: "):
        Marcher(density).film(colour, rays, shade)
    with pytest.raises(ShapeError, match="filming: colour"):
        Marcher(density).film(colour[1:], rays, None)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30, 0.0])
def test_light_that_is_nowhere_lights_all(value: float) -> None:
    density, colour = smoke()
    shade = LightVolume(density, TOWARDS, gamma=1.0).shade
    rays = Rays(
        np.float32([[-5, 4, 5]]), np.float32([[1, 0, 0]]), np.zeros(1, np.float32), 0, 0.5, 1, 7
    )
    for field in ("first", "times"):
        odd = shade._replace(**{field: (value, 1.0, 1.0)})
        pixels, _ = Marcher(density).film(colour, rays, odd)
        assert np.isfinite(pixels).all()
