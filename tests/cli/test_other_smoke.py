"""Smoke that is other than a rule expects it: velocity missing, densities in another unit."""

import shutil
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core.errors import OptionError, SequenceError
from vnca.core.volume import Volume
from vnca.io import SmokeFormat, read_smoke, write_smoke
from vnca.io.vdb import Grid, open_vdb, write_vdb
from vnca.painting import Painting
from vnca.recipe import Silent
from vnca.recipe.evaluation import evaluate
from vnca.recipe.stylizing import stylize
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.config import SmokeConfig

Vnca = Callable[..., Any]
QUICK = ("--warmup", 2, "--steps-per-frame", 1)


@pytest.fixture
def paint(vnca: Vnca, model: Path, smoke: Path, tmp_path: Path) -> Callable[..., Any]:
    """Paints the three frames of smoke into the folder `out`, over what is there."""
    command = ("stylize", model, smoke, "--out", tmp_path / "out", "--overwrite", *QUICK)

    def run(*options: object) -> Any:
        return vnca(*command, *options)

    return run


def rename_velocity(path: Path, name: str) -> None:
    with open_vdb(path) as file:
        grids = [header.read() for header in file.grids.values()]
    for grid in grids:
        if grid.name == "velocity":
            grid.name = name
    write_vdb(path, grids)


def scale_density(folder: Path, factor: float) -> None:
    for path in folder.iterdir():
        volume = read_smoke(path, SmokeFormat())
        write_smoke(path, replace(volume, density=volume.density * np.float32(factor)))


def densest(folder: Path) -> float:
    frames = [read_smoke(path, SmokeFormat()).density for path in folder.iterdir()]
    return max(float(np.percentile(frame[frame > 0], 99)) for frame in frames)


def colours(path: Path) -> bytes:
    with open_vdb(path) as file:
        grid = file.grids["Cd"].read()
        return grid.to_dense(grid.active_box())[0].tobytes()


def test_velocity_that_frames_lack_is_missed_once(
    paint: Callable[..., Any], smoke: Path, model: Path
) -> None:
    for number in (2, 3):
        rename_velocity(smoke / f"ball_{number:04d}.vdb", "wind")
    outcome = paint()
    assert outcome.code == 0
    (line,) = [line for line in outcome.err.splitlines() if ": no velocity" in line]
    assert line.startswith(f"{smoke / 'ball_0002.vdb'}: no velocity in this frame; choose with ")
    assert "--velocity-grid from wind (vec3s) (--velocity-grid none says" in line
    assert ": no velocity" not in paint("--velocity-grid", "none").err
    for path in smoke.iterdir():
        with open_vdb(path) as file:
            write_vdb(path, [header for name, header in file.grids.items() if name == "density"])
    assert "ball_0001.vdb: no velocity in this frame; no other grid of vectors" in paint().err
    loaded = Model.load(model)
    config = replace(loaded.rule.config, velocity_prior=False)
    replace(loaded, rule=replace(loaded.rule, config=config)).save(model / MODEL_NAME)
    assert ": no velocity" not in paint().err


EVALUATE = (
    *("evaluate", "{model}", "{smoke}", "--style", "{style}", "--size", 64, "--style-scale", 1),
    *QUICK,
)
BENCH = (
    *("bench", "stylize", "--model", "{model}", "--sequence", "{smoke}", "--repeats", 1),
    *("--backends", "numpy", "--threads", 1, *QUICK[2:]),
)


@pytest.fixture
def measure(
    vnca: Vnca, monkeypatch: pytest.MonkeyPatch, model: Path, smoke: Path, style: Path
) -> Callable[..., Any]:
    """Measures the painting of the three frames, by one of those commands.

    Of an evaluation it paints what would be measured, and gives up; the outcome is all the same
    that of success.
    """

    def painted(paintings: Iterable[Painting], *_: object) -> None:
        assert len([*paintings]) == 3
        raise OptionError("painted")

    monkeypatch.setattr("vnca.recipe.evaluation.survey", painted)
    monkeypatch.setattr("vnca.recipe.evaluation._judges", lambda *_: [])

    def run(command: tuple[object, ...], *options: object) -> Any:
        filled = [str(word).format(model=model, smoke=smoke, style=style) for word in command]
        outcome = vnca(*filled, *options)
        return outcome._replace(code=0) if outcome.err.endswith("vnca: painted\n") else outcome

    return run


@pytest.mark.parametrize("command", [EVALUATE, BENCH], ids=["evaluate", "bench"])
def test_who_measures_painting_misses_velocity_too(
    measure: Callable[..., Any], smoke: Path, command: tuple[object, ...]
) -> None:
    for number in (2, 3):
        rename_velocity(smoke / f"ball_{number:04d}.vdb", "wind")

    def told(*options: object) -> list[str]:
        outcome = measure(command, *options)
        assert outcome.code == 0, outcome.err
        return [line for line in outcome.err.splitlines() if ": no velocity" in line]

    (line,) = told()
    assert line.startswith(f"{smoke / 'ball_0002.vdb'}: no velocity in this frame; choose with ")
    assert "--velocity-grid from wind (vec3s)" in line
    assert line.endswith("frames without are painted as if their smoke rested")
    assert not told("--velocity-grid", "none")


