"""The model file: a rule as safetensors with JSON metadata. Data only, never code."""

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

import vnca
from vnca.core import Box, FloatArray
from vnca.core.errors import ModelError, OptionError, ShapeError
from vnca.core.files import existing_file, whole_file
from vnca.core.lattice import Lattice, Region
from vnca.engine.automaton import DecoderWeights
from vnca.rule import CONDITIONING, Decoder, Rule, RuleConfig, Scales
from vnca.rule.conditioning import (
    STYLES,
    Conditioning,
    conditioning_named,
    is_known,
    register_conditioning,
)

FORMAT_VERSION = 5
"""The newest that is read. A model is written in the oldest that holds it: 2 with a decoder, 3 if
it is conditioned on anything else than position, density and velocity, 4 if its state is carried
along, 5 if it mixes several styles."""
MODEL_NAME = "model.safetensors"
"""Name of the model in a run folder."""
CONFIG_NAME = "config.json"
"""Name, in a run folder, of what was asked for."""

STYLES_TOLD = "styles"
"""What a model tells of each style of a rule that mixes several: objects, each with a `name`."""
FORMER_NAMES = {"reach": "dilation"}
"""What fields of a rule are called that earlier models call otherwise."""

_METADATA = "vnca"
_WEIGHTS = ("hidden", "bias", "output")
_STYLE = "style"
_STYLES = (_STYLE, *(f"{_STYLE}.{number}" for number in range(2, len(STYLES) + 1)))
_DECODER = tuple(f"decoder.{name}" for name in DecoderWeights._fields)
_FARTHEST = 1e30  # in the world, or of a cell's size
_EXACT = 2**53  # whole numbers up to here are floats

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Model:
    """A rule with its provenance.

    Attributes:
        rule: The rule.
        training: How it came about: style, features, preset, iterations, seed, …; JSON values.
        style: sRGB thumbnail `[r, c, 3]` of the style picture, uint8, or None; of a rule that mixes
            several, that of the first.
        more_styles: Those of its others.
        version: The `vnca` that wrote the file.
        inputs: What it was trained on, where that is known: under `frame` a path or a `Volume`,
            under `style` a path or an array `[r, c, 3]` of linear RGB. It is not in the file.
    """

    rule: Rule
    training: dict[str, Any] = field(default_factory=dict)
    style: NDArray[np.uint8] | None = None
    version: str = vnca.__version__
    inputs: Mapping[str, Any] = field(default_factory=dict)
    more_styles: tuple[NDArray[np.uint8], ...] = ()

    @property
    def thumbnails(self) -> tuple[NDArray[np.uint8], ...]:
        """Those of all its style pictures."""
        return () if self.style is None else (self.style, *self.more_styles)

    @property
    def style_names(self) -> list[str]:
        """What its styles are called, in their order; of a single style nothing is told."""
        return [entry["name"] for entry in self.training.get(STYLES_TOLD, ())]

    def save(self, path: str | Path) -> None:
        """Write the model file, whole or not at all.

        Raises:
            OutputError: If it cannot be written.
        """
        with whole_file(Path(path)) as temporary:
            # Not by safetensors itself, which has an error of its own for a full disk.
            temporary.write_bytes(self.encoded())

    def encoded(self) -> bytes:
        """The model file."""
        decoder = self.rule.decoder
        shape = dataclasses.asdict(self.rule.config)
        listed = list(map(listed_conditioning, shape.pop("conditioning")))
        weights = {name: getattr(self.rule, name) for name in _WEIGHTS}
        weights |= dict(zip(_DECODER, decoder.weights, strict=True)) if decoder else {}
        tensors: dict[str, NDArray[Any]] = {
            name: np.ascontiguousarray(array, dtype=np.float32) for name, array in weights.items()
        }
        pictures = map(np.ascontiguousarray, self.thumbnails)
        tensors |= dict(zip(_STYLES, pictures, strict=False))
        # One entry: safetensors keeps several in no order, and equal models are equal bytes.
        metadata = {
            _METADATA: json.dumps(
                {
                    "format_version": _oldest_format(self.rule),
                    "version": self.version,
                    "rule": shape,
                    "conditioning": listed,
                    "scales": dataclasses.asdict(self.rule.scales),
                    **_described(self.rule.place),
                    "training": self.training,
                }
            )
        }
        return save(tensors, metadata=metadata)

    @classmethod
    def load(cls, path: str | Path, *, to_describe: bool = False) -> "Model":
        """Read a model file, or the model in a run folder.

        Args:
            path: The file or folder.
            to_describe: Also read models that are conditioned on what this program cannot compute:
                they can be looked at, not painted with.

        Raises:
            FileFormatError: If the file is missing or empty.
            ModelError: If it is not a model, of a newer format, or inconsistent.
        """
        path = Path(path)
        if path.is_dir():
            if not (path / MODEL_NAME).exists():
                raise ModelError(f"{path}: no {MODEL_NAME} in this folder; is it a training run?")
            path = path / MODEL_NAME
        existing_file(path)
        try:
            with safe_open(path, framework="numpy") as file:
                metadata = file.metadata() or {}
                expected = {*_WEIGHTS, *_DECODER, *_STYLES}
                known = [name for name in file.keys() if name in expected]  # noqa: SIM118
                tensors = {name: file.get_tensor(name) for name in known}
        # Types that numpy lacks raise the last two.
        except (SafetensorError, OSError, ValueError, TypeError, AttributeError) as error:
            raise ModelError(f"{path}: not a vnca model ({error})") from error
        if _METADATA not in metadata:
            raise ModelError(f"{path}: a safetensors file, but not a vnca model")
        try:
            described = json.loads(metadata[_METADATA])
            _check_format(path, described["format_version"])
            conditioning = _conditioning(path, described.get("conditioning"), to_describe)
            rule = Rule(
                **{name: _single_precision(name, tensors[name]) for name in _WEIGHTS},
                config=replace(
                    from_record(RuleConfig, _renamed(described["rule"])),
                    conditioning=conditioning,
                ),
                scales=from_record(Scales, described["scales"]),
                place=_place(described.get("place")),
                decoder=_decoder(tensors),
            )
            training, version = dict(described["training"]), str(described["version"])
            _check_styles(training, rule)
        except (KeyError, TypeError, ValueError, RecursionError, OptionError) as error:
            raise ModelError(f"{path}: damaged model metadata ({error})") from error
        except ShapeError as error:
            raise ModelError(f"{path}: {error}") from error
        pictures = [tensors[name] for name in _STYLES if name in tensors]
        if any(each.dtype != np.uint8 or each.shape[2:] != (3,) for each in pictures):
            raise ModelError(f"{path}: the style thumbnail is not an 8-bit picture")
        style, *others = pictures or [None]
        return cls(rule, training, style, version, more_styles=tuple(others))


