"""Does the appearance loss tell how much a picture looks like the style image?"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image
from torch import Tensor

import vnca
from vnca.core import FloatArray
from vnca.core.colour import linear_to_srgb, srgb_to_linear
from vnca.core.errors import OptionError, ShapeError
from vnca.features import FeatureNetwork, load_network
from vnca.losses import luma
from vnca.losses.appearance import Appearance, AppearanceConfig, AppearanceLoss

SIZE = 48
# The deeper ones take most of the time.
LAYERS = {"edges": ("relu1_1", "relu2_1", "relu3_1"), "efficientnet": ("stem", "block1", "block3")}


@pytest.fixture(scope="module", params=LAYERS)
def network(request: pytest.FixtureRequest) -> FeatureNetwork:
    return load_network(request.param)


@pytest.fixture(scope="module")
def painting() -> FloatArray:
    with Image.open(Path(vnca.__file__).parent / "data" / "vangogh_cafe_terrace.webp") as image:
        encoded = np.asarray(image.convert("RGB"), np.float32) / 255
    return srgb_to_linear(encoded).astype(np.float32)


@pytest.fixture(scope="module")
def loss(network: FeatureNetwork, painting: FloatArray) -> AppearanceLoss:
    return AppearanceLoss(network, painting, AppearanceConfig(**few(network)), SIZE)


def few(network: FeatureNetwork, count: int = 3) -> dict[str, Any]:
    """The picture as large as the view, and few layers."""
    return {"layers": LAYERS[network.name][:count], "style_scale": 1.0}


def generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)


def as_picture(linear: FloatArray) -> Tensor:
    encoded = linear_to_srgb(linear).astype(np.float32)
    return torch.from_numpy(encoded).permute(2, 0, 1)[None]


def reduced(painting: FloatArray, shorter: int = SIZE) -> Tensor:
    """The painting as the loss sees it, cropped to a square."""
    linear = torch.from_numpy(painting).permute(2, 0, 1)[None]
    rows, columns = painting.shape[:2]
    scale = shorter / min(rows, columns)
    size = [round(rows * scale), round(columns * scale)]
    small = torch.nn.functional.interpolate(linear, size, mode="bilinear", antialias=True)
    return as_picture(small[0, :, :shorter, :shorter].permute(1, 2, 0).clamp(0, 1).numpy())


def noise(seed: int = 0, batch: int = 1) -> Tensor:
    return torch.rand(batch, 3, SIZE, SIZE, generator=torch.Generator().manual_seed(seed))


def opaque(picture: Tensor) -> Tensor:
    return torch.ones(len(picture), *picture.shape[2:])


def measured(loss: AppearanceLoss, picture: Tensor, opacity: Tensor | None = None) -> Appearance:
    return loss(picture, opaque(picture) if opacity is None else opacity, generator())


def test_the_painting_itself_is_nearer_than_others(
    loss: AppearanceLoss, painting: FloatArray
) -> None:
    itself = reduced(painting)
    inverted = 1 - itself
    blurred = torch.nn.functional.avg_pool2d(itself, 9, 1, 4, count_include_pad=False)
    values = {
        name: measured(loss, picture)
        for name, picture in {
            "itself": itself,
            "inverted": inverted,
            "blurred": blurred,
            "noise": noise(),
        }.items()
    }
    for name in ("inverted", "blurred", "noise"):
        for term in ("style", "moments", "pixels"):
            if (name, term) != ("blurred", "pixels"):
                assert values["itself"].terms[term] < values[name].terms[term], (name, term)
        assert values["itself"].total < 0.5 * values[name].total, name


def test_grey_painting_differs_in_colour_only(
    network: FeatureNetwork, painting: FloatArray
) -> None:
    grey = (reduced(painting) * torch.tensor([0.299, 0.587, 0.114]).view(1, 3, 1, 1)).sum(1)
    picture = grey[:, None].expand(-1, 3, -1, -1)
    in_colour = AppearanceLoss(
        network, painting, AppearanceConfig(**few(network), grey=False, pixels=0.0), SIZE
    )
    in_grey = AppearanceLoss(
        network, painting, AppearanceConfig(**few(network), colour=False, pixels=0.0), SIZE
    )
    both = AppearanceLoss(network, painting, AppearanceConfig(**few(network), pixels=0.0), SIZE)
    assert measured(in_grey, picture).total < 0.5 * measured(in_colour, picture).total
    moments = [measured(one, picture).terms["moments"] for one in (in_colour, in_grey, both)]
    torch.testing.assert_close(moments[0] + moments[1], moments[2], rtol=1e-3, atol=1e-4)


def test_terms_add_up_and_weights_apply(network: FeatureNetwork, painting: FloatArray) -> None:
    ones = AppearanceConfig(
        **few(network), style=1.0, moments=1.0, distribution=1.0, pixels=1.0, regions=1.0
    )
    plain = measured(AppearanceLoss(network, painting, ones, SIZE), noise())
    assert plain.total.item() == pytest.approx(sum(t.item() for t in plain.terms.values()))
    config = AppearanceConfig(
        **few(network), style=2.0, moments=0.0, distribution=4.0, pixels=3.0, regions=5.0
    )
    weighted = measured(AppearanceLoss(network, painting, config, SIZE), noise())
    assert "moments" not in weighted.terms
    for name, times in {"style": 2, "distribution": 4, "pixels": 3, "regions": 5}.items():
        expected = times * plain.terms[name].item()
        assert weighted.terms[name].item() == pytest.approx(expected, rel=0.1), name


def shuffled(picture: Tensor) -> Tensor:
    """The same pixels in other places."""
    order = torch.randperm(picture[0, 0].numel(), generator=generator())
    return picture.flatten(2)[..., order].view(picture.shape)


def of_distributions(network: FeatureNetwork, painting: FloatArray) -> AppearanceLoss:
    config = AppearanceConfig(
        **few(network), style=0.0, moments=0.0, distribution=1.0, pixels=0.0, regions=1.0
    )
    return AppearanceLoss(network, painting, config, SIZE)


def test_distributions_tell_the_painting_from_others(
    network: FeatureNetwork, painting: FloatArray
) -> None:
    loss, itself = of_distributions(network, painting), reduced(painting)
    near = measured(loss, itself).terms
    assert set(near) == {"distribution", "regions"}
    for name, picture in {"inverted": 1 - itself, "shuffled": shuffled(itself)}.items():
        for term, far in measured(loss, picture).terms.items():
            assert near[term] < 0.7 * far, (name, term)


def test_regions_see_contrast_in_large_shapes(painting: FloatArray) -> None:
    """The same pixels, evenly mixed, have the same palette, and not the same regions."""
    network, itself = load_network("efficientnet"), reduced(painting)
    config = AppearanceConfig(**few(network), style=0.0, moments=0.0, pixels=1.0, regions=1.0)
    loss = AppearanceLoss(network, painting, config, SIZE)
    assert [region.side for region in loss._regions] == [SIZE // 16, SIZE // 8, SIZE // 4]
    near, far = (measured(loss, p).terms for p in (itself, shuffled(itself)))
    assert far["pixels"].item() == pytest.approx(near["pixels"].item(), rel=0.2)
    assert far["regions"] > 1.5 * near["regions"]
    # A picture that has too few squares of a size is not compared by them.
    small = AppearanceConfig(style_scale=0.25, regions=1.0)
    loss = AppearanceLoss(network, painting, small, 512)
    assert [region.side for region in loss._regions] == [512 // 16]


def test_distributions_lead_back_to_the_painting(painting: FloatArray) -> None:
    """Pixels that follow the gradient of regions get the painting's contrast."""
    loss, itself = of_distributions(load_network("efficientnet"), painting), reduced(painting)
    picture = (itself.mean((2, 3), keepdim=True) + 0.1 * (noise() - 0.5)).requires_grad_()
    before = measured(loss, picture).terms["regions"].item()
    adam = torch.optim.Adam([picture], lr=0.02)
    for _ in range(60):
        adam.zero_grad()
        measured(loss, picture).terms["regions"].backward()
        adam.step()
    assert measured(loss, picture).terms["regions"].item() < 0.3 * before
    assert picture.std().item() > 0.7 * itself.std().item()


