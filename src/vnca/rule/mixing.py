"""Mixing the weights of rules that began with the same weights.

A rule between two that were trained from there paints between both. Rules without such an origin
have nothing in common, and what lies between them paints nothing.

Reference: Wortsman et al. 2022, "Model soups"; Neyshabur et al. 2020, "What is being transferred in
transfer learning?" (models of one origin lie in one basin).
"""

import hashlib
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import OptionError
from vnca.engine.automaton import FILTERS, DecoderWeights
from vnca.rule import Decoder, Rule
from vnca.rule.model import Model

ORIGINS = "origins"
"""What a model tells in its provenance of the weights that its training began with, and what those
had begun with: a list of what `origin` gives."""


def origin(rule: Rule) -> str:
    """What tells weights from others: all but those that conditioning meets, which come and go."""
    found = hashlib.blake2b(digest_size=16)
    perceived = rule.hidden[:, : FILTERS * rule.config.channels]
    decoder = rule.decoder.weights if rule.decoder is not None else ()
    for weights in (perceived, rule.bias, rule.output, *decoder):
        found.update(np.ascontiguousarray(weights).tobytes())
    return found.hexdigest()


def origins(model: Model) -> list[str]:
    """What a model goes back to, itself first."""
    told = model.training.get(ORIGINS)
    earlier = [each for each in told if isinstance(each, str)] if isinstance(told, list) else []
    return [origin(model.rule), *earlier]


def require_blendable(first: Model, other: Model, option: str) -> None:
    """Refuse to mix the weights of two models that have nothing in common.

    Raises:
        OptionError: If they have other shapes, or no origin in common.
    """
    ours, theirs = first.rule, other.rule
    differing = [
        field.name
        for field in fields(ours.config)
        if getattr(ours.config, field.name) != getattr(theirs.config, field.name)
    ]
    units = [0 if rule.decoder is None else rule.decoder.units for rule in (ours, theirs)]
    if differing or units[0] != units[1]:
        name = differing[0] if differing else "decoder"
        raise OptionError(f"{option}: its rule is shaped otherwise than the first, in `{name}`")
    if set(origins(first)).isdisjoint(origins(other)):
        raise OptionError(
            f"{option}: does not tell that it began with the same texture as the first model, so "
            "what lies between them paints nothing; lay it over by `layers`, or train both with "
            "one `init`"
        )


def blended(rules: Sequence[Rule], shares: FloatArray) -> Rule:
    """A rule between others of its shape.

    Args:
        rules: Of the first are the normalisers and the place.
        shares: Of each, together 1.
    """
    first = rules[0]

    def mixed(arrays: Sequence[AnyArray]) -> Any:
        return sum(np.float32(share) * array for share, array in zip(shares, arrays, strict=True))

    decoder = first.decoder
    if decoder is not None:
        weights = zip(*(r.decoder.weights for r in rules if r.decoder is not None), strict=True)
        decoder = Decoder(DecoderWeights(*map(mixed, weights)))
    return replace(
        first,
        hidden=mixed([rule.hidden for rule in rules]),
        bias=mixed([rule.bias for rule in rules]),
        output=mixed([rule.output for rule in rules]),
        decoder=decoder,
    )
