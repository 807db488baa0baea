"""A painting made ready for what is asked of it: layers, masks, palettes and their files."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vnca.core.colour import srgb_to_linear
from vnca.core.errors import OptionError
from vnca.core.files import existing_file
from vnca.direction import Inputs
from vnca.direction.colour import Editing
from vnca.io import SmokeFormat
from vnca.io.sequence import FrameSequence
from vnca.io.smoke_format import up_axis_of
from vnca.painting import Roll
from vnca.rule import Rule
from vnca.rule.model import Model, load_style, style_names


@dataclass(frozen=True, eq=False)
class Directed:
    """A painting that is ready, and what it is made from beside the smoke and the first rule.

    Attributes:
        roll: The rules, with what is asked of them.
        conditions: What has to be the same to go on, as JSON values by what a user calls it.
    """

    roll: Roll
    conditions: Mapping[str, Any]


def directed(
    roll: Roll, model: Model, refine: int, sequence: FrameSequence | None, smoke: SmokeFormat
) -> Directed:
    """A painting on the grid that is asked for, after a look at all that is asked.

    Args:
        roll: The first rule, and what is asked, on the grid of the smoke.
        model: The model of that rule.
        refine: How many times as fine the grid of the painting is.
        sequence: The frames; None of those in memory.
        smoke: How they are read.

    Raises:
        VncaError: If something that is asked for cannot be had.
    """
    direction = roll.config
    frames = () if sequence is None else sequence
    up = up_axis_of(sequence[0].path, smoke) if sequence else "z"
    paths: dict[int | None, Path] = {frame.number: frame.path for frame in frames}
    inputs = Inputs(paths, up, direction.missing)
    if sequence is not None:
        direction.require(inputs)
    picture = None if model.style is None else srgb_to_linear(model.style / np.float32(255))
    editing = Editing.asked(direction.recolour, direction.match, picture)
    # Layers are told what the first is told, and draw no layers of their own.
    alone = replace(direction, layers=())
    rules = [_layer(name, roll.rule, refine) for name in direction.layer_names]
    layers = tuple(replace(roll, rule=rule, config=alone, inputs=inputs) for rule in rules)
    made = replace(roll, layers=layers, inputs=inputs, editing=editing).refined(refine)
    conditions: dict[str, Any] = {}
    if rules:
        conditions["`layers`"] = [list(direction.layers), [digest(rule) for rule in rules]]
    if files := direction.files(inputs):
        conditions["a file of a mask or a palette"] = [_mark(path) for path in files]
    if editing.changes and model.style is not None:
        conditions["the picture of the model"] = hashlib.blake2b(model.style.tobytes()).hexdigest()
    return Directed(made, conditions)


def _layer(name: str, first: Rule, refine: int) -> Rule:
    """The rule of a layer; smoke is as dense for it as for the first.

    Raises:
        OptionError: If there is no such style or model, or it cannot be laid over the first.
        ModelError: If a file is no model.
    """
    styles = style_names()
    if name not in styles and not Path(name).exists():
        raise OptionError(
            f"`layers` {name}: no such file, nor a style of the library ({', '.join(styles)})"
        )
    model = load_style(name) if name in styles else Model.load(name)
    if refine > 1 and (model.rule.decoder is None) is not (first.decoder is None):
        raise OptionError(
            f"`layers` {name}: of it and the first rule only one has a decoder, so they run on "
            "different grids; choose `refine` 1"
        )
    return model.rule.rescaled(density=first.scales.density)


def digest(rule: Rule) -> str:
    """Equal for rules that paint equally, but for the density that counts as 1."""
    shape = asdict(rule.config)
    place = rule.place and [rule.place.lattice.to_world.tolist(), rule.place.box]
    described = json.dumps([shape, rule.scales.velocity, place])
    found = hashlib.blake2b(described.encode(), digest_size=16)
    decoder = rule.decoder.weights if rule.decoder is not None else ()
    for weights in (rule.hidden, rule.bias, rule.output, *decoder):
        found.update(weights.tobytes())
    return found.hexdigest()


def _mark(path: Path) -> list[Any]:
    """What tells a file from another, and from itself when it has changed."""
    status = existing_file(path).stat()
    return [path.name, status.st_size, status.st_mtime_ns]