def _check_styles(training: Mapping[str, Any], rule: Rule) -> None:
    """Raise `ValueError` unless a model tells of as many styles as its rule mixes, by name."""
    told, count = training.get(STYLES_TOLD, []), rule.config.style_count
    if not isinstance(told, list) or not all(isinstance(entry, dict) for entry in told):
        raise ValueError(f"styles {told!r}")
    names = {entry.get("name") for entry in told}
    if len(told) != count or len(names) != count or not all(type(name) is str for name in names):
        raise ValueError(f"styles {told!r} of a rule of {count}")


def _renamed(record: Any) -> Any:
    """The shape of a rule with its fields as they are called now."""
    if not isinstance(record, dict):
        return record
    return {FORMER_NAMES.get(name, name): value for name, value in record.items()}


def _decoder(tensors: dict[str, NDArray[Any]]) -> Decoder | None:
    """All of a decoder, or none.

    Raises:
        KeyError: If there is only a part of one.
    """
    if tensors.keys().isdisjoint(_DECODER):
        return None
    return Decoder(DecoderWeights(*(_single_precision(name, tensors[name]) for name in _DECODER)))


def _oldest_format(rule: Rule) -> int:
    """The oldest format that holds a rule."""
    if rule.config.style_count:
        return 5
    if rule.config.transport:
        return 4
    if rule.config.conditioning != CONDITIONING:
        return 3
    return 1 if rule.decoder is None else 2


