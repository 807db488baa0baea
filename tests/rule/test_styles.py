"""Rules and models of several styles."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open

from vnca.core import FloatArray
from vnca.core.errors import ModelError, OptionError
from vnca.core.volume import Volume
from vnca.engine import open_session
from vnca.engine.domain import Domain
from vnca.rule import CONDITIONING, Rule, RuleConfig, Scales
from vnca.rule.conditioning import STYLES, in_shares, priors
from vnca.rule.model import STYLES_TOLD, Model
from vnca.rule.styles import alone, in_style, names_of, style_number

NAMES = ["sea", "fire", "moss"]
CONFIG = RuleConfig(channels=5, hidden=7, conditioning=(*CONDITIONING, *STYLES[:3]))


def rule() -> Rule:
    random = np.random.default_rng(0)
    plain = Rule.initial(CONFIG, Scales(density=2), seed=1)
    output = random.normal(0, 0.3, plain.output.shape).astype(np.float32)
    return replace(plain, output=output)


@pytest.fixture
def model() -> Model:
    told = [{"name": n, "style": f"{n}.png", "picture_cells": 9.0 + k} for k, n in enumerate(NAMES)]
    training = {"style": "all of them", "seed": 3, STYLES_TOLD: told}
    pictures = [np.full((4, 6, 3), 50 * k, np.uint8) for k in range(3)]
    return Model(rule(), training, pictures[0], more_styles=tuple(pictures[1:]))


def smoke() -> Volume:
    random = np.random.default_rng(0)
    density = random.random((4, 3, 5)).astype(np.float32)
    velocity = random.normal(size=(4, 3, 5, 3)).astype(np.float32)
    return Volume(density, velocity, (0, 0, 0), np.eye(4), 1)


def stepped(rule: Rule, shares: FloatArray | None = None) -> FloatArray:
    domain = Domain.from_mask(np.ones((4, 3, 5), bool), (0, 0, 0))
    conditioning = priors(domain, smoke(), rule)
    if shares is not None:
        conditioning = in_shares(conditioning, rule, shares)
    session = open_session(rule.automaton(0), domain, conditioning)
    return session.read(session.run(session.upload(domain.seed(5)), range(6)))


@pytest.mark.parametrize("shares", [(1, 0, 0), (0, 0, 1), (0.5, 0.25, 0.25)])
def test_a_rule_in_one_style_is_a_rule_of_that_style(shares: tuple[float, ...]) -> None:
    mixed = stepped(rule(), np.array(shares, np.float32))
    sole = in_style(rule(), shares)
    assert sole.config.style_count == 0
    assert np.ptp(mixed) > 0.01
    np.testing.assert_allclose(stepped(sole), mixed, atol=1e-5)


def test_a_rule_paints_in_its_first_style_unless_told() -> None:
    first = stepped(rule(), np.array([1, 0, 0], np.float32))
    np.testing.assert_array_equal(stepped(rule()), first)
    assert np.abs(stepped(rule(), np.array([0, 1, 0], np.float32)) - first).max() > 0.01


def test_shares_may_differ_from_cell_to_cell() -> None:
    shares = np.eye(3, dtype=np.float32)[np.arange(60) % 3]
    domain = Domain.from_mask(np.ones((4, 3, 5), bool), (0, 0, 0))
    before = priors(domain, smoke(), rule())
    told = in_shares(before, rule(), shares)
    np.testing.assert_array_equal(told[:, -3:], shares)
    np.testing.assert_array_equal(told[:, :-3], before[:, :-3])
    np.testing.assert_array_equal(before[:, -3:], [[1, 0, 0]] * 60)  # as it was


@pytest.mark.parametrize(
    "conditioning",
    [("style_1",), ("style_2", "style_1"), ("style_1", "style_2", "density"), ("style_2",)],
)
def test_shares_of_styles_come_last_and_in_order(conditioning: tuple[str, ...]) -> None:
    with pytest.raises(OptionError, match="from style_1 on"):
        RuleConfig(conditioning=conditioning)


def test_a_model_of_several_styles_comes_back(model: Model, tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    model.save(path)
    with safe_open(path, framework="numpy") as file:
        assert json.loads(file.metadata()["vnca"])["format_version"] == 5
    back = Model.load(path)
    assert back.style_names == NAMES
    assert back.rule.config == CONFIG
    for ours, theirs in zip(back.thumbnails, model.thumbnails, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert back.encoded() == path.read_bytes()


def test_a_style_alone_is_a_model_that_earlier_programs_read(model: Model, tmp_path: Path) -> None:
    sole = alone(model, 1)
    assert sole.training == {"style": "fire.png", "picture_cells": 10.0, "seed": 3}
    assert sole.style is not None
    assert sole.style.max() == 50
    sole.save(tmp_path / "fire.safetensors")
    with safe_open(tmp_path / "fire.safetensors", framework="numpy") as file:
        assert json.loads(file.metadata()["vnca"])["format_version"] == 1
        assert "style.2" not in file.keys()  # noqa: SIM118
    np.testing.assert_allclose(
        stepped(Model.load(tmp_path / "fire.safetensors").rule),
        stepped(model.rule, np.array([0, 1, 0], np.float32)),
        atol=1e-5,
    )
    assert alone(sole) is sole


@pytest.mark.parametrize(
    "told",
    [
        [],
        [{"name": "sea"}],
        [{"name": "sea"}] * 3,
        [{"name": "sea"}, {"name": "fire"}, {"name": 3}],
        "sea, fire, moss",
        ["sea", "fire", "moss"],
    ],
)
def test_a_model_that_does_not_name_its_styles_is_damaged(
    model: Model, tmp_path: Path, told: object
) -> None:
    path = tmp_path / "model.safetensors"
    replace(model, training={STYLES_TOLD: told}).save(path)
    with pytest.raises(ModelError, match=r"model\.safetensors: damaged model metadata"):
        Model.load(path)


def test_styles_are_meant_by_name_or_number(model: Model) -> None:
    assert [style_number(model, text, "mix") for text in ("sea", "2", "moss")] == [0, 1, 2]
    for text in ("lava", "0", "4", ""):
        with pytest.raises(OptionError, match="has the styles 1 sea, 2 fire, 3 moss"):
            style_number(model, text, "mix")
    with pytest.raises(OptionError, match="`mix` sea: the model has a single style"):
        style_number(alone(model), "sea", "mix")


def test_styles_are_called_like_their_pictures_and_each_otherwise() -> None:
    paths = [Path("a/deep sea.jpg"), Path("b/deep sea.png"), Path("7.png"), Path("=.png")]
    names = names_of(paths)
    assert names == ["deep_sea", "deep_sea_2", "7_3", "style_4"]
