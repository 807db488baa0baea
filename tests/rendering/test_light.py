import math

import numpy as np
import pytest
import torch

from vnca.core.camera import Orthographic
from vnca.core.errors import OptionError, ShapeError
from vnca.rendering.light import OCTAVES, SKY, Light, LightVolume
from vnca.rendering.view import View, lighting, render

SIZE = 24


def ball(radius: float = 8.0, size: int = SIZE) -> torch.Tensor:
    axis = torch.arange(size, dtype=torch.float32) - (size - 1) / 2
    x, y, z = torch.meshgrid(axis, axis, axis, indexing="ij")
    return (radius - (x**2 + y**2 + z**2).sqrt()).clamp(0, 1)


def seen(
    density: torch.Tensor, light: Light | None, *, azimuth: float = 0.0, gamma: float = 2.0
) -> View:
    """White smoke from the front, as large as the picture."""
    middle = (SIZE - 1) / 2
    cast = None if light is None else volume(density, light, gamma=gamma)
    camera = Orthographic((middle, middle, middle), azimuth, 0, height=SIZE)
    white = density.new_ones(*density.shape, 3)
    return render(
        density, white, camera, rows=SIZE, columns=SIZE, gamma=gamma, step=0.5, light=cast
    )


def volume(density: torch.Tensor, light: Light, **options) -> LightVolume:
    return LightVolume(density.numpy(), light, **options)


def at(light: LightVolume, points: torch.Tensor) -> torch.Tensor:
    return lighting(light, points)(points)


def key(azimuth: float, elevation: float) -> Light:
    """A light of strength 1, and none from everywhere."""
    return Light(azimuth, elevation, ambient=0.0)


def behind(depth: float) -> float:
    """What such a light leaves of a colour behind an optical depth, as it is defined."""
    direct = sum(weight * math.exp(-part * depth) for weight, part in OCTAVES)
    facing = sum(weight / (1 + part) for weight, part in OCTAVES)
    return min(direct / facing, 1)


