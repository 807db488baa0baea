"""The styles of a model that mixes several: how they are called, and each as a model of its own."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vnca.core.errors import OptionError
from vnca.engine.automaton import FILTERS
from vnca.rule import Rule
from vnca.rule.model import STYLES_TOLD, Model


def names_of(pictures: Sequence[Path]) -> list[str]:
    """What styles are called: like their pictures, without what an option could not name."""
    names: list[str] = []
    for number, picture in enumerate(pictures, 1):
        name = re.sub(r"\W+", "_", picture.stem).strip("_") or f"style_{number}"
        is_taken = name in names or name.isdecimal()
        names.append(f"{name}_{number}" if is_taken else name)
    return names


def style_number(model: Model, wanted: str, option: str) -> int:
    """Which of a model's styles a text means, from 0: its name, or its number from 1.

    Args:
        model: The model.
        wanted: The text.
        option: What messages call what is asked.

    Raises:
        OptionError: If it is none.
    """
    names = model.style_names
    if not names:
        raise OptionError(f"`{option}` {wanted}: the model has a single style")
    if wanted in names:
        return names.index(wanted)
    if wanted.isdecimal() and 1 <= int(wanted) <= len(names):
        return int(wanted) - 1
    listed = ", ".join(f"{number} {name}" for number, name in enumerate(names, 1))
    raise OptionError(f"`{option}` {wanted}: the model has the styles {listed}")


def in_style(rule: Rule, shares: Sequence[float] = ()) -> Rule:
    """The rule of a single style that paints what one of several does everywhere by some shares.

    Args:
        rule: The rule; one of a single style is given back.
        shares: Of each style, together 1; all of the first unless given.
    """
    config, where = rule.config, rule.config.style_columns
    if where is None:
        return rule
    first = FILTERS * config.channels + where.start
    given = np.zeros(config.style_count, np.float32)
    given[: max(1, len(shares))] = shares or 1
    return replace(
        rule,
        hidden=np.ascontiguousarray(rule.hidden[:, :first]),
        bias=rule.bias + rule.hidden[:, first:] @ given,
        config=replace(config, conditioning=config.conditioning[: -config.style_count]),
    )


def alone(model: Model, number: int = 0) -> Model:
    """One of a model's styles as a model of its own, which paints what this one does in it.

    Args:
        model: The model; one of a single style is given back.
        number: Of the style, from 0.
    """
    names = model.style_names
    if not names:
        return model
    told: dict[str, Any] = dict(model.training)
    own = next(entry for entry in told.pop(STYLES_TOLD) if entry.get("name") == names[number])
    shares = [float(each == number) for each in range(len(names))]
    pictures = model.thumbnails
    inputs = {
        name: value for name, value in model.inputs.items() if name not in ("style", STYLES_TOLD)
    }
    known = model.inputs.get(STYLES_TOLD)
    if known is not None and number < len(known):
        inputs["style"] = known[number]
    return replace(
        model,
        rule=in_style(model.rule, shares),
        training={**told, **{name: value for name, value in own.items() if name != "name"}},
        style=pictures[number] if number < len(pictures) else None,
        more_styles=(),
        inputs=inputs,
    )
