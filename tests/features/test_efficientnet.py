"""EfficientNet-lite0's activations, and its weights."""

import importlib.metadata
from pathlib import Path

import pytest
import torch
from torch import Tensor

from vnca.core.errors import BackendUnavailableError, FileFormatError, OptionError, ShapeError
from vnca.features import FeatureNetwork
from vnca.features import efficientnet as module
from vnca.features.download import file_sha256, installed_file
from vnca.features.efficientnet import FILE, LAYERS, PACKAGE, SHA256, STYLE_LAYERS, EfficientNet

# Shape, mean, root mean square, and four channels at (rows // 2, columns // 3), as the package
# `efficientnet-lite-pytorch` 0.1.0 computes them of `waves`.
PUBLISHED = {
    "stem": ((32, 32, 48), 2.137256, 2.910522, [0.59118, 3.47467, 0.0, 3.0926]),
    "block1": ((96, 32, 48), 2.061654, 2.655897, [0.0, 0.0, 0.0, 2.30045]),
    "block3": ((144, 16, 24), 1.319435, 2.191575, [0.16421, 6.0, 0.0, 0.0]),
    "block5": ((240, 8, 12), 0.908306, 1.587784, [2.38961, 0.0, 0.0, 0.0]),
    "block8": ((480, 4, 6), 1.071218, 1.858011, [1.72729, 5.38041, 2.65959, 3.74445]),
    "block11": ((672, 4, 6), 0.244644, 0.678649, [0.0, 0.0, 2.43236, 0.0]),
    "block15": ((1152, 2, 3), 0.370151, 0.958051, [0.0, 0.0, 0.0, 0.0]),
}


@pytest.fixture(scope="module")
def network() -> EfficientNet:
    return EfficientNet.load()


@pytest.fixture(scope="module")
def state() -> dict[str, Tensor]:
    path = installed_file("efficientnet", PACKAGE, "0.1.0", FILE)
    return torch.load(path, weights_only=True)


def waves() -> Tensor:
    rows, columns = torch.arange(32.0)[:, None], torch.arange(48.0)
    waves = [torch.sin(k * rows / 3 + columns / (2 + k)) for k in range(3)]
    return (1 + torch.stack(waves)[None]) / 2


def noise(rows: int, columns: int, batch: int = 1) -> Tensor:
    return torch.rand(batch, 3, rows, columns, generator=torch.Generator().manual_seed(0))


