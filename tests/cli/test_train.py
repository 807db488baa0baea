import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from vnca.rule.model import MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME, Checkpoint
from vnca.training.config import SmokeConfig
from vnca.training.loop import Progress, Trainer
from vnca.training.presets import preset

Vnca = Callable[..., Any]
Run = Callable[..., Path]


@pytest.fixture
def trained(vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path) -> Run:
    """Trains in the folder of a name, with more options, and returns the folder."""

    def run(name: str, *options: object) -> Path:
        outcome = vnca("train", frame, style, "--out", tmp_path / name, *tiny, *options)
        assert outcome.code == 0, outcome.err
        return tmp_path / name

    return run


def resolved(run: Path) -> dict[str, Any]:
    return json.loads((run / "config.json").read_text())


def model_bytes(run: Path) -> bytes:
    return (run / MODEL_NAME).read_bytes()


def test_a_run_leaves_a_model_its_configuration_previews_and_curves(trained: Run) -> None:
    run = trained("run")
    model = Model.load(run)
    assert model.rule.config.hidden == 8
    assert model.training["style"] == "style.png"
    assert model.training["frame"] == "ball_0002.vdb"
    assert model.training["iterations"] == 2
    assert model.style is not None
    assert model.style.shape == (50, 40, 3)
    assert model.rule.output.any()
    config = resolved(run)
    assert config["config"]["view"]["size"] == 32
    assert config["config"]["features"] == "efficientnet"
    assert model.training["features"] == "efficientnet"
    assert model.training["picture_cells"] == config["picture_cells"] > 0
    assert config["device"] == "cpu"
    assert {"vnca", "torch", "seed"} <= set(config)
    with Image.open(run / "preview_000002.png") as picture:
        assert picture.width > picture.height
    assert len(list(run.glob("events.out.tfevents.*"))) == 1
    assert not [path for path in run.iterdir() if path.name.startswith(".")]


def test_same_seed_same_bytes_and_another_seed_others(trained: Run) -> None:
    one, two, other = trained("a"), trained("b"), trained("c", "--seed", 1)
    assert model_bytes(one) == model_bytes(two)
    assert not np.array_equal(Model.load(one).rule.output, Model.load(other).rule.output)


def test_previews_change_nothing(trained: Run) -> None:
    often, seldom = trained("a", "--preview-every", 1), trained("b", "--preview-every", 100)
    assert model_bytes(often) == model_bytes(seldom)
    assert len(list(often.glob("preview_*.png"))) == 2
    assert len(list(seldom.glob("preview_*.png"))) == 1


def test_overwriting_replaces_the_model(trained: Run) -> None:
    first = model_bytes(trained("run"))
    assert model_bytes(trained("run", "--overwrite", "--seed", 1)) != first


def flags(config: Any, prefix: str = "") -> list[str]:
    """The option of every field, the rule's without a prefix."""
    names = []
    for field in fields(config):
        value = getattr(config, field.name)
        if is_dataclass(value):
            names += flags(value, "" if field.name == "rule" else f"{field.name}.")
        else:
            names.append(f"--{prefix}{field.name.replace('_', '-')}")
    return names


def test_every_hyperparameter_is_an_option(vnca: Vnca) -> None:
    outcome = vnca("train", "--help-all")
    assert outcome.code == 0
    words = outcome.out.replace(",", " ").split()
    missing = [flag for flag in flags(SmokeConfig()) if flag not in words]
    assert not missing
    assert "FRAME STYLE" in outcome.out


