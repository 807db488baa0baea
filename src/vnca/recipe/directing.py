"""A painting made ready for what is asked of it: layers, masks, palettes and their files."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vnca.core import FloatArray
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import OptionError
from vnca.core.files import existing_file
from vnca.direction import Direction, Inputs
from vnca.direction.colour import Editing
from vnca.direction.guides.picture import strokes_stand
from vnca.direction.values import Constant
from vnca.io import SmokeFormat
from vnca.io.sequence import FrameSequence
from vnca.io.smoke_format import up_axis_of
from vnca.painting import Roll
from vnca.recipe import Watch
from vnca.rule import Rule
from vnca.rule.library import style_or_model
from vnca.rule.mixing import require_blendable
from vnca.rule.model import Model
from vnca.rule.styles import style_number


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
    styles = tuple(style_number(model, n, "style_mix") for n in direction.mixed_names("style_mix"))
    pictures = _pictures(model, direction, styles)
    picture = _together(pictures, direction)
    editing = Editing.asked(direction.recolour, direction.match, picture)
    # Layers are told what the first is told, and draw no layers of their own.
    alone = replace(direction, layers=(), style_mix=(), blend=())
    blend = tuple(_blended(name, model) for name in direction.mixed_names("blend"))
    above = [_layer(name, roll.rule, refine) for name in direction.layer_names]
    rules = [each.rule for each in above]
    layers = tuple(
        replace(
            roll,
            rule=each.rule,
            config=alone,
            inputs=inputs,
            standing=strokes_stand(_linear(each)[:1]),
        )
        for each in above
    )
    roll = replace(roll, styles=styles, blend=blend, standing=strokes_stand(pictures))
    made = replace(roll, layers=layers, inputs=inputs, editing=editing).refined(refine)
    conditions: dict[str, Any] = {}
    if rules:
        conditions["`layers`"] = [list(direction.layers), [digest(rule) for rule in rules]]
    if blend:
        conditions["`blend`"] = [list(direction.blend), [digest(rule) for rule in blend]]
    if files := direction.files(inputs):
        conditions["a file of a mask or a palette"] = [_mark(path) for path in files]
    if editing.changes and picture is not None:
        conditions["the picture of the model"] = hashlib.blake2b(picture.tobytes()).hexdigest()
    return Directed(made, conditions)


def say_styles(model: Model, direction: Direction, watch: Watch) -> None:
    """Say in which style a model of several paints where none is asked for."""
    if model.style_names and not direction.style_mix:
        listed = ", ".join(f"{n} {name}" for n, name in enumerate(model.style_names, 1))
        watch.note(f"painting in the first of the styles {listed}; `style_mix` asks for others")


def _pictures(model: Model, direction: Direction, styles: Sequence[int]) -> list[FloatArray]:
    """The pictures of the styles that are painted, linear RGB."""
    shown, whole = [0, *styles], direction.mixes["style_mix"] == (Constant(1.0),)
    known = dict(enumerate(_linear(model)))
    return [known[n] for n in sorted(set(shown[whole:])) if n in known]


def _linear(model: Model) -> list[FloatArray]:
    """The pictures of all styles of a model, linear RGB."""
    return [srgb_to_linear(each / np.float32(255)) for each in model.thumbnails]


def _together(pictures: Sequence[FloatArray], direction: Direction) -> FloatArray | None:
    """A picture whose colours are those of the painting; of several, their pixels.

    Raises:
        OptionError: If a colour is asked for by its number, and there are several pictures.
    """
    numbered = [text for text in direction.recolour if not text.startswith("#")]
    if len(pictures) > 1 and numbered:
        raise OptionError(
            f"`recolour` {numbered[0]!r}: the painting has the colours of several pictures; name "
            "the old colour itself, as #1b2a49"
        )
    if len(pictures) > 1:
        return np.concatenate([each.reshape(-1, 1, 3) for each in pictures])
    return pictures[0] if pictures else None


def _blended(name: str, first: Model) -> Rule:
    """The rule of a model whose weights are mixed with those of the first.

    Raises:
        OptionError: If there is no such model, or it has nothing in common with the first.
        ModelError: If a file is no model.
    """
    model = style_or_model(name, "blend")
    require_blendable(first, model, f"`blend` {name}")
    return model.rule


def _layer(name: str, first: Rule, refine: int) -> Model:
    """The model of a layer; smoke is as dense for its rule as for the first.

    Raises:
        OptionError: If there is no such style or model, or it cannot be laid over the first.
        ModelError: If a file is no model.
    """
    model = style_or_model(name, "layers")
    if refine > 1 and (model.rule.decoder is None) is not (first.decoder is None):
        raise OptionError(
            f"`layers` {name}: of it and the first rule only one has a decoder, so they run on "
            "different grids; choose `refine` 1"
        )
    return replace(model, rule=model.rule.rescaled(density=first.scales.density))


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