def test_activations_are_those_of_another_implementation(network: EfficientNet) -> None:
    for name, maps in zip(PUBLISHED, network.features(waves(), list(PUBLISHED)), strict=True):
        shape, mean, root_mean_square, values = PUBLISHED[name]
        channels, rows, columns = shape
        assert maps.shape[1:] == shape
        assert maps.mean().item() == pytest.approx(mean, rel=1e-4), name
        assert maps.square().mean().sqrt().item() == pytest.approx(root_mean_square, rel=1e-4)
        there = maps[0, :: channels // 4, rows // 2, columns // 3][:4]
        torch.testing.assert_close(there, torch.tensor(values), rtol=1e-3, atol=1e-4)


def test_maps_divide_pictures_of_any_size(network: EfficientNet) -> None:
    for maps, factor in zip(network.features(noise(37, 53)), (1, 1, 2, 4, 8), strict=True):
        assert maps.shape[2:] == (-(-37 // factor), -(-53 // factor))


def test_layers_come_in_the_order_asked_for(network: EfficientNet) -> None:
    deep, shallow, again = network.features(noise(32, 32), ["block5", "stem", "block5"])
    assert shallow.shape == (1, 32, 32, 32)
    assert torch.equal(deep, again)
    assert torch.equal(deep, network.features(noise(32, 32), LAYERS)[LAYERS.index("block5")])


def test_nothing_is_computed_beyond_the_deepest_layer(network: EfficientNet) -> None:
    run: list[str] = []
    hooks = [
        layer.register_forward_hook(lambda *_, name=name: run.append(name))
        for name, layer in network.named_modules()
        if isinstance(layer, torch.nn.Conv2d)
    ]
    network.features(noise(32, 32), ["stem"])
    assert run == ["stem"]
    run.clear()
    network.features(noise(32, 32), ["block1"])
    for hook in hooks:
        hook.remove()
    assert run == ["stem", "blocks.0.look", "blocks.0.project", "blocks.1.expand"]


def test_pictures_of_a_batch_do_not_mix(network: EfficientNet) -> None:
    images = noise(40, 40, batch=2)
    together = network.features(images)
    for index in range(2):
        for a, b in zip(together, network.features(images[index : index + 1]), strict=True):
            torch.testing.assert_close(a[index : index + 1], b, rtol=1e-4, atol=1e-4)


def test_weights_are_frozen_and_the_picture_is_not(network: EfficientNet) -> None:
    image = noise(32, 32).requires_grad_()
    sum(map.mean() for map in network.features(image)).backward()  # pyright: ignore
    assert image.grad is not None
    assert image.grad.abs().max() > 0
    assert not any(parameter.requires_grad for parameter in network.parameters())


def test_no_style_layer_is_silent(network: EfficientNet) -> None:
    for name, maps in zip(STYLE_LAYERS, network.features(noise(64, 64)), strict=True):
        assert (maps.amax((0, 2, 3)) > 0).float().mean() > 0.3, name


def test_it_is_such_a_network_and_tells_where_it_comes_from(network: EfficientNet) -> None:
    assert isinstance(network, FeatureNetwork)
    assert (network.name, network.origin) == ("efficientnet", SHA256)
    assert network.device == torch.device("cpu")


def test_unknown_layer_lists_what_is_known(network: EfficientNet) -> None:
    with pytest.raises(OptionError, match=r"'relu1_1'.*'efficientnet'.*stem, block1.*block15"):
        network.features(noise(32, 32), ["relu1_1"])
    with pytest.raises(OptionError, match="block0"):  # which does not widen its input
        network.features(noise(32, 32), ["block0"])


@pytest.mark.usefixtures("unchecked_shapes")
@pytest.mark.parametrize("shape", [(1, 3, 31, 64), (1, 1, 64, 64), (3, 64, 64)])
def test_pictures_that_do_not_fit_are_refused(
    network: EfficientNet, shape: tuple[int, ...]
) -> None:
    with pytest.raises(ShapeError, match="at least 32"):
        network.features(torch.zeros(shape))


def test_missing_package_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "distribution", missing)
    with pytest.raises(BackendUnavailableError, match=rf"make setup.*--no-deps {PACKAGE}==0\.1\.0"):
        EfficientNet.load()


def test_another_file_in_its_place_is_not_even_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "weights.pth"
    torch.save({"_conv_stem.weight": print}, path)
    monkeypatch.setattr(module, "installed_file", lambda *_: path)
    with pytest.raises(FileFormatError, match=f"weights.pth: not the file.*{SHA256[:8]}"):
        EfficientNet.load()


@pytest.mark.parametrize("change", ["missing", "misshapen", "infinite"])
def test_weights_of_another_network_are_refused(state: dict[str, Tensor], change: str) -> None:
    key = "_blocks.3._project_conv.weight"
    changed = {
        "missing": {name: value for name, value in state.items() if name != key},
        "misshapen": {**state, key: state[key][:8]},
        "infinite": {**state, key: torch.full_like(state[key], torch.inf)},
    }
    with pytest.raises(FileFormatError, match=r"_blocks\.3\._project_conv"):
        EfficientNet(changed[change], "")


def test_the_file_is_the_one_that_is_locked() -> None:
    assert file_sha256(installed_file("efficientnet", PACKAGE, "0.1.0", FILE)) == SHA256
    locks = Path(__file__).parents[2] / "requirements" / "weights.txt"
    assert f"{PACKAGE}=={module.VERSION} \\" in locks.read_text()