def test_same_generator_same_loss(loss: AppearanceLoss) -> None:
    assert measured(loss, noise()).total == measured(loss, noise()).total
    other = loss(noise(), opaque(noise()), torch.Generator().manual_seed(1))
    assert measured(loss, noise()).total != other.total


def test_a_batch_is_averaged(loss: AppearanceLoss) -> None:
    pictures = noise(batch=2)
    together = measured(loss, pictures).terms["moments"]
    alone = [measured(loss, pictures[i : i + 1]).terms["moments"] for i in range(2)]
    torch.testing.assert_close(together, (alone[0] + alone[1]) / 2, rtol=1e-3, atol=1e-4)


def test_empty_views_contribute_exactly_nothing(loss: AppearanceLoss) -> None:
    picture = noise().requires_grad_()
    result = measured(loss, picture, torch.zeros(1, SIZE, SIZE))
    assert result.total == 0
    result.total.backward()
    assert picture.grad is not None
    assert picture.grad.abs().max() == 0


def test_an_empty_view_in_a_batch_changes_nothing_for_the_other(loss: AppearanceLoss) -> None:
    pictures = noise(batch=2)
    opacity = opaque(pictures)
    opacity[1] = 0
    with_empty = measured(loss, pictures, opacity).terms["moments"]
    alone = measured(loss, pictures[:1]).terms["moments"]
    torch.testing.assert_close(with_empty, alone / 2, rtol=1e-3, atol=1e-4)


