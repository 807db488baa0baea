"""Fuzzing of model files.

An input is, by its first byte, a file; a header and tensors, between which the length is filled
in; or the metadata alone, in an otherwise sound file.
"""

import json
import struct
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import atheris
import numpy as np
from harness import fuzz, lengthened, shortened

with atheris.instrument_imports(include=["vnca", "json"]):
    from vnca.io.smoke_format import SmokeFormat
    from vnca.rule import Decoder, Rule, RuleConfig, Scales
    from vnca.rule.model import Model, from_record

_FILE, _HEADER, _METADATA = range(3)
_BETWEEN = b"\n\n"
_CONFIG = RuleConfig(channels=4, hidden=1)


def build(data: bytes) -> bytes:
    """The file, according to the first byte."""
    kind, rest = data[0] % 3 if data else _FILE, lengthened(data[1:])
    if kind == _FILE:
        return rest
    if kind == _HEADER:
        header, _, tensors = rest.partition(_BETWEEN)
        return struct.pack("<Q", len(header)) + header + tensors
    header, end = {"__metadata__": {"vnca": rest.decode("latin-1")}}, 0
    for name, shape in (("bias", [1]), ("hidden", [1, _CONFIG.inputs]), ("output", [4, 1])):
        begin, end = end, end + 4 * shape[0] * shape[-1]
        header[name] = {"dtype": "F32", "shape": shape, "data_offsets": [begin, end]}
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + bytes(end)


def read(path: Path) -> None:
    """Load a model, and how smoke was read for it."""
    model = Model.load(path)
    assert model.rule.weight_count > 0
    with suppress(TypeError):  # which the command line reports
        from_record(SmokeFormat, model.training.get("smoke", {}))


def limit(size: int) -> int:
    """JSON takes the most: an empty object of three characters is one of 64 bytes."""
    return 32 * size


def seeds() -> Iterator[bytes]:
    """A model with all there can be, whole, in parts, and its metadata."""
    rule = Rule.initial(_CONFIG, Scales(0.5, 2, 3), seed=0)
    training = {"style": "a.png", "smoke": {"fps": 24.0, "up_axis": "z"}, "iterations": 3}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        style, decoder = np.full((1, 2, 3), 7, np.uint8), Decoder.initial(4, units=1, seed=0)
        for model in (
            Model(rule, training),
            Model(rule, training, style),
            Model(replace(rule, decoder=decoder), training, style),
        ):
            model.save(path)
            content = path.read_bytes()
            (length,) = struct.unpack_from("<Q", content)
            header, tensors = content[8 : 8 + length], content[8 + length :]
            yield bytes([_FILE]) + shortened(content)
            yield bytes([_HEADER]) + shortened(header.strip() + _BETWEEN + tensors)
            yield bytes([_METADATA]) + json.loads(header)["__metadata__"]["vnca"].encode()


if __name__ == "__main__":
    fuzz(
        "model", suffix=".safetensors", build=build, read=read, limit=limit, seeds=seeds(),
        longest=4096, between=_BETWEEN,
    )  # fmt: skip
