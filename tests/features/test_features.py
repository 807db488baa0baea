"""Networks by name."""

from pathlib import Path

import pytest
import torch

from vnca.core.errors import OptionError
from vnca.features import FeatureNetwork, load_network
from vnca.features.weights import Weights, load_weights, save_weights


def test_the_default_is_efficientnet_and_others_have_names() -> None:
    assert load_network().name == "efficientnet"
    edges = load_network("edges")
    assert edges.name == "edges"
    assert isinstance(edges, FeatureNetwork)


def test_any_network_describes_a_picture_with_its_own_layers() -> None:
    picture = torch.rand(1, 3, 32, 40)
    for source in ("efficientnet", "edges"):
        network = load_network(source)
        maps = network.features(picture)
        assert len(maps) == len(network.style_layers)
        assert all(one.dtype == picture.dtype for one in maps)


def test_vgg16_is_imagenets_only_where_it_is_there_already(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    edges = load_weights("edges")
    monkeypatch.setenv("VNCA_CACHE", str(tmp_path))
    assert load_network("vgg16").name == "edges"
    assert "--features imagenet" in capsys.readouterr().err
    fetched = Weights("imagenet", "0" * 64, edges.mean, edges.tensors)
    save_weights(fetched, tmp_path / "vgg16_imagenet.safetensors")
    assert load_network("vgg16").name == "imagenet"


def test_an_unknown_name_lists_what_is_known() -> None:
    with pytest.raises(OptionError, match=r"'efficentnet'.*efficientnet.*edges.*imagenet"):
        load_network("efficentnet")
