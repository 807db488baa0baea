import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from vnca.automaton.model import MODEL_NAME, Model
from vnca.automaton.rule import Rule, RuleConfig, Scales
from vnca.errors import FileFormatError, ModelError, OptionError, ShapeError


@pytest.fixture
def model() -> Model:
    config = RuleConfig(channels=5, hidden=7, position_prior=False, sobel_divisor=8)
    rule = Rule.initial(config, Scales(density=2, velocity=3, gamma=0.25), seed=1)
    style = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
    return Model(rule, {"style": "a.png", "iterations": 12}, style)


def test_a_model_comes_back_as_it_was_saved(model: Model, tmp_path: Path) -> None:
    model.save(tmp_path / MODEL_NAME)
    back = Model.load(tmp_path)  # the folder of a run serves as well as the file
    for name in ("hidden", "bias", "output"):
        np.testing.assert_array_equal(getattr(back.rule, name), getattr(model.rule, name))
    assert back.rule.config == model.rule.config
    assert back.rule.scales == model.rule.scales
    assert back.training == model.training
    assert back.style is not None
    np.testing.assert_array_equal(back.style, model.style)


def test_saving_twice_gives_the_same_bytes(model: Model, tmp_path: Path) -> None:
    model.save(tmp_path / "a.safetensors")
    model.save(tmp_path / "b.safetensors")
    assert (tmp_path / "a.safetensors").read_bytes() == (tmp_path / "b.safetensors").read_bytes()


def rewritten(path: Path, **changes: Any) -> None:
    """The model file with some of its metadata replaced, or left out where None."""
    with safe_open(path, framework="numpy") as file:
        described = json.loads(file.metadata()["vnca"])
    described.update(changes)
    described = {name: value for name, value in described.items() if value is not None}
    save_file(load_file(path), path, metadata={"vnca": json.dumps(described)})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format_version": 2}, r"newer than this vnca reads.*upgrade"),
        ({"format_version": "one"}, "damaged"),
        ({"rule": None}, "damaged"),
        ({"rule": 3}, "damaged"),
        ({"rule": {"no_such_field": 1}}, "damaged"),
        ({"rule": {"channels": 2}}, "damaged"),
        ({"scales": {"density": 0.0}}, r"damaged.*density"),
        ({"scales": {"gamma": float("nan")}}, r"damaged.*gamma"),
        ({"rule": {"channels": 5, "hidden": 8}}, "expected shape"),
    ],
)
def test_a_model_that_cannot_be_used_is_one_clear_line(
    model: Model, tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    path = tmp_path / "model.safetensors"
    model.save(path)
    rewritten(path, **changes)
    with pytest.raises(ModelError, match=words) as caught:
        Model.load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_models_are_refused(tmp_path: Path, model: Model) -> None:
    path = tmp_path / "model.safetensors"
    with pytest.raises(FileFormatError, match="no such file"):
        Model.load(path)
    with pytest.raises(ModelError, match="is it a training run"):
        Model.load(tmp_path)
    path.write_bytes(b"not a model at all")
    with pytest.raises(ModelError, match="not a vnca model"):
        Model.load(path)
    save_file({"a": np.zeros(3)}, path)
    with pytest.raises(ModelError, match="not a vnca model"):
        Model.load(path)
    model.save(path)
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(ModelError, match="not a vnca model"):
        Model.load(path)


def test_weights_that_are_not_finite_are_refused(model: Model) -> None:
    weights = {n: getattr(model.rule, n).copy() for n in ("hidden", "bias", "output")}
    weights["bias"][3] = np.nan
    with pytest.raises(ShapeError, match=r"bias.*finite"):
        Rule(**weights, config=model.rule.config)


@pytest.mark.parametrize("wrong", [{"channels": 3}, {"hidden": 0}, {"update_probability": 0.0}])
def test_impossible_hyperparameters_name_their_option(wrong: dict[str, float]) -> None:
    (name,) = wrong
    with pytest.raises(OptionError, match="--" + name.replace("_", "-")):
        RuleConfig(**wrong)  # type: ignore[arg-type]