@pytest.mark.parametrize("place", ["before", "after", "joined", "twice"])
def test_what_is_given_wins_over_the_preset_wherever_it_stands(
    vnca: Vnca,
    frame: Path,
    style: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    place: str,
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr("vnca.recipe.smoke.run", lambda options, _: asked.append(options))
    given = ["--hidden", 24, "--view.step", 0.5]
    chosen = {
        "joined": ["--preset=paper"],
        "twice": ["--preset", "standard", "--preset", "paper"],
    }.get(place, ["--preset", "paper"])
    options = [*chosen, *given] if place == "after" else [*given, *chosen]
    assert vnca("train", frame, style, "--out", tmp_path / "run", *options).code == 0
    (options_read,) = asked
    config, paper = options_read.config, preset(SmokeConfig, "paper")
    assert (config.rule.hidden, config.view.step) == (24, 0.5)
    assert options_read.preset == "paper"
    assert config.iterations == paper.iterations
    assert config.view.mode == "paper"
    assert config.view.size == paper.view.size


def test_the_preset_is_written_down(trained: Run) -> None:
    layers = ("--appearance.layers", "relu1_1")
    run = trained("run", "--preset", "paper", "--view.elevation", 7, *layers)
    config = resolved(run)
    # ImageNet's VGG16 where it was fetched before, which is not so here.
    assert (config["config"]["features"], config["features"]) == ("vgg16", "edges")
    assert config["config"]["appearance"]["style_scale"] == 1
    assert config["preset"] == "paper"
    assert config["config"]["view"]["mode"] == "paper"
    assert config["config"]["view"]["elevation"] == 7
    assert config["config"]["pool"]["size"] == preset(SmokeConfig, "paper").pool.size


def test_a_preset_of_ones_own_is_a_file_to_copy_and_change(
    vnca: Vnca, trained: Run, tmp_path: Path
) -> None:
    shown = vnca("train", "--show-preset", "-p", "standard", "--view.size", 48)
    assert (shown.code, shown.err) == (0, "")
    assert "# Rows and columns of a view, pixels.\nsize = 48" in shown.out
    mine = tmp_path / "mine.toml"
    mine.write_text(shown.out.replace('grey_source = "luma"', 'grey_source = "density"'))
    complaint = vnca("train", "a.vdb", "b.png", "--out", tmp_path / "run", "-p", mine).complaint
    assert f"{mine}: appearance.grey_source density" in complaint
    mine.write_text(shown.out.replace("milestones = [0.6, 0.85]", "milestones = [0.5]"))
    config = resolved(trained("run", "--preset", mine))
    assert config["config"]["milestones"] == [0.5]
    assert config["config"]["steadiness"] == 0.5  # as in standard
    assert config["preset"] == "mine.toml"


def test_views_can_be_chosen(trained: Run) -> None:
    view = resolved(trained("run", "--view.azimuths", 0, 90, "--view.elevation", 0))["config"][
        "view"
    ]
    assert view["azimuths"] == [0.0, 90.0]


@pytest.mark.parametrize(("budget", "line"), [("1MB", "at least"), ("much", "expected auto")])
def test_a_memory_budget_that_cannot_be_met_is_one_line(
    vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path, budget: str, line: str
) -> None:
    options = [*tiny, "--memory-budget", budget]
    assert line in vnca("train", frame, style, "--out", tmp_path / "run", *options).complaint
    assert not (tmp_path / "run").exists()


def test_interrupted_training_leaves_a_usable_model(
    vnca: Vnca,
    frame: Path,
    smoke: Path,
    style: Path,
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    improve = Trainer.improve

    def interrupted(self: Trainer) -> Progress:
        if self.iteration == 2:
            raise KeyboardInterrupt
        return improve(self)

    monkeypatch.setattr(Trainer, "improve", interrupted)
    run = tmp_path / "run"
    options = [*tiny, "--iterations", 50]
    outcome = vnca("train", frame, style, "--out", run, *options)
    assert outcome.code == 130
    assert "Traceback" not in outcome.err
    assert "stopped at iteration 2" in outcome.err
    model = Model.load(run)
    assert model.training["iterations"] == 2
    assert model.rule.output.any()
    assert (run / "preview_000002.png").exists()
    painted = vnca("stylize", run, smoke, "--out", tmp_path / "painted", "--warmup", 1)
    assert painted.code == 0, painted.err


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize(("how", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_the_program_with_a_model(
    frame: Path, style: Path, tiny: list[str], tmp_path: Path, how: signal.Signals, code: int
) -> None:
    run = tmp_path / "run"
    arguments = ["train", str(frame), str(style), "--out", str(run), *tiny]
    # Far more iterations than there is time for, the first model after one.
    arguments += ["--iterations", "1000000", "--preview-every", "1"]
    # Children of a shell's background job are born deaf to Control-C.
    main = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler);"
        "from vnca.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", main, *arguments]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as program:
        try:
            end = time.monotonic() + 120
            while not (run / MODEL_NAME).exists() and time.monotonic() < end:
                assert program.poll() is None, program.stderr and program.stderr.read()
                time.sleep(0.05)
            os.kill(program.pid, how)
            _, err = program.communicate(timeout=60)
        finally:
            program.kill()
    assert program.returncode == code
    assert "Traceback" not in err
    assert "stopped at iteration" in err
    assert Model.load(run).training["iterations"] >= 1
    assert not [path for path in run.iterdir() if path.name.startswith(".")]
    assert Checkpoint.load(run / CHECKPOINT_NAME).training["trainer"].values["iteration"] >= 1


def test_smoke_in_mantaflows_npz_files_can_be_trained_on(
    vnca: Vnca, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    random = np.random.default_rng(0)
    density = random.random((8, 9, 10)).astype(np.float32)
    for name, values in {"d": density[..., None], "v": np.zeros((8, 9, 10, 3), "f4")}.items():
        (tmp_path / name).mkdir()
        np.savez_compressed(tmp_path / name / "004.npz", x=values)
    frame = tmp_path / "d" / "004.npz"
    outcome = vnca("train", frame, style, "--out", tmp_path / "run", *tiny)
    assert outcome.code == 0, outcome.err
    assert Model.load(tmp_path / "run").rule.output.any()


def test_a_velocity_scale_can_be_fitted_to_the_neighbours(
    vnca: Vnca, frame: Path, style: Path, tiny: list[str], tmp_path: Path
) -> None:
    options = [*tiny, "--velocity-scale", "fit"]
    outcome = vnca("train", frame, style, "--out", tmp_path / "run", *options)
    assert outcome.code == 0, outcome.err
    # The ball rises by one cell a frame and says it rises by half of one.
    assert resolved(tmp_path / "run")["smoke"]["velocity_scale"] == pytest.approx(2, rel=0.2)