def test_pixels_without_smoke_have_no_say_in_the_palette(
    network: FeatureNetwork, painting: FloatArray
) -> None:
    config = AppearanceConfig(**few(network), style=0.0, moments=0.0, pixels=1.0)
    loss = AppearanceLoss(network, painting, config, SIZE)
    picture = noise().requires_grad_()
    opacity = torch.zeros(1, SIZE, SIZE)
    opacity[:, 10:40, 20:40] = 0.9
    measured(loss, picture, opacity).total.backward()
    assert picture.grad is not None
    touched = picture.grad.abs().sum(1) > 0
    assert touched.any()
    assert not touched[opacity == 0].any()


def test_far_background_has_no_say_in_shallow_layers(
    network: FeatureNetwork, painting: FloatArray
) -> None:
    loss = AppearanceLoss(network, painting, AppearanceConfig(**few(network, 2), pixels=0.0), SIZE)
    picture = noise().requires_grad_()
    opacity = torch.zeros(1, SIZE, SIZE)
    opacity[:, 16:32, 16:32] = 1
    measured(loss, picture, opacity).total.backward()
    assert picture.grad is not None
    far = torch.ones(1, SIZE, SIZE, dtype=torch.bool)
    far[:, 8:40, 8:40] = False
    assert picture.grad.abs().sum(1)[far].max() == 0


@pytest.mark.parametrize("opacity", [0.02, 0.3, 1.0])
@pytest.mark.parametrize("patch", [1, 30])
def test_little_or_thin_smoke_gives_finite_gradients(
    network: FeatureNetwork, painting: FloatArray, opacity: float, patch: int
) -> None:
    config = AppearanceConfig(**few(network, 2))
    loss = AppearanceLoss(network, painting, config, SIZE)
    background = loss.background.clamp(0, 1).sqrt().view(1, 3, 1, 1)
    picture = background.expand(1, 3, SIZE, SIZE).clone().requires_grad_()
    alpha = torch.zeros(1, SIZE, SIZE)
    alpha[:, 15 : 15 + patch, 15 : 15 + patch] = opacity
    result = measured(loss, picture, alpha)
    result.total.backward()
    assert torch.isfinite(result.total)
    assert picture.grad is not None
    assert torch.isfinite(picture.grad).all()
    if opacity * patch > 1:
        assert picture.grad.abs().max() > 0


def test_descent_approaches_the_painting(loss: AppearanceLoss) -> None:
    picture = noise().requires_grad_()
    optimiser = torch.optim.Adam([picture], lr=0.02)
    random, values = generator(), []
    for _ in range(8):
        result = loss(picture, opaque(picture), random)
        optimiser.zero_grad()
        result.total.backward()
        optimiser.step()
        values.append(result.total.item())
    assert values[-1] < 0.8 * values[0]


def test_smaller_strokes_can_be_asked_for(network: FeatureNetwork, painting: FloatArray) -> None:
    """With half the scale, the painting at half the size fits best."""
    config = AppearanceConfig(layers=LAYERS[network.name], style_scale=0.5, pixels=0.0, style=0.0)
    halved = AppearanceLoss(network, painting, config, 2 * SIZE)
    small, large = reduced(painting, SIZE), reduced(painting, 2 * SIZE)
    assert measured(halved, small).total < measured(halved, large).total


def test_the_scale_follows_the_strokes_unless_it_is_given(network: FeatureNetwork) -> None:
    """Stripes of 4 pixels span three cells of two pixels each, and four pixels at least."""
    bright = np.arange(96) // 4 % 2 == 0
    stripes = np.broadcast_to(np.where(bright, 0.8, 0.1)[:, None, None], (96, 96, 3))
    config = AppearanceConfig(layers=LAYERS[network.name])
    loss = AppearanceLoss(network, stripes.astype(np.float32), config, SIZE, cells=SIZE / 2)
    assert 4 * loss.style_scale * SIZE / 96 == pytest.approx(3 * 2, rel=0.1)
    given = AppearanceConfig(layers=LAYERS[network.name], style_scale=1.25)
    assert AppearanceLoss(network, stripes.astype(np.float32), given, SIZE).style_scale == 1.25


