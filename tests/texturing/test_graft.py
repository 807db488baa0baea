"""Textures that start from the rule of another picture."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vnca
from vnca.core import FloatArray
from vnca.core.errors import OptionError
from vnca.recipe import Silent
from vnca.rule import PRIORS
from vnca.rule.library import load_style

SMALL: dict[str, Any] = {
    "iterations": 1,
    "learning_rate": 1e-9,
    "block": 8,
    "longest_rollout": 8,
    "slice": {"size": 32},
    "preview_every": 1000,
}


class Notes(Silent):
    """What is said."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def note(self, line: str) -> None:
        self.lines.append(line)


def test_a_style_is_started_from_without_what_it_knew_of_smoke(style: FloatArray) -> None:
    watch = Notes()
    grafted = vnca.texture(style, graft="ink", watch=watch, **SMALL)
    source = load_style("ink").rule
    assert "starting from the rule of ink" in watch.lines
    assert grafted.training["graft"] == "ink"
    ours, theirs = grafted.rule.hidden, source.hidden
    np.testing.assert_allclose(ours[:, :-PRIORS], theirs[:, :-PRIORS], atol=1e-6)
    np.testing.assert_allclose(ours[:, -PRIORS:], 0, atol=1e-6)
    assert grafted.rule.decoder is not None
    assert source.decoder is not None
    for got, expected in zip(grafted.rule.decoder.weights, source.decoder.weights, strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-6)


def test_a_model_of_ones_own_is_started_from(style: FloatArray, tmp_path: Path) -> None:
    path = tmp_path / "mine.safetensors"
    load_style("frost").save(path)
    grafted = vnca.texture(style, graft=str(path), **SMALL)
    assert grafted.training["graft"] == path.name


def test_a_rule_of_another_shape_is_refused_or_left_out(style: FloatArray) -> None:
    other = {**SMALL, "rule": {"hidden": 16}}
    with pytest.raises(OptionError, match=r"`graft` ink: was trained with `hidden` 96"):
        vnca.texture(style, graft="ink", **other)
    with pytest.raises(OptionError, match=r"`graft` ink: was trained with `decoder` 32"):
        vnca.texture(style, graft="ink", decoder=8, **SMALL)
    watch = Notes()
    model = vnca.texture(style, graft="auto", watch=watch, **other)
    assert model.training["graft"] is None
    assert any("starts from nothing" in line for line in watch.lines)


def test_a_flat_texture_starts_from_a_solid_one_without_its_depth(style: FloatArray) -> None:
    grafted = vnca.texture(style, graft="ink", dimensions=2, motion_field="circular", **SMALL)
    channels = grafted.rule.config.channels
    ours, theirs = grafted.rule.hidden, load_style("ink").rule.hidden
    depth = slice(2 * channels, 3 * channels)
    assert not ours[:, depth].any()
    for kept in (slice(0, 2 * channels), slice(3 * channels, 5 * channels)):
        np.testing.assert_allclose(ours[:, kept], theirs[:, kept], atol=1e-6)
    assert grafted.training["motion_field"] == "circular"
