import dataclasses
import json
import math
import struct
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from vnca.core import AnyArray, Box, FloatArray
from vnca.core.errors import FileFormatError, ModelError, OptionError, OutputError, ShapeError
from vnca.core.lattice import Lattice, Region
from vnca.core.volume import Volume
from vnca.engine.domain import Domain
from vnca.io.smoke_format import SmokeFormat
from vnca.rule import Decoder, Rule, RuleConfig, Scales, conditioning
from vnca.rule.conditioning import Conditioning, register_conditioning
from vnca.rule.model import MODEL_NAME, Model, from_record


@pytest.fixture
def model() -> Model:
    config = RuleConfig(channels=5, hidden=7, position_prior=False, sobel_divisor=8)
    rule = Rule.initial(config, Scales(density=2, velocity=3, gamma=0.25), seed=1)
    style = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
    return Model(rule, {"style": "a.png", "iterations": 12}, style)


@pytest.mark.skipif(sys.platform == "win32", reason="limits")
def test_a_full_disk_is_told_and_leaves_the_earlier_model(model: Model, tmp_path: Path) -> None:
    import resource

    path = tmp_path / MODEL_NAME
    model.save(path)
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        with pytest.raises(OutputError, match=r"model\.safetensors: cannot be written"):
            model.save(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


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


def with_decoder(model: Model) -> Model:
    decoder = Decoder.initial(model.rule.config.channels, units=6, seed=2)
    return replace(model, rule=replace(model.rule, decoder=decoder))


def version_of(path: Path) -> int:
    with safe_open(path, framework="numpy") as file:
        return json.loads(file.metadata()["vnca"])["format_version"]


def test_a_decoder_comes_back_as_it_was_saved(model: Model, tmp_path: Path) -> None:
    path = tmp_path / MODEL_NAME
    decoded = with_decoder(model)
    decoded.save(path)
    assert version_of(path) == 2
    back = Model.load(path).rule.decoder
    assert back is not None
    assert decoded.rule.decoder is not None
    for array, expected in zip(back.weights, decoded.rule.decoder.weights, strict=True):
        assert array.dtype == np.float32
        assert array.tobytes() == expected.tobytes()


def test_a_model_without_a_decoder_can_be_read_by_earlier_versions(
    model: Model, tmp_path: Path
) -> None:
    path = tmp_path / MODEL_NAME
    model.save(path)
    assert version_of(path) == 1
    assert Model.load(path).rule.decoder is None
    rewritten(path, format_version=2)
    assert Model.load(path).rule.decoder is None


@pytest.mark.parametrize(
    ("name", "tensor", "words"),
    [
        ("decoder.third", None, r"damaged.*'decoder\.third'"),
        ("decoder.second_bias", np.zeros(6, np.int8), r"'decoder\.second_bias': expected floats"),
        ("decoder.second_bias", np.full(6, -1e300), "'second_bias': not all finite"),
        ("decoder.third", np.zeros((6, 5), np.float32), "'third': .* fits no network"),
        ("decoder.first", np.zeros((6, 4), np.float32), "expected 5 channels as the rule has"),
        ("decoder.first", np.zeros((6, 0), np.float32), "'first': .* fits no network"),
        ("decoder.first", np.zeros((), np.float32), "'first': .* fits no network"),
        ("decoder.output", np.zeros((5, 6), np.float32), "'output': .* fits no network"),
    ],
)
def test_a_decoder_that_cannot_be_used_is_one_clear_line(
    model: Model, tmp_path: Path, name: str, tensor: AnyArray | None, words: str
) -> None:
    path = tmp_path / MODEL_NAME
    with_decoder(model).save(path)
    with safe_open(path, framework="numpy") as file:
        metadata = file.metadata()
    tensors = load_file(path)
    del tensors[name]
    save_file(tensors if tensor is None else {**tensors, name: tensor}, path, metadata=metadata)
    with pytest.raises(ModelError, match=words) as caught:
        Model.load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_model_tells_where_it_was_trained_and_older_ones_need_not(
    model: Model, tmp_path: Path
) -> None:
    to_world = np.array([[0.1, 0, 0, 1 / 3], [0, 0.1, 0, -7], [0, 0, 0.1, 0], [0, 0, 0, 1.0]])
    place = Region(Lattice(to_world), Box((-4, 0, 2), (5, 9, 30)))
    path = tmp_path / MODEL_NAME
    dataclasses.replace(model, rule=dataclasses.replace(model.rule, place=place)).save(path)
    back = Model.load(path).rule.place
    assert back is not None
    assert back.box == place.box
    np.testing.assert_array_equal(back.lattice.to_world, to_world)
    rewritten(path, place=None)
    assert Model.load(path).rule.place is None


PLACE = {"lattice_to_world": np.eye(4).tolist(), "box": [[0, 0, 0], [2, 3, 4]]}


@pytest.mark.parametrize(
    "place",
    [
        3,
        {"box": [[0, 0, 0], [2, 3, 4]]},
        {**PLACE, "lattice_to_world": np.eye(3).tolist()},
        {**PLACE, "lattice_to_world": np.diag([1, 0, 1, 1]).tolist()},
        {**PLACE, "lattice_to_world": np.diag([1, 1e300, 1, 1]).tolist()},
        {**PLACE, "lattice_to_world": np.diag([1, np.nan, 1, 1]).tolist()},
        {**PLACE, "lattice_to_world": np.diag([1, 1, 1, 2]).tolist()},
        {**PLACE, "lattice_to_world": [[1], [2, 3]]},
        {**PLACE, "box": [[0, 0, 0], [2, 0, 4]]},
        {**PLACE, "box": [[0, 0, 0], [2, 1.5, 4]]},
        {**PLACE, "box": [[0, 0], [2, 1]]},
        {**PLACE, "box": [[0, 0, 0], [2, 1, 10**30]]},
    ],
)
def test_a_place_that_is_nowhere_is_damage(model: Model, tmp_path: Path, place: Any) -> None:
    path = tmp_path / MODEL_NAME
    model.save(path)
    rewritten(path, place=place)
    with pytest.raises(ModelError, match="damaged"):
        Model.load(path)


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
        ({"format_version": 99}, r"newer than this vnca reads.*upgrade"),
        ({"format_version": "one"}, "damaged"),
        ({"rule": None}, "damaged"),
        ({"rule": 3}, "damaged"),
        ({"rule": {"no_such_field": 1}}, "damaged"),
        ({"rule": {"channels": 2}}, "damaged"),
        ({"scales": {"density": 0.0}}, r"damaged.*density"),
        ({"scales": {"gamma": float("nan")}}, r"damaged.*gamma"),
        ({"rule": {"channels": 5, "hidden": 8}}, "expected shape"),
        ({"rule": {"channels": 5, "hidden": 7.0}}, r"damaged.*hidden: 7\.0"),
        ({"rule": {"channels": 5, "hidden": 7, "position_prior": "no"}}, "damaged.*position_prior"),
        ({"rule": {"channels": 5, "hidden": 7, "sobel_divisor": math.nan}}, "damaged.*sobel"),
        ({"rule": {"channels": 5, "hidden": 7, "steps_per_frame": 10**9}}, "damaged.*4096"),
        ({"rule": {"channels": 5, "hidden": 7, "domain": "all"}}, "damaged.*domain: 'all'"),
        ({"scales": {"density": True}}, "damaged.*density"),
        ({"scales": {"density": 10**400}}, "damaged.*density"),
        ({"scales": []}, "damaged.*Scales"),
        ({"format_version": True}, "damaged"),
        ({"format_version": 0}, "damaged"),
        ({"training": [1]}, "damaged"),
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


def test_metadata_nested_too_deeply_is_refused(model: Model, tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    model.save(path)
    save_file(load_file(path), path, metadata={"vnca": "[" * 100_000})
    with pytest.raises(ModelError, match="damaged"):
        Model.load(path)


@pytest.mark.parametrize(
    ("name", "tensor", "words"),
    [
        ("bias", np.zeros(7, np.int32), "'bias': expected floats, got int32"),
        ("bias", np.full(7, 1e300), "'bias': not all finite"),
        ("bias", np.zeros((7, 1), np.float32), "'bias': expected shape"),
        ("style", np.zeros((2, 2, 4), np.uint8), "thumbnail"),
        ("style", np.zeros((2, 2, 3), np.float32), "thumbnail"),
    ],
)
def test_tensors_of_other_kinds_are_refused(
    model: Model, tmp_path: Path, name: str, tensor: AnyArray, words: str
) -> None:
    path = tmp_path / "model.safetensors"
    model.save(path)
    with safe_open(path, framework="numpy") as file:
        metadata = file.metadata()
    save_file({**load_file(path), name: tensor}, path, metadata=metadata)
    with pytest.raises(ModelError, match=words):
        Model.load(path)


@pytest.mark.parametrize(("dtype", "size"), [("BF16", 2), ("F8_E4M3", 1)])
def test_tensors_of_types_that_numpy_lacks_are_refused(
    tmp_path: Path, dtype: str, size: int
) -> None:
    header = {"bias": {"dtype": dtype, "shape": [1], "data_offsets": [0, size]}}
    text = json.dumps(header).encode()
    path = tmp_path / "model.safetensors"
    path.write_bytes(struct.pack("<Q", len(text)) + text + bytes(size))
    with pytest.raises(ModelError, match="not a vnca model"):
        Model.load(path)


plain = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
scales = st.floats(1e-6, 1e6)


@settings(deadline=None, max_examples=30)
@given(
    st.builds(
        RuleConfig,
        channels=st.integers(4, 16),
        hidden=st.integers(1, 16),
        update_probability=st.floats(0, 1, exclude_min=True),
        steps_per_frame=st.integers(1, 4096),
        dilation=st.integers(0, 64),
        sobel_divisor=scales,
        position_prior=st.booleans(),
    ),
    st.builds(Scales, density=scales, velocity=scales, gamma=scales),
    st.dictionaries(st.text(), st.recursive(plain, st.lists, max_leaves=5), max_size=4),
    st.none() | st.tuples(st.integers(1, 5), st.integers(1, 5), st.just(3)),
)
def test_any_model_comes_back(
    tmp_path_factory: pytest.TempPathFactory,
    config: RuleConfig,
    normalisers: Scales,
    training: dict[str, Any],
    style_shape: tuple[int, int, int] | None,
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.safetensors"
    random = np.random.default_rng(0)
    style = None if style_shape is None else random.integers(0, 256, style_shape, np.uint8)
    model = Model(Rule.initial(config, normalisers, seed=0), training, style)
    model.save(path)
    back = Model.load(path)
    assert (back.rule.config, back.rule.scales) == (config, normalisers)
    assert (back.training, back.version) == (training, model.version)
    for name in ("hidden", "bias", "output"):
        assert getattr(back.rule, name).tobytes() == getattr(model.rule, name).tobytes()
    np.testing.assert_array_equal(back.style, style)


@pytest.mark.parametrize(
    ("record", "fits"),
    [
        ({}, True),
        ({"fps": 25, "up_axis": "y", "staggered": None, "velocity_scale": "fit"}, True),
        ({"velocity_scale": 2.5, "velocity_grid": None}, True),
        ({"fps": "25"}, False),
        ({"fps": True}, False),
        ({"up_axis": "w"}, False),
        ({"velocity_scale": "fitted"}, False),
        ({"velocity_grid": 3}, False),
        ({"no_such_field": 3}, False),
        ([], False),
    ],
)
def test_records_of_other_types_are_refused(record: Any, fits: bool) -> None:
    if fits:
        assert from_record(SmokeFormat, record) == SmokeFormat(**record)
    else:
        with pytest.raises(TypeError):
            from_record(SmokeFormat, record)


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
    with pytest.raises(OptionError, match=f"`{name}`"):
        RuleConfig(**wrong)  # type: ignore[arg-type]


def test_a_model_with_the_former_names_of_its_fields_loads() -> None:
    kept = Path(__file__).parents[1] / "data" / "painting" / "rule.safetensors"
    with safe_open(kept, framework="numpy") as file:
        assert '"reach"' in file.metadata()["vnca"]
    assert Model.load(kept).rule.config.dilation == 1


def test_a_model_lists_what_it_is_conditioned_on(
    model: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / MODEL_NAME
    model.save(path)
    with safe_open(path, framework="numpy") as file:
        described = json.loads(file.metadata()["vnca"])
    assert described["conditioning"] == [["position", 3], ["density", 1], ["velocity", 3]]
    rewritten(path, conditioning=None)  # as older ones are
    assert Model.load(path).rule.config == model.rule.config

    monkeypatch.setattr(conditioning, "_KNOWN", dict(conditioning._KNOWN))
    register_conditioning(Conditioning("heat", 2, nothing))
    config = replace(model.rule.config, conditioning=("velocity", "heat"))
    own = Model(Rule.initial(config, model.rule.scales, seed=1))
    own.save(path)
    assert version_of(path) == 3
    assert Model.load(path).rule.config == config
    register_conditioning(Conditioning("heat", 1, nothing))
    with pytest.raises(ModelError, match=r"\['heat', 2\] .* known by that name is \['heat', 1\]"):
        Model.load(path)
    monkeypatch.undo()
    with pytest.raises(ModelError, match="conditioned on heat, which this program does not know"):
        Model.load(path)


def nothing(domain: Domain, smoke: Volume, rule: Rule) -> FloatArray:
    raise AssertionError("no frame is painted here")


def test_a_model_tells_all_of_a_named_field_that_it_is_conditioned_on(
    model: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / MODEL_NAME
    with monkeypatch.context() as patch:
        patch.setattr(conditioning, "_KNOWN", dict(conditioning._KNOWN))
        register_conditioning(Conditioning.of_field("heat", width=2, scale=300))
        config = replace(model.rule.config, conditioning=("heat",))
        Model(Rule.initial(config, model.rule.scales, seed=1)).save(path)
    monkeypatch.setattr(conditioning, "_KNOWN", dict(conditioning._KNOWN))
    assert Model.load(path).rule.config == config  # by a program that has never heard of it
    assert conditioning.conditioning_named("heat").scale == 300
    register_conditioning(Conditioning.of_field("heat", width=2, scale=1))
    with pytest.raises(ModelError, match=r"known by that name is .*'heat', 2, 1"):
        Model.load(path)


@pytest.mark.parametrize(
    "listed",
    [
        3,
        "position",
        [["position"]],
        [[3, 3]],
        [["density", 1.0]],
        [["density", 1]] * 2,
        [["heat", 1, 0]],
        [["heat", 1, "2"]],
        [["heat", 1, 2, 3]],
        [["heat", 0, 2]],
    ],
)
def test_a_list_of_inputs_that_is_none_is_damage(
    model: Model, tmp_path: Path, listed: object
) -> None:
    model.save(tmp_path / MODEL_NAME)
    rewritten(tmp_path / MODEL_NAME, conditioning=listed)
    with pytest.raises(ModelError, match="damaged"):
        Model.load(tmp_path)