def test_an_ablation_of_velocity_needs_one_before_it_trains(
    vnca: Vnca, frame: Path, style: Path, tmp_path: Path
) -> None:
    rename_velocity(frame, "wind")
    complaint = vnca("ablate", frame, style, "--out", tmp_path / "runs").complaint
    assert f"{frame}: no velocity in this frame; choose with --velocity-grid from wind" in complaint
    assert not (tmp_path / "runs").exists()


def test_a_timed_training_misses_velocity_too(
    vnca: Vnca, frame: Path, style: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rename_velocity(frame, "wind")

    def far_enough(*_: object, **__: object) -> None:
        raise OptionError("far enough")

    monkeypatch.setattr("vnca.cli.bench.training.measure_training", far_enough)
    command = ("bench", "train", "--frame", frame, "--style", style, "--device", "cpu")
    lines = vnca(*command).err.splitlines()
    missing = f"{frame}: no velocity in this frame; choose with --velocity-grid from wind"
    assert [line.startswith(missing) for line in lines] == [True, False]
    assert lines[0].endswith("teaching motion is not timed")
    assert vnca(*command, "--velocity-grid", "none").err.splitlines() == ["vnca: far enough"]


@pytest.mark.parametrize("what", ["files", "memory"])
def test_painting_from_python_misses_velocity_too(
    model: Path, smoke: Path, tiny_smoke: Volume, what: str
) -> None:
    lines: list[str] = []

    class Notes(Silent):
        def note(self, line: str) -> None:
            lines.append(line)

    if what == "files":
        rename_velocity(smoke / "ball_0002.vdb", "wind")
        sequence, missing = smoke, f"{smoke / 'ball_0002.vdb'}: no velocity in this frame"
    else:
        still = replace(tiny_smoke, velocity=None, frame=7)
        sequence, missing = [tiny_smoke, still, still], "frame 7: no velocity"
    assert len(list(stylize(model, sequence, warmup=2, steps_per_frame=1, watch=Notes()))) == 3
    assert [line.startswith(missing) for line in lines if "no velocity" in line] == [True]


@pytest.mark.parametrize("names", [("Velocity",), ("VEL",)])
def test_velocity_of_another_spelling_paints_the_same(
    paint: Callable[..., Any], smoke: Path, tmp_path: Path, names: tuple[str]
) -> None:
    assert paint().code == 0
    expected = {path.name: colours(path) for path in (tmp_path / "out").iterdir()}
    assert paint("--velocity-grid", "none").code == 0
    assert {path.name: colours(path) for path in (tmp_path / "out").iterdir()} != expected
    for path in smoke.iterdir():
        rename_velocity(path, *names)
    with open_vdb(smoke / "ball_0001.vdb") as file:
        assert file.names == ("density", *names, "temperature")
    assert paint("--velocity-units", "cells/frame").code == 0
    assert {path.name: colours(path) for path in (tmp_path / "out").iterdir()} == expected


def test_an_empty_frame_is_not_asked_for_velocity(paint: Callable[..., Any], smoke: Path) -> None:
    nothing = Volume(np.zeros((0, 0, 0), np.float32), None, (0, 0, 0), np.eye(4), 2)
    write_smoke(smoke / "ball_0002.vdb", nothing)
    outcome = paint()
    assert (outcome.code, ": no velocity" in outcome.err) == (0, False)


def test_npz_smoke_without_a_folder_of_velocity_is_told(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "cache" / "d"
    folder.mkdir(parents=True)
    density = read_smoke(smoke / "ball_0001.vdb", SmokeFormat()).density
    for number in (1, 2):
        np.savez(folder / f"{number:03d}.npz", x=density)
    outcome = vnca("stylize", model, tmp_path / "cache", "--out", tmp_path / "out", *QUICK)
    assert outcome.code == 0
    (line,) = [line for line in outcome.err.splitlines() if ": no velocity" in line]
    assert line.startswith(f"{folder / '001.npz'}: no velocity in this frame; it would be in a ")


@pytest.mark.parametrize("options", [(), ("--domain", "box"), ("--density-scale", 40)])
def test_densities_in_another_unit_are_not_painted_white(
    paint: Callable[..., Any], smoke: Path, model: Path, tmp_path: Path, options: tuple[object, ...]
) -> None:
    factor = 1.0 if "--density-scale" in options else 1e-3
    scale_density(smoke, factor * 0.3)
    complaint = paint(*options).complaint
    scale = 40 if "--density-scale" in options else Model.load(model).rule.scales.density
    assert f"{smoke}: nothing would be painted" in complaint
    assert f"is below 1% of the one that counts as 1, {scale:.3g};" in complaint
    advice = complaint.rpartition("try ")[2]
    option, value = advice.split()
    assert option == "--density-scale"
    assert float(value) == pytest.approx(densest(smoke), rel=0.01)
    assert not (tmp_path / "out").exists()
    assert paint(*options, option, value).code == 0
    assert len({colours(path) for path in (tmp_path / "out").iterdir()}) == 3


@pytest.mark.parametrize("command", [EVALUATE, BENCH], ids=["evaluate", "bench"])
def test_who_measures_painting_refuses_densities_in_another_unit_too(
    measure: Callable[..., Any], smoke: Path, command: tuple[object, ...]
) -> None:
    scale_density(smoke, 1e-4)
    complaint = measure(command).complaint
    assert f"{smoke}: nothing would be painted" in complaint
    option, value = complaint.rpartition("try ")[2].split()
    assert option == "--density-scale"
    assert float(value) == pytest.approx(densest(smoke), rel=0.01)
    outcome = measure(command, option, value)
    assert outcome.code == 0, outcome.err
    assert "--density-scale 0.0: must be" in measure(command, option, 0).complaint


def test_volumes_too_thin_for_the_model_are_refused(model: Path, tiny_smoke: Volume) -> None:
    thin = replace(tiny_smoke, density=tiny_smoke.density * np.float32(1e-4))
    with pytest.raises(SequenceError, match=r"^`sequence`: nothing would be painted.*try `density"):
        list(stylize(model, [thin]))
    with pytest.raises(SequenceError, match=r"^`sequence`: nothing would be painted"):
        evaluate(model, thin, style=np.random.default_rng(0).random((40, 40, 3)), style_scale=1)
    assert len(list(stylize(model, [thin], density_scale=1e-4, warmup=2, steps_per_frame=1))) == 1


def test_a_sequence_may_begin_with_faint_empty_or_broken_frames(
    paint: Callable[..., Any], smoke: Path, tmp_path: Path
) -> None:
    for number, name in ((4, "ball_0004.vdb"), (5, "ball_0005.vdb")):
        shutil.copy(smoke / f"ball_000{number - 3}.vdb", smoke / name)
    volume = read_smoke(smoke / "ball_0002.vdb", SmokeFormat())
    write_smoke(smoke / "ball_0001.vdb", replace(volume, density=volume.density * 1e-4))
    with open_vdb(smoke / "ball_0002.vdb") as file:
        density = file.grids["density"].read()
        still = Grid.from_dense(
            "density", 0 * volume.density, volume.density > 0, volume.origin, like=density
        )
        write_vdb(smoke / "ball_0002.vdb", [still, file.grids["velocity"]])
    (smoke / "ball_0003.vdb").write_bytes(b"broken")
    outcome = paint("--on-error", "skip")
    assert outcome.code == 0, outcome.err
    assert len(list((tmp_path / "out").iterdir())) == 4


def test_smoke_whose_cells_are_all_zero_is_told(paint: Callable[..., Any], smoke: Path) -> None:
    for path in smoke.iterdir():
        with open_vdb(path) as file:
            density = file.grids["density"].read()
            values, active = density.to_dense(density.active_box())
            origin = density.active_box().lower
            still = Grid.from_dense("density", 0 * values, active, origin, like=density)
            write_vdb(path, [still])
    complaint = paint().complaint
    assert "nothing would be painted" in complaint
    assert "choose others with --frames" in complaint


@pytest.mark.parametrize(
    ("options", "line", "is_told"),
    [
        ((), "{frame}: no velocity in this frame; choose with --velocity-grid from wind", False),
        (("--velocity-grid", "none"), None, False),
        (("--velocity-grid", "wind"), None, True),
    ],
)
def test_a_rule_trained_without_velocity_is_never_told_one(
    vnca: Vnca,
    frame: Path,
    style: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: tuple[str, ...],
    line: str | None,
    is_told: bool,
) -> None:
    rename_velocity(frame, "wind")
    seen: list[SmokeConfig] = []

    def far_enough(
        _smoke: object, _style: object, config: SmokeConfig, *_: object, **__: object
    ) -> None:
        seen.append(config)
        raise OptionError("far enough")

    monkeypatch.setattr("vnca.recipe.smoke.smoke_trainer", far_enough)
    outcome = vnca("train", frame, style, "--out", tmp_path / "run", *options)
    *told, last = outcome.err.splitlines()
    assert last == "vnca: far enough"
    assert [config.rule.velocity_prior for config in seen] == [is_told]
    assert len(told) == (line is not None)
    for said in told:
        assert said.startswith(str(line).format(frame=frame))
        assert said.endswith("; the rule learns nothing of motion")