def test_a_network_compares_the_layers_of_its_choice(
    network: FeatureNetwork, painting: FloatArray
) -> None:
    own = AppearanceConfig(style_scale=1.0)
    named = AppearanceConfig(style_scale=1.0, layers=network.style_layers)
    assert (
        measured(AppearanceLoss(network, painting, own, SIZE), noise()).total
        == measured(AppearanceLoss(network, painting, named, SIZE), noise()).total
    )


def test_a_layer_of_another_network_is_named(network: FeatureNetwork, painting: FloatArray) -> None:
    config = AppearanceConfig(layers=("relu9_9",), style_scale=1.0)
    with pytest.raises(OptionError, match=rf"'relu9_9'.*'{network.name}'.*`appearance.layers`"):
        AppearanceLoss(network, painting, config, SIZE)


def test_background_is_the_mean_colour(loss: AppearanceLoss, painting: FloatArray) -> None:
    np.testing.assert_allclose(loss.background, painting.mean((0, 1)), rtol=1e-3)


def test_tiny_style_images_are_enlarged(network: FeatureNetwork) -> None:
    tiny = np.random.default_rng(0).random((5, 9, 3), np.float32)
    result = measured(
        AppearanceLoss(network, tiny, AppearanceConfig(**few(network)), SIZE), noise()
    )
    assert torch.isfinite(result.total)


def test_black_style_image_gives_finite_gradients(network: FeatureNetwork) -> None:
    black = np.zeros((40, 40, 3), np.float32)
    picture = torch.zeros(1, 3, SIZE, SIZE, requires_grad=True)
    measured(
        AppearanceLoss(network, black, AppearanceConfig(**few(network)), SIZE), picture
    ).total.backward()
    assert picture.grad is not None
    assert torch.isfinite(picture.grad).all()


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("style", -1.0),
        ("moments", -1.0),
        ("distribution", -1.0),
        ("pixels", -1.0),
        ("regions", -1.0),
        ("samples", 0),
        ("opacity_threshold", 1.0),
        ("style_scale", 0.0),
        ("style_scale", float("inf")),
    ],
)
def test_impossible_options_are_named(option: str, value: object) -> None:
    with pytest.raises(OptionError, match=f"`appearance.{option.replace('_', '_')}`"):
        AppearanceConfig(**{option: value})  # pyright: ignore[reportArgumentType]


def test_nothing_to_compare_is_refused() -> None:
    with pytest.raises(OptionError, match="colour"):
        AppearanceConfig(colour=False, grey=False)
    with pytest.raises(OptionError, match=r"`appearance\.style`.*nothing is compared"):
        AppearanceConfig(style=0.0, moments=0.0, pixels=0.0)


@pytest.mark.usefixtures("unchecked_shapes")
def test_misshapen_input_is_refused(network: FeatureNetwork, loss: AppearanceLoss) -> None:
    with pytest.raises(ShapeError, match="style image"):
        AppearanceLoss(
            network, np.zeros((40, 40), np.float32), AppearanceConfig(**few(network)), SIZE
        )
    with pytest.raises(ShapeError, match="opacity"):
        loss(noise(), torch.ones(1, SIZE, SIZE + 1), generator())


@pytest.mark.usefixtures("unchecked_shapes")
def test_what_is_compared_in_grey_may_be_a_picture_of_its_own(
    network: FeatureNetwork, painting: FloatArray, loss: AppearanceLoss
) -> None:
    picture, opaque = noise(), torch.ones(1, SIZE, SIZE)
    grey = luma(picture)
    assert loss(picture, opaque, generator(), grey).total == measured(loss, picture).total
    # Only what is in grey is another, and only that has a gradient.
    other = luma(noise(5)).requires_grad_()
    config = AppearanceConfig(**{**few(network), "colour": False, "pixels": 0.0})
    grey_alone = AppearanceLoss(network, painting, config, SIZE)
    total = grey_alone(picture, opaque, generator(), other).total
    assert total == measured(grey_alone, noise(5)).total
    total.backward()
    assert other.grad is not None
    assert other.grad.abs().sum() > 0
    with pytest.raises(ShapeError, match="grey"):
        loss(picture, opaque, generator(), grey[..., 1:])


def test_a_density_in_grey_that_nothing_looks_at_is_refused() -> None:
    assert AppearanceConfig(grey_source="density").shows_density
    assert not AppearanceConfig().shows_density
    with pytest.raises(OptionError, match=r"`appearance\.grey_source`"):
        AppearanceConfig(grey=False, grey_source="density")