def halves(view: View) -> tuple[float, float]:
    """How bright the smoke is on the left and on the right."""
    left, right = view.colour[..., 0].split(SIZE // 2, dim=1)
    return left.sum().item(), right.sum().item()


@pytest.mark.parametrize("azimuth", [-80.0, 80.0])
def test_a_ball_is_brighter_where_the_light_stands(azimuth: float) -> None:
    left, right = halves(seen(ball(), Light(azimuth, 0.0)))
    bright, dark = (left, right) if azimuth < 0 else (right, left)
    assert bright > 1.2 * dark


def test_a_ball_lit_from_above_is_brighter_there() -> None:
    above, below = seen(ball(), Light(0.0, 80.0)).colour[..., 0].split(SIZE // 2)
    assert above.sum() > 1.2 * below.sum()


def test_the_shading_turns_with_the_light() -> None:
    """A ball looks the same from where the light stands to the same side."""
    here = seen(ball(), Light(50.0, 20.0)).colour
    there = seen(ball(), Light(140.0, 20.0), azimuth=90).colour
    torch.testing.assert_close(here, there, atol=1e-4, rtol=0)
    assert (here - seen(ball(), Light(140.0, 20.0)).colour).abs().max() > 0.1


def test_a_light_of_no_strength_is_none() -> None:
    glowing, lit = seen(ball(), None), seen(ball(), Light(30.0, 30.0, strength=0.0))
    assert torch.equal(glowing.colour, lit.colour)
    assert torch.equal(glowing.depth, lit.depth)


def test_light_leaves_opacity_as_it_is() -> None:
    assert torch.equal(seen(ball(), None).opacity, seen(ball(), Light(30.0, 30.0)).opacity)


def test_thin_smoke_has_its_own_colours() -> None:
    glowing, lit = (seen(ball(), light, gamma=1e-4).colour for light in (None, Light(30.0, 30.0)))
    torch.testing.assert_close(lit, glowing, rtol=1e-3, atol=0)


def test_smoke_that_faces_the_light_has_most_of_its_brightness() -> None:
    middle = SIZE // 2
    assert seen(ball(), Light(0.0, 0.0)).colour[middle, middle, 0] > 0.7


def test_a_slab_throws_a_shadow_on_what_is_behind_it() -> None:
    density = torch.zeros(SIZE, SIZE, SIZE)
    density[14:18, 8:16, 8:16] = 1
    wall = density.clone()
    wall[2:6] = 1
    light = volume(wall, key(90.0, 0.0), gamma=1.0)
    dark, bright = at(light, torch.tensor([[6.0, 12.0, 12.0], [6.0, 2.0, 2.0]])).tolist()
    assert [dark, bright] == pytest.approx([behind(4), behind(0)], rel=0.02)
    assert dark < 0.2 * bright


@pytest.mark.parametrize("spacing", [0.0, 3.0])
@pytest.mark.parametrize(
    "angles", [(0.0, 0.0), (180.0, 0.0), (90.0, 0.0), (270.0, 0.0), (0.0, 90.0), (0.0, -90.0)]
)
def test_light_is_weaker_by_the_smoke_before_a_cell(
    angles: tuple[float, float], spacing: float
) -> None:
    size = 21
    density = torch.full((size,) * 3, 0.5)
    light = volume(density, key(*angles), gamma=0.3, spacing=spacing)
    middle = torch.full((1, 3), (size - 1) / 2)
    expected = behind(0.5 * 0.3 * size / 2)
    assert at(light, middle).item() == pytest.approx(expected, rel=1e-4)


def test_light_that_comes_askew_passes_more_of_a_slab() -> None:
    density = torch.zeros(60, 60, 12)
    density[:, :, 2:10] = 0.5
    light = volume(density, key(30.0, 50.0), gamma=0.3)
    below = torch.tensor([[30.0, 30.0, 1.0]])
    thickness = 8 / math.sin(math.radians(50))
    expected = behind(0.5 * 0.3 * thickness)
    assert at(light, below).item() == pytest.approx(expected, rel=1e-3)


def test_cells_of_any_shape_are_lit_as_their_smoke_lies_in_the_world() -> None:
    place = np.diag([0.1, 0.2, 0.4, 1.0])
    density = torch.full((48, 24, 12), 0.5)
    light = volume(density, key(90.0, 0.0), gamma=2.0, cells_to_world=place, spacing=0.2)
    assert light.shade.shadow.shape == (24 + 2, 24 + 2, 12 + 2)
    # The middle of the twelfth block, of 24 along the light.
    expected = behind(0.5 * 2.0 * 0.2 * 12.5)
    assert at(light, torch.tensor([[22.5, 11.5, 5.5]])).item() == pytest.approx(expected, rel=1e-3)


def test_the_parts_of_the_sky_weigh_as_all_of_it() -> None:
    """Sums over them are the means over the sphere of all polynomials up to the fifth degree."""
    weights, ways = (np.array(part) for part in zip(*SKY, strict=True))
    x, y, z = ways.T
    sums = [weights @ values for values in (x**0, x, x * y, x**2, x**4, x**2 * z**2, x**3 * y**2)]
    assert sums == pytest.approx([1, 0, 0, 1 / 3, 1 / 5, 1 / 15, 0], abs=1e-12)


def test_light_from_everywhere_shows_a_flat_face_as_light_on_it_does() -> None:
    density = torch.zeros(SIZE, SIZE, SIZE)
    density[:, 8:] = 1
    middle = SIZE // 2
    facing, even = (
        seen(density, Light(0.0, 0.0, ambient=ambient), gamma=0.5).colour[middle, middle, 0].item()
        for ambient in (0.0, 1.0)
    )
    assert even == pytest.approx(facing, rel=0.1)


def test_light_from_everywhere_comes_from_nowhere_else() -> None:
    lights = (
        Light(azimuth, elevation, ambient=1.0) for azimuth, elevation in ((0.0, 0.0), (77.0, 33.0))
    )
    here, there = (volume(ball(), light, gamma=2.0).shade.shadow for light in lights)
    np.testing.assert_array_equal(here, there)


def test_hollows_are_darker_than_what_is_around_them() -> None:
    density = torch.zeros(SIZE, SIZE, SIZE)
    density[:, 8:] = 1
    density[10:14, 8:16, 10:14] = 0
    light = volume(density, Light(0.0, 0.0, ambient=1.0), gamma=2.0)
    hollow, face = at(light, torch.tensor([[12.0, 16.0, 12.0], [4.0, 8.0, 4.0]])).tolist()
    assert hollow < 0.6 * face


def test_shadows_stay_where_they_are_when_the_box_of_a_frame_grows() -> None:
    density = ball(5.0)
    towards = Light(20.0, 40.0)
    one = volume(density, towards, gamma=0.5, spacing=4.0, origin=(3, 5, 9))
    grown = torch.nn.functional.pad(density, (1, 3, 2, 0, 3, 1))
    other = volume(grown, towards, gamma=0.5, spacing=4.0, origin=(0, 3, 8))
    points = 8 + 8 * torch.rand(50, 3, generator=torch.Generator().manual_seed(0))
    moved = points + torch.tensor([3.0, 2.0, 1.0])
    torch.testing.assert_close(at(one, points), at(other, moved), atol=1e-5, rtol=0)


def test_the_same_light_falls_the_same_way_again() -> None:
    views = [seen(ball(), Light(33.0, 21.0)).colour for _ in range(2)]
    assert torch.equal(*views)


def test_a_shader_is_lit_as_an_array_is() -> None:
    density, middle = ball(), (SIZE - 1) / 2
    light = volume(density, Light(60.0, 30.0), gamma=2.0)
    camera = Orthographic((middle, middle, middle), 0, 0, height=SIZE)
    colours = (
        torch.ones(*density.shape, 3),
        lambda points: (torch.ones(len(points)), torch.ones(len(points), 3)),
    )
    options = {"rows": SIZE, "columns": SIZE, "gamma": 2.0, "light": light}
    array, shader = (render(density, colour, camera, **options).colour for colour in colours)
    torch.testing.assert_close(array, shader, atol=2e-3, rtol=0)


def test_light_of_other_smoke_is_refused() -> None:
    light = volume(ball(), Light(0.0, 0.0), gamma=1.0)
    camera = Orthographic((0, 0, 0), 0, 0, height=SIZE)
    density = torch.ones(4, 4, 4)
    with pytest.raises(ShapeError, match=r"light: .*4, 4, 4"):
        render(density, torch.ones(4, 4, 4, 3), camera, rows=4, columns=4, gamma=1.0, light=light)


@pytest.mark.parametrize(
    "wrong",
    [{"strength": -1.0}, {"strength": math.nan}, {"ambient": 1.1}, {"azimuth": math.inf}],
)
def test_a_light_that_cannot_be_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(OptionError, match="light: "):
        Light(**{"azimuth": 0.0, "elevation": 0.0, **wrong})
