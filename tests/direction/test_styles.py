"""Paintings by rules of several styles, and by rules between others."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vnca
from vnca.core.errors import GridError, OptionError
from vnca.direction.shares import completed
from vnca.io import read_smoke
from vnca.rule.conditioning import STYLES
from vnca.rule.library import load_style
from vnca.rule.mixing import ORIGINS
from vnca.rule.model import STYLES_TOLD, Model

Painted = Callable[..., list[dict[str, Any]]]
RIGHT = "x:2.6..4"


@pytest.fixture
def several(model: Path, tmp_path: Path) -> Path:
    """A model of three styles, by chance."""
    plain, random = Model.load(model), np.random.default_rng(3)
    rule = plain.rule
    config = replace(rule.config, conditioning=(*rule.config.conditioning, *STYLES[:3]))
    told = random.normal(0, 0.5, (len(rule.hidden), 3)).astype(np.float32)
    rule = replace(rule, config=config, hidden=np.hstack([rule.hidden, told]))
    names = [{"name": name} for name in ("sea", "fire", "moss")]
    pictures = [np.full((8, 8, 3), 100 + 50 * k, np.uint8) for k in range(3)]
    path = tmp_path / "several.safetensors"
    training = {**plain.training, STYLES_TOLD: names}
    Model(rule, training, pictures[0], more_styles=tuple(pictures[1:])).save(path)
    return path


def colours(frames: list[dict[str, Any]]) -> list[Any]:
    return [frame["Cd"] for frame in frames]


def equal(one: list[dict[str, Any]], other: list[dict[str, Any]]) -> bool:
    return all(map(np.array_equal, colours(one), colours(other)))


def test_a_style_is_asked_for_by_name_or_number(painted: Painted, several: Path) -> None:
    first, fire = painted(several), painted(several, style_mix=("fire",))
    assert not equal(first, fire)
    assert equal(fire, painted(several, style_mix={"2": 1}))
    assert equal(first, painted(several, style_mix=("sea",)))
    assert equal(first, painted(several, style_mix={"fire": 0}))  # the first takes the rest


def test_a_mask_of_ones_and_two_halves_are_the_whole_to_the_bit(
    painted: Painted, several: Path
) -> None:
    fire = painted(several, style_mix=("fire",))
    assert equal(fire, painted(several, style_mix={"fire": "x:-100..-99"}))
    halves = {"fire": f"hold {RIGHT}", "2": f"1 - (hold {RIGHT})"}
    assert equal(fire, painted(several, style_mix=halves))


def test_a_mask_parts_styles_that_do_not_know_of_each_other(
    painted: Painted, several: Path, smoke: Path
) -> None:
    volume = read_smoke(smoke / "ball_0001.vdb")
    x = np.argwhere(volume.density > 0)[:, 0] * 0.5 + 0.5 * volume.origin[0]
    quick = {"warmup": 0, "steps_per_frame": 2}
    sea, fire, both = (
        painted(several, **quick, style_mix=mix)[0]["Cd"]
        for mix in (("sea",), ("fire",), {"fire": "hold x:2..4"})
    )
    # Two steps see two cells far.
    np.testing.assert_array_equal(both[x < 3], sea[x < 3])
    np.testing.assert_array_equal(both[x > 5], fire[x > 5])
    assert np.abs(sea - fire).max() > 0.01


def test_styles_change_from_frame_to_frame(painted: Painted, several: Path) -> None:
    sea, faded = painted(several), painted(several, style_mix={"moss": "1:0 3:1"})
    np.testing.assert_array_equal(sea[0]["Cd"], faded[0]["Cd"])
    assert not np.array_equal(sea[1]["Cd"], faded[1]["Cd"])


def test_shares_are_completed_by_the_first_or_divided_by_their_sum() -> None:
    np.testing.assert_allclose(completed([0.25], [2], 3), [0.75, 0, 0.25])
    np.testing.assert_allclose(completed([1.0, 1.0], [1, 2], 3), [0, 0.5, 0.5])
    np.testing.assert_allclose(completed([0.1, 0.3], [0, 2], 3), [0.25, 0, 0.75])
    np.testing.assert_allclose(completed([0.0], [0], 2), [1, 0])
    mask = np.array([0, 0.5, 1], np.float32)
    np.testing.assert_allclose(completed([mask], [1], 2), [[1, 0], [0.5, 0.5], [0, 1]])
    np.testing.assert_allclose(completed([mask, 0.5], [1, 2], 3).sum(1), 1)


def test_what_cannot_be_mixed_is_told_in_a_line(
    painted: Painted, several: Path, model: Path
) -> None:
    for mix, why in (
        ({"lava": 1}, "`style_mix` lava: the model has the styles 1 sea, 2 fire, 3 moss"),
        ({"fire": 2}, "`style_mix.fire` 2: 2: must be from 0 to 1"),
        ({"fire": "@"}, "style_mix.fire"),
        (("=1",), "`style_mix`"),
    ):
        with pytest.raises(OptionError, match=why):
            painted(several, style_mix=mix)
    with pytest.raises(OptionError, match="`style_mix` fire: the model has a single style"):
        painted(model, style_mix=("fire",))
    with pytest.raises(GridError, match=r"`style_mix` fire=3 . x"):
        painted(several, style_mix={"fire": "3 * x:0..1->0..1"})


def test_colours_are_edited_by_the_picture_of_the_style_that_is_painted(
    painted: Painted, several: Path
) -> None:
    fire = {"style_mix": ("fire",)}
    edited = painted(several, **fire, recolour=("1=#ff0000",))
    assert not equal(edited, painted(several, **fire))
    with pytest.raises(OptionError, match="the colours of several pictures; name the old colour"):
        painted(several, style_mix={"fire": 0.5}, recolour=("1=#ff0000",))
    painted(several, style_mix={"fire": 0.5}, recolour=("#969696=#ff0000",))


def test_a_painting_of_mixed_styles_goes_on_to_the_same_files(
    several: Path, smoke: Path, tmp_path: Path, read: Any
) -> None:
    options: dict[str, Any] = {
        "warmup": 2,
        "steps_per_frame": 2,
        "style_mix": {"fire": f"advected(smooth {RIGHT})", "moss": "1:0 3:0.5"},
    }
    whole = [f.path for f in vnca.stylize(several, smoke, out=tmp_path / "whole", **options)]
    begun = vnca.stylize(several, smoke, out=tmp_path / "parts", **options)
    next(begun)
    begun.close()  # type: ignore[attr-defined]
    parts = [
        f.path for f in vnca.stylize(several, smoke, out=tmp_path / "parts", resume=True, **options)
    ]
    for one, other in zip(whole, parts, strict=True):
        assert one is not None
        assert other is not None
        np.testing.assert_array_equal(read(one)["Cd"], read(other)["Cd"])


@pytest.fixture
def related(model: Path, tmp_path: Path) -> tuple[Path, Path]:
    """Two models of one origin."""
    plain = Model.load(model)
    paths = tmp_path / "one.safetensors", tmp_path / "two.safetensors"
    for seed, path in enumerate(paths):
        output = plain.rule.output
        if seed:
            output = output + np.random.default_rng(seed).normal(0, 0.02, output.shape)
        rule = replace(plain.rule, output=output.astype(np.float32))
        Model(rule, {**plain.training, ORIGINS: ["a texture"]}, plain.style).save(path)
    return paths


def test_weights_are_mixed_frame_by_frame(painted: Painted, related: tuple[Path, Path]) -> None:
    one, two = related
    assert equal(painted(one), painted(one, blend={str(two): 0}))
    assert equal(painted(two), painted(one, blend=(str(two),)))
    faded = painted(one, blend={str(two): "1:0 3:1"})
    np.testing.assert_array_equal(faded[0]["Cd"], painted(one)[0]["Cd"])
    between = painted(one, blend={str(two): 0.5})
    assert not equal(between, painted(one))
    assert not equal(between, painted(two))


def test_weights_that_have_nothing_in_common_are_not_mixed(
    painted: Painted, model: Path, related: tuple[Path, Path]
) -> None:
    with pytest.raises(OptionError, match="`blend` ink: its rule is shaped otherwise"):
        painted(model, blend=("ink",))
    with pytest.raises(OptionError, match="does not tell that it began with the same texture"):
        painted(load_style("frost"), blend=("ink",))
    with pytest.raises(OptionError, match="the same weights everywhere"):
        painted(related[0], blend={str(related[1]): RIGHT})
    with pytest.raises(OptionError, match="`blend` nowhere: no such file, nor a style"):
        painted(model, blend=("nowhere",))
