"""The examples run, each as its first lines say."""

import importlib.util
import shutil
from pathlib import Path
from types import ModuleType

import pytest

import vnca
from vnca.rule import Rule, RuleConfig, Scales
from vnca.rule.model import MODEL_NAME, STYLES_TOLD, Model

EXAMPLES = Path(__file__).parents[1] / "examples"


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_shot(tmp_path: Path) -> None:
    """At a size that takes a moment."""
    shutil.copy(EXAMPLES / "shot.toml", tmp_path)
    assert len([*vnca.simulate("plume", out=tmp_path / "smoke", resolution=16, frames=4)]) == 4
    files = vnca.paint(
        tmp_path / "shot.toml", frames="2-4", refine=1, without_film=True, device="cpu"
    )
    assert [file.parent for file in files] == 3 * [tmp_path / "painted_shot" / "painted"]


def test_a_shot_in_two_styles(tmp_path: Path) -> None:
    """With a model that was made up, since training takes longer."""
    shutil.copy(EXAMPLES / "two_styles.toml", tmp_path)
    assert len([*vnca.simulate("plume", out=tmp_path / "smoke", resolution=16, frames=4)]) == 4
    config = RuleConfig(channels=6, hidden=8, conditioning=("density", "style_1", "style_2"))
    told = {STYLES_TOLD: [{"name": "vangogh_cafe_terrace"}, {"name": "rust"}]}
    Model(Rule.initial(config, Scales(), seed=0), told).save(tmp_path / "two_styles" / MODEL_NAME)
    files = vnca.paint(
        tmp_path / "two_styles.toml", frames="2-4", refine=1, without_film=True, device="cpu"
    )
    assert [file.parent for file in files] == 3 * [tmp_path / "painted_two_styles" / "painted"]


# They train networks at their real size, if for an iteration only.
@pytest.mark.slow
def test_train_and_paint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example("train_and_paint").main(str(tmp_path / "out"), "1")
    out = capsys.readouterr().out
    assert "frame 24: " in out
    assert "unstylized" in out
    assert (tmp_path / "out" / "painted.gif").exists()


@pytest.mark.slow
def test_arrays(capsys: pytest.CaptureFixture[str]) -> None:
    example("arrays").main("1")
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines] == [f"frame {n}" for n in range(1, 6)]


@pytest.mark.slow
def test_a_conditioning_field(capsys: pytest.CaptureFixture[str]) -> None:
    example("conditioning_field").main("1")
    lines = [line.partition(":")[0] for line in capsys.readouterr().out.splitlines()]
    assert lines == [f"at {k} K, frame {n}" for k in (1500, 0) for n in (1, 2, 3)]


@pytest.mark.slow
def test_a_loss_term_of_ones_own(capsys: pytest.CaptureFixture[str]) -> None:
    found = []
    for weight in ("0", "1000"):
        example("loss_term").main("20", weight)
        found.append(float(capsys.readouterr().out.rpartition(": ")[2]))
    assert found[1] > found[0] + 0.01
