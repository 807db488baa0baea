"""The whole job in one command, and how it goes on."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import vnca as library
from vnca.core.volume import Volume
from vnca.io import read_smoke, write_smoke
from vnca.io.vdb import open_vdb
from vnca.painting import Roll, RollState
from vnca.recipe import Silent
from vnca.recipe.sequence import fullest_frame
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.loop import Progress, Trainer

Vnca = Callable[..., Any]
TINY = """
base = "draft"
iterations = 2
texture = 0
shortest_rollout = 2
longest_rollout = 3
[rule]
channels = 6
hidden = 8
[view]
size = 32
[motion]
size = 32
[appearance]
layers = ["stem", "block1"]
samples = 64
"""
CAMERA = ("--rows", 32, "--columns", 32)


class Job:
    """A painting of the three frames of smoke in one command."""

    def __init__(self, vnca: Vnca, smoke: Path, style: Path, folder: Path) -> None:
        self.vnca, self.smoke, self.style, self.out = vnca, smoke, style, folder / "all"
        self.preset = folder / "tiny.toml"
        self.preset.write_text(TINY)

    def run(self, *options: object) -> Any:
        given = (self.smoke, self.style, "-o", self.out, "-p", self.preset, "--device", "cpu")
        return self.vnca("paint", *given, *CAMERA, *options)

    @property
    def files(self) -> dict[str, bytes]:
        paths = [*self.out.glob("painted/*"), self.out / "run" / MODEL_NAME]
        return {path.name: path.read_bytes() for path in paths}


@pytest.fixture
def job(vnca: Vnca, smoke: Path, style: Path, tmp_path: Path) -> Job:
    return Job(vnca, smoke, style, tmp_path)


def stop_training(patch: pytest.MonkeyPatch) -> None:
    improve = Trainer.improve

    def interrupted(self: Trainer) -> Progress:
        if self.iteration == 1:
            raise KeyboardInterrupt
        return improve(self)

    patch.setattr(Trainer, "improve", interrupted)


def stop_painting(patch: pytest.MonkeyPatch) -> None:
    paint, painted = Roll.stepped, 0

    def interrupted(self: Roll, smoke: Volume, state: RollState) -> Any:
        nonlocal painted
        painted += 1
        if painted == 3:
            raise KeyboardInterrupt
        return paint(self, smoke, state)

    patch.setattr(Roll, "stepped", interrupted)


def test_a_sequence_and_a_picture_become_a_painting_and_a_film(job: Job, smoke: Path) -> None:
    # The frame with the most smoke is the one to learn from.
    for number, kept in ((1, 2), (3, 5)):
        path = smoke / f"ball_{number:04d}.vdb"
        volume = read_smoke(path, library.SmokeFormat(velocity_grid="none"))
        density = volume.density.copy()
        density[kept:] = 0
        write_smoke(path, replace(volume, density=density))
    outcome = job.run("--refine", 2)
    assert outcome.code == 0, outcome.err
    assert Model.load(job.out / "run").training["frame"] == "ball_0002.vdb"
    assert Model.load(job.out / "run").training["preset"] == "tiny.toml"
    for name in ("ball_0001.vdb", "ball_0002.vdb", "ball_0003.vdb"):
        with open_vdb(job.out / "painted" / name) as file:
            assert {"density", "Cd"} <= set(file.grids)
    assert (job.out / "film.mp4").stat().st_size > 500


@pytest.mark.parametrize("stop", [stop_training, stop_painting])
def test_it_goes_on_where_it_was_interrupted_to_the_same_files(
    job: Job, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, stop: Callable[..., None]
) -> None:
    with monkeypatch.context() as patch:
        stop(patch)
        outcome = job.run()
    assert outcome.code == 130, outcome.err
    assert "--resume" in outcome.err
    assert "go on with --resume" in job.run().complaint
    outcome = job.run("--resume")
    assert outcome.code == 0, outcome.err
    whole = Job(job.vnca, job.smoke, job.style, tmp_path / "..")
    whole.out = tmp_path / "whole"
    assert whole.run().code == 0
    assert job.files == whole.files
    # And when all is done there is nothing to do.
    monkeypatch.setattr(Roll, "stepped", lambda *_: pytest.fail("painted again"))
    monkeypatch.setattr(Trainer, "improve", lambda *_: pytest.fail("trained again"))
    assert job.run("--resume").code == 0


def test_something_else_is_not_gone_on_with(job: Job) -> None:
    assert job.run().code == 0
    before = job.files
    assert "--seed is another" in job.run("--resume", "--seed", 1).complaint
    assert "--refine is another" in job.run("--resume", "--refine", 3).complaint
    job.preset.write_text(TINY.replace("hidden = 8", "hidden = 9"))
    assert "--preset is another" in job.run("--resume").complaint
    assert job.files == before
    assert job.run("--overwrite").code == 0
    assert Model.load(job.out / "run").rule.config.hidden == 9
    (job.out / "paint.json").write_text("{")
    assert "paint.json: damaged" in job.run("--resume").complaint


def test_a_model_in_the_place_of_the_picture_is_not_trained_again(
    vnca: Vnca, smoke: Path, model: Path, tmp_path: Path
) -> None:
    call = ("paint", smoke, model, "-o", tmp_path / "all", *CAMERA)
    outcome = vnca(*call)
    assert outcome.code == 0, outcome.err
    assert len(list((tmp_path / "all" / "painted").glob("ball_*.vdb"))) == 3
    assert not (tmp_path / "all" / "run").exists()
    assert vnca(*call, "--resume").code == 0
    for option, value in (("--preset", "paper"), ("--training-frame", 2)):
        assert f"{option}: {model} is a model" in vnca(*call, option, value).complaint
    assert "not both" in vnca(*call, "--resume", "--overwrite").complaint


def test_the_frame_to_learn_from_can_be_named(job: Job) -> None:
    assert "--training-frame 9: is not among" in job.run("--training-frame", 9).complaint
    assert job.run("--training-frame", 3).code == 0
    assert Model.load(job.out / "run").training["frame"] == "ball_0003.vdb"


def test_one_line_of_python(smoke: Path, style: Path, tmp_path: Path) -> None:
    preset = tmp_path / "tiny.toml"
    preset.write_text(TINY)
    told: list[str] = []

    class Listener(Silent):
        def made(self, what: str, path: Path) -> None:
            told.append(what)

    film = {"rows": 32, "columns": 32}
    paths = library.paint(
        smoke, style, tmp_path / "all", preset=preset, film=film, watch=Listener()
    )
    assert [path.name for path in paths] == ["ball_0001.vdb", "ball_0002.vdb", "ball_0003.vdb"]
    assert told == ["model", "painted", "film"]
    asked = json.loads((tmp_path / "all" / "paint.json").read_text())
    assert asked["preset"]["iterations"] == 2
    with pytest.raises(library.VncaError, match=r"`velocity_unit`: no such .* `velocity_units`"):
        library.paint(smoke, style, tmp_path / "more", velocity_unit="m/s")


@pytest.fixture
def painted_with(vnca: Vnca, smoke: Path, tmp_path: Path) -> Callable[..., Any]:
    """Paints one frame in the style of the library, without a film: density and colour."""

    def paint(name: str, *options: object) -> Any:
        out = tmp_path / name
        done = vnca("paint", smoke, "--style", "ink", "-o", out, "-f", "1", "-r", "1", *options)
        assert done.code == 0, done.err
        (path,) = (out / "painted").iterdir()
        with open_vdb(path) as file:
            grids = {grid: file.read(grid) for grid in ("density", "Cd")}
        box = grids["density"].active_box()
        return tuple(grids[grid].to_dense(box)[0] for grid in ("density", "Cd"))

    return paint


def test_strengths_say_how_much_of_the_painting_is_seen(
    painted_with: Callable[..., Any], smoke: Path, tmp_path: Path
) -> None:
    full = painted_with("full", "--without-film")
    faint = painted_with("faint", "--without-film", "--strength", 0, "--density-strength", 0)
    source = min(smoke.glob("*.vdb"))
    with open_vdb(source) as file:
        grid = file.read("density")
        before = grid.to_dense(grid.active_box())[0]
    assert abs(full[0] - before).max() > 0.01
    assert faint[0] == pytest.approx(before, abs=1e-6)
    assert full[1][before > 0].std() > 0.02
    assert faint[1][before > 0] == pytest.approx(1, abs=1e-6)
    assert not (tmp_path / "full" / "film.mp4").exists()


def test_motion_that_cannot_be_blurred_is_said_before_training(job: Job) -> None:
    done = job.run("--shutter", 0.5, "--velocity-grid", "none")
    assert "no velocity, which --shutter needs" in done.complaint
    assert not job.out.exists()


def test_the_frame_to_train_on_is_looked_for_once(
    job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []

    def counted(*given: Any) -> Any:
        found.append(given)
        return fullest_frame(*given)

    monkeypatch.setattr("vnca.recipe.paint.fullest_frame", counted)
    assert job.run("--shutter", 0.5, "--only", "train").code == 0
    assert len(found) == 1


def test_a_film_is_shaped_or_left_out(vnca: Vnca, smoke: Path, tmp_path: Path) -> None:
    given = (smoke, "--style", "ink", "-o", tmp_path / "out", "--without-film")
    assert "--rows, --without-film: one of them" in vnca("paint", *given, "--rows", 32).complaint
    assert "--strength 2: must be" in vnca("paint", *given, "--strength", 2).complaint
    assert not (tmp_path / "out").exists()