def _conditioning(path: Path, record: Any, to_describe: bool) -> tuple[str, ...]:
    """What a rule is conditioned on; models that do not list it are older than the list.

    To describe a model, what is not known becomes known as what cannot be computed.

    Raises:
        ValueError: If it is no list of names, widths and scales.
        ModelError: If this program does not know one of them, or another of its name.
    """
    if record is None:
        return CONDITIONING
    if not isinstance(record, list):
        raise ValueError(f"conditioning {record!r}")
    for entry in record:
        name, width, *scale = entry
        numbers = all(type(each) in (int, float) for each in scale)
        if not isinstance(name, str) or type(width) is not int or len(scale) > 1 or not numbers:
            raise ValueError(f"conditioning {entry!r}")
        if scale and not is_known(name):
            register_conditioning(Conditioning.of_field(name, width=width, scale=scale[0]))
        elif not is_known(name):
            reason = (
                f"{path}: the rule is conditioned on {name}, which this program does not know; "
                "make it known with `vnca.register_conditioning` before"
            )
            if not to_describe:
                raise ModelError(reason)
            register_conditioning(Conditioning(name, width, partial(_refuse, reason)))
        if listed_conditioning(name) != entry:
            raise ModelError(
                f"{path}: the rule is conditioned on {entry} (name, width and scale), and what is "
                f"known by that name is {listed_conditioning(name)}"
            )
    return tuple(name for name, *_ in record)


def _refuse(reason: str, *_: Any) -> Any:
    raise ModelError(reason)


def listed_conditioning(name: str) -> list[Any]:
    """An input as a model lists it: its name and width, and the scale of a named field."""
    known = conditioning_named(name)
    return [name, known.width, *([] if known.scale is None else [known.scale])]


def _described(place: Region | None) -> dict[str, Any]:
    if place is None:
        return {}
    return {"place": {"lattice_to_world": place.lattice.to_world.tolist(), "box": place.box}}


def _place(record: Any) -> Region | None:
    """Where a rule was trained; models that do not tell were written before they did.

    Raises:
        ValueError: If it is nowhere.
    """
    if record is None:
        return None
    to_world, box = np.array(record["lattice_to_world"], float), np.array(record["box"])
    is_affine = to_world.shape == (4, 4) and np.array_equal(to_world[3], (0, 0, 0, 1))
    # Not-a-numbers are not smaller either.
    is_sound = is_affine and (np.abs(to_world) < _FARTHEST).all()
    if not is_sound or not np.linalg.slogdet(to_world)[0]:
        raise ValueError(f"place: lattice_to_world {record['lattice_to_world']!r}")
    if box.shape != (2, 3) or box.dtype.kind != "i" or not (box[0] < box[1]).all():
        raise ValueError(f"place: box {record['box']!r}")
    (x, y, z), (u, v, w) = box.tolist()
    return Region(Lattice(to_world), Box((x, y, z), (u, v, w)))


def from_record(kind: type[T], record: Any) -> T:
    """A dataclass with fields of plain types from what JSON gives for it.

    Raises:
        TypeError: If `record` is no object, or a field is unknown or of another type.
    """
    if not isinstance(record, dict):
        raise TypeError(f"{kind.__name__}: expected an object, got {record!r}")
    hints = get_type_hints(kind)
    for name, value in record.items():
        if name in hints and not _fits(value, hints[name]):
            raise TypeError(f"{name}: {value!r} is of another type")
    sequences = {name for name, hint in hints.items() if get_origin(hint) is tuple}
    return kind(
        **{name: tuple(value) if name in sequences else value for name, value in record.items()}
    )


def _fits(value: Any, hint: Any) -> bool:
    if get_origin(hint) is Literal:
        return value in get_args(hint)
    if get_origin(hint) is tuple:
        return isinstance(value, (list, tuple)) and all(
            _fits(item, get_args(hint)[0]) for item in value
        )
    if alternatives := get_args(hint):
        return any(_fits(value, alternative) for alternative in alternatives)
    if hint is float and type(value) is int:
        return abs(value) <= _EXACT
    return type(value) is hint


def _single_precision(name: str, weights: NDArray[Any]) -> FloatArray:
    if weights.dtype.kind != "f":
        raise ShapeError(f"weights '{name}': expected floats, got {weights.dtype}")
    with np.errstate(over="ignore"):  # the rule refuses what is not finite
        return weights.astype(np.float32)


def _check_format(path: Path, version: Any) -> None:
    if type(version) is not int or version < 1:
        raise ValueError(f"format version {version!r}")
    if version > FORMAT_VERSION:
        raise ModelError(
            f"{path}: model format {version} is newer than this vnca reads ({FORMAT_VERSION}); "
            "upgrade vnca"
        )
