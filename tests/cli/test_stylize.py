from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.cli.bare import without_training

from vnca.cli import main
from vnca.cli.paint import Stylize
from vnca.core import AnyArray
from vnca.core.errors import OptionError
from vnca.core.volume import Volume
from vnca.engine import native
from vnca.io import SmokeFormat, read_smoke, write_smoke
from vnca.io.vdb import Grid, open_vdb, write_vdb
from vnca.painting import Roll, RollState
from vnca.rule import Rule, RuleConfig, Scales
from vnca.rule.model import Model

Vnca = Callable[..., Any]
Paint = Callable[..., Path]
QUICK = ("--warmup", 4, "--steps-per-frame", 2)


@pytest.fixture
def painted(vnca: Vnca, model: Path, smoke: Path, tmp_path: Path) -> Paint:
    """Paints the smoke, or another sequence, with more options; the folder it is in."""
    count = 0

    def run(*options: object, sequence: object = smoke) -> Path:
        nonlocal count
        count += 1
        out = tmp_path / f"painted{count}"
        outcome = vnca("stylize", model, sequence, "--out", out, *QUICK, *options)
        assert outcome.code == 0, outcome.err
        return out

    return run


def grids(path: Path) -> dict[str, Grid]:
    with open_vdb(path) as file:
        return {name: header.read() for name, header in file.grids.items()}


def dense(grid: Grid) -> tuple[AnyArray, AnyArray]:
    return grid.to_dense(grid.active_box())


def coloured(path: Path) -> tuple[AnyArray, AnyArray]:
    """The colours in the box of the density, and which cells of that are active there."""
    after = grids(path)
    box = after["density"].active_box()
    assert after["Cd"].active_box() == box.grown(1)
    return after["Cd"].to_dense(box)[0], after["density"].to_dense(box)[1]


def test_painted_frames_have_density_colour_and_everything_else_as_it_was(
    painted: Paint, smoke: Path
) -> None:
    out = painted()
    assert sorted(p.name for p in out.iterdir()) == sorted(p.name for p in smoke.iterdir())
    for path in sorted(out.iterdir()):
        before, after = grids(smoke / path.name), grids(path)
        assert list(after) == [*before, "Cd"]
        for name in ("velocity", "temperature"):
            for ours, theirs in zip(dense(after[name]), dense(before[name]), strict=True):
                assert ours.tobytes() == theirs.tobytes()
            assert after[name].metadata == before[name].metadata
        for name in ("density", "Cd"):
            theirs = before["density"]
            matrix = after[name].transform.index_to_world
            np.testing.assert_array_equal(matrix, theirs.transform.index_to_world)
        np.testing.assert_array_equal(coloured(path)[1], dense(before["density"])[1])
        np.testing.assert_array_equal(dense(after["density"])[1], dense(before["density"])[1])
        with open_vdb(path) as ours, open_vdb(smoke / path.name) as source:
            assert ours.metadata["shot"] == source.metadata["shot"]


def test_colour_is_the_rules_and_density_changes_by_half_at_most(
    painted: Paint, smoke: Path
) -> None:
    path = painted() / "ball_0003.vdb"
    colour, active = coloured(path)
    assert colour.dtype == np.float32
    assert colour[active].min() >= 0
    assert colour[active].max() <= 1
    assert colour[active].std() > 1e-3
    before = dense(grids(smoke / path.name)["density"])[0][active]
    after = dense(grids(path)["density"])[0][active]
    assert (after >= 0.499 * before).all()
    assert (after <= 1.501 * before).all()
    assert not np.array_equal(before, after)


def test_without_any_strength_smoke_stays_as_it_is_and_white(painted: Paint, smoke: Path) -> None:
    path = painted("--strength", 0, "--density-strength", 0) / "ball_0002.vdb"
    after, before = grids(path), grids(smoke / path.name)
    colour, active = dense(after["Cd"])
    assert (colour[active] == 1).all()
    for ours, theirs in zip(dense(after["density"]), dense(before["density"]), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_several_colour_grids_hold_the_same(painted: Paint) -> None:
    path = painted("--colour-grid", "Cd", "color") / "ball_0001.vdb"
    after = grids(path)
    assert list(after) == ["density", "velocity", "temperature", "Cd", "color"]
    for ours, theirs in zip(dense(after["Cd"]), dense(after["color"]), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_same_seed_same_files_and_another_seed_others(painted: Paint) -> None:
    one, two, other = painted(), painted(), painted("--seed", 1)
    name = "ball_0002.vdb"
    assert (one / name).read_bytes() == (two / name).read_bytes()
    assert (one / name).read_bytes() != (other / name).read_bytes()


def test_both_backends_paint_alike(painted: Paint) -> None:
    native, reference = (painted("--backend", name) for name in ("native", "reference"))
    a, b = (dense(grids(out / "ball_0003.vdb")["Cd"])[0] for out in (native, reference))
    np.testing.assert_allclose(a, b, atol=1e-4)


@pytest.mark.skipif(native.unavailable("bfloat16") is not None, reason="this processor has none")
def test_short_numbers_paint_nearly_alike(painted: Paint) -> None:
    whole, short = (painted("--precision", name) for name in ("float32", "bfloat16"))
    a, b = (dense(grids(out / "ball_0003.vdb")["Cd"])[0] for out in (whole, short))
    np.testing.assert_allclose(a, b, atol=0.02)
    assert (a != b).any()


def test_a_precision_that_cannot_be_had_is_told_before_work(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ["stylize", model, smoke, "--out", tmp_path / "out", "--precision", "bfloat16"]
    complaint = vnca(*command, "--backend", "numpy").complaint
    assert "backend numpy cannot run: only native has bfloat16" in complaint
    reasons = {"float32": None, "bfloat16": "this processor lacks it"}
    monkeypatch.setattr(native, "unavailable", lambda precision="float32": reasons[precision])
    assert "native: this processor lacks it" in vnca(*command).complaint
    assert not (tmp_path / "out").exists()


def test_chosen_frames_only_and_gaps_are_told(vnca: Vnca, model: Path, smoke: Path) -> None:
    (smoke / "ball_0002.vdb").unlink()
    out = smoke.parent / "out"
    outcome = vnca("stylize", model, smoke / "ball_%04d.vdb", "--out", out, "--frames", "2-3")
    assert outcome.code == 0
    assert "no file for frames 2" in outcome.err
    assert [path.name for path in out.iterdir()] == ["ball_0003.vdb"]


@pytest.mark.parametrize("cells", [0, 3])
def test_a_frame_without_smoke_passes_through(painted: Paint, smoke: Path, cells: int) -> None:
    path = smoke / "ball_0002.vdb"
    with open_vdb(path) as file:
        density = file.grids["density"].read()
        nothing = np.zeros((cells,) * 3, np.float32)
        empty = Grid.from_dense("density", nothing, nothing == 0, (0, 6, 12), like=density)
        write_vdb(path, [empty, file.grids["velocity"], file.grids["temperature"]])
    film = ("--preview", smoke.parent / "film.gif", "--rows", 32, "--columns", 32)
    out = painted(*film)
    after = grids(out / path.name)
    assert list(after) == ["density", "velocity", "temperature", "Cd"]
    assert after["density"].active_voxels == cells**3
    assert after["Cd"].active_voxels == ((cells + 2) ** 3 if cells else 0)
    assert not dense(after["density"])[0].any()
    assert after["temperature"].active_voxels == grids(path)["temperature"].active_voxels
    # The painting starts afresh after it.
    assert np.isfinite(dense(grids(out / "ball_0003.vdb")["Cd"])[0]).all()


@pytest.mark.parametrize("number", [1, 2])
def test_a_file_without_grids_is_a_frame_without_smoke(
    painted: Paint, smoke: Path, number: int
) -> None:
    name = f"ball_000{number}.vdb"
    write_vdb(smoke / name, [], {"shot": "shot 2"})
    film = ("--preview", smoke.parent / "film.gif", "--rows", 32, "--columns", 32)
    out = painted(*film)
    with open_vdb(out / name) as file:
        assert file.names == ()
        assert file.metadata.value("shot") == "shot 2"
    others = sorted(path.name for path in smoke.iterdir() if path.name != name)
    assert sorted(path.name for path in out.iterdir()) == sorted([name, *others])
    for other in others:
        assert np.isfinite(dense(grids(out / other)["Cd"])[0]).all()


def test_smoke_of_another_resolution_without_velocity(painted: Paint, tmp_path: Path) -> None:
    density = np.random.default_rng(0).random((21, 6, 17)).astype(np.float32)
    for number in (7, 8):
        volume = Volume(density, None, (0, 0, 0), np.diag([0.3, 0.3, 0.3, 1]), number)
        write_smoke(tmp_path / "other" / f"cloud.{number}.vdb", volume)
    out = painted(sequence=tmp_path / "other" / "cloud.$F.vdb")
    assert sorted(path.name for path in out.iterdir()) == ["cloud.7.vdb", "cloud.8.vdb"]
    assert list(grids(out / "cloud.8.vdb")) == ["density", "Cd"]
    assert coloured(out / "cloud.8.vdb")[0].shape == (21, 6, 17, 3)


def test_a_rule_sees_the_same_smoke_whatever_axis_is_up(
    painted: Paint, model: Path, tiny_smoke: Volume, tmp_path: Path
) -> None:
    """The same ball in files with y up is painted alike, and keeps the axes of its file."""
    assert tiny_smoke.velocity is not None
    write_smoke(tmp_path / "z" / "ball_1.vdb", tiny_smoke)
    # Ours are (x, y, z); with y up, files have (x, z, -y).
    turned = replace(
        tiny_smoke,
        density=np.ascontiguousarray(tiny_smoke.density.transpose(0, 2, 1)[:, :, ::-1]),
        velocity=np.ascontiguousarray(
            tiny_smoke.velocity.transpose(0, 2, 1, 3)[:, :, ::-1, [0, 2, 1]] * [1, 1, -1]
        ).astype(np.float32),
    )
    write_smoke(tmp_path / "y" / "ball_1.vdb", turned)
    seen = read_smoke(tmp_path / "y" / "ball_1.vdb", SmokeFormat(up_axis="y"))
    straight = read_smoke(tmp_path / "z" / "ball_1.vdb", SmokeFormat())
    np.testing.assert_array_equal(seen.density, straight.density)
    np.testing.assert_allclose(seen.velocity, straight.velocity, atol=1e-6)  # type: ignore[arg-type]
    out = painted("--up-axis", "y", sequence=tmp_path / "y" / "ball_1.vdb")
    colour, active = coloured(out / "ball_1.vdb")
    source = grids(tmp_path / "y" / "ball_1.vdb")["density"]
    np.testing.assert_array_equal(active, dense(source)[1])
    assert colour[active].std() > 1e-3


def test_a_finer_painting_has_finer_smoke_and_all_else_as_it_was(
    painted: Paint, vnca: Vnca, smoke: Path, tmp_path: Path
) -> None:
    size = ("--rows", 32, "--columns", 32)
    out = painted("--refine", 2, "--preview", tmp_path / "film.gif", *size)
    before, after = (grids(folder / "ball_0002.vdb") for folder in (smoke, out))
    assert list(after) == [*before, "Cd"]
    for name in ("velocity", "temperature"):
        for ours, theirs in zip(dense(after[name]), dense(before[name]), strict=True):
            assert ours.tobytes() == theirs.tobytes()
        assert after[name].transform == before[name].transform
    for name in ("density", "Cd"):
        np.testing.assert_allclose(after[name].transform.voxel_size, 0.05)
    source = read_smoke(smoke / "ball_0002.vdb", SmokeFormat()).refined(2)
    inside = after["density"].active_box().slices(source.box)
    ratio = dense(after["density"])[0] / np.maximum(source.density[inside], 1e-9)
    active = source.density[inside] > 0
    np.testing.assert_array_equal(dense(after["density"])[1], active)
    assert 0.499 <= ratio[active].min() < 1 < ratio[active].max() <= 1.501
    assert coloured(out / "ball_0002.vdb")[0][active].std() > 1e-3
    picture = tmp_path / "picture.png"
    done = vnca("render", out, "--frames", 2, "--out", picture, *size)
    assert done.code == 0, done.err
    assert picture.exists()


def test_a_finer_painting_takes_as_many_more_steps_whoever_says_how_many(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[int] = []
    monkeypatch.setattr(Roll, "start", lambda self: seen.append(self.steps_per_frame) or fail())

    def fail() -> RollState:
        raise OptionError("enough")

    for options in ((), ("--refine", 3), ("--refine", 3, "--steps-per-frame", 5)):
        assert vnca("stylize", model, smoke, "--out", tmp_path / "out", *options).code == 2
    steps = Model.load(model).rule.config.steps_per_frame
    assert seen == [steps, 3 * steps, 3 * 5]


def test_a_folder_in_mantaflows_layout(painted: Paint, tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    for number in (4, 5):
        for name, components in (("d", 1), ("v", 3)):
            (tmp_path / "npz" / name).mkdir(parents=True, exist_ok=True)
            values = random.random((6, 7, 8, components)).astype(np.float32)
            np.savez_compressed(tmp_path / "npz" / name / f"{number:03d}.npz", x=values)
    out = painted(sequence=tmp_path / "npz")
    assert sorted(path.name for path in out.iterdir()) == ["004.vdb", "005.vdb"]
    after = grids(out / "005.vdb")
    assert set(after) == {"density", "Cd", "velocity"}
    assert coloured(out / "005.vdb")[0].shape == (8, 7, 6, 3)
    finer = painted("--refine", 2, sequence=tmp_path / "npz") / "005.vdb"
    assert coloured(finer)[0].shape == (16, 14, 12, 3)


def test_a_preview_has_a_picture_a_frame(painted: Paint, tmp_path: Path) -> None:
    from PIL import Image

    film = tmp_path / "film.gif"
    size = ("--rows", 32, "--columns", 48)
    painted("--preview", film, *size, "--turn", 90, "--gamma", 2)
    with Image.open(film) as pictures:
        assert pictures.size == (48, 32)
        assert getattr(pictures, "n_frames", 1) == 3


def test_a_failure_half_way_keeps_what_is_whole_and_no_film(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path
) -> None:
    last = smoke / "ball_0003.vdb"
    with open_vdb(last) as file:
        density = file.grids["density"].read()
        values, active = dense(density)
        values[5, 5, 5] = np.nan
        poisoned = Grid.from_dense(
            "density", values, active, density.active_box().lower, like=density
        )
        write_vdb(last, [poisoned])
    out, film = tmp_path / "out", tmp_path / "film.gif"
    outcome = vnca("stylize", model, smoke, "--out", out, *QUICK, "--preview", film)
    assert outcome.code == 2
    assert "Traceback" not in outcome.err
    assert outcome.err.splitlines()[-1].startswith(f"vnca: {last}")
    assert {path.name for path in out.iterdir()} == {
        "ball_0001.vdb",
        "ball_0002.vdb",
        ".ball_0001.resume.safetensors",
    }
    assert [path for path in tmp_path.iterdir() if "film" in path.name] == []


def test_the_scale_of_the_density_can_be_given(painted: Paint, smoke: Path, model: Path) -> None:
    """Smoke in other units is painted alike if what counts as 1 is told."""
    plain = painted()
    for path in smoke.iterdir():
        volume = read_smoke(path, SmokeFormat())
        write_smoke(path, replace(volume, density=64 * volume.density))
    scale = 64 * Model.load(model).rule.scales.density
    scaled = painted("--density-scale", scale)
    a, b = (dense(grids(out / "ball_0002.vdb")["Cd"])[0] for out in (plain, scaled))
    np.testing.assert_allclose(a, b, atol=1e-5)


def test_applying_a_style_needs_nothing_that_training_does(
    painted: Paint, model: Path, smoke: Path, tmp_path: Path
) -> None:
    out = tmp_path / "bare"
    done = without_training("stylize", model, smoke, "--out", out, *QUICK)
    assert done.returncode == 0, done.stderr
    expected = painted()
    for path in expected.iterdir():
        assert (out / path.name).read_bytes() == path.read_bytes()
    for path in (model, out / "ball_0001.vdb"):
        done = without_training("info", path)
        assert done.returncode == 0, done.stderr
        assert "weights" in done.stdout or "Cd: vec3s" in done.stdout
    for command in ("--help", "stylize --help"):
        done = without_training(*command.split())
        assert done.returncode == 0, done.stderr


def test_a_blender_frame_and_mantaflow_npz_are_painted_without_training(
    painted: Paint, model: Path, tmp_path: Path
) -> None:
    random = np.random.default_rng(0)
    for name, components in (("d", 1), ("v", 3)):
        (tmp_path / "npz" / name).mkdir(parents=True)
        values = random.random((6, 7, 8, components)).astype(np.float32)
        np.savez_compressed(tmp_path / "npz" / name / "004.npz", x=values)
    blender = Path(__file__).parent.parent / "data" / "plume_sphere_0030.vdb"
    for sequence in (blender, tmp_path / "npz"):
        options = () if sequence != blender else ("--velocity-units", "mantaflow", "--fps", 24)
        out = tmp_path / f"bare_{sequence.stem}"
        done = without_training("stylize", model, sequence, "--out", out, *QUICK, *options)
        assert done.returncode == 0, done.stderr
        (expected,) = painted(*options, sequence=sequence).iterdir()
        assert (out / expected.name).read_bytes() == expected.read_bytes()


def test_what_a_preview_cannot_be_made_with_is_told_and_all_else_is_painted(
    painted: Paint, model: Path, smoke: Path, tmp_path: Path
) -> None:
    native = "vnca.engine.native._native"
    for name, absent, told in (
        ("film.mp4", "", "need PyAV: pip install 'vnca[train]'"),
        ("film.gif", native, "need the native core or torch"),
    ):
        out, film = tmp_path / Path(name).suffix, tmp_path / name
        options = (*QUICK, "--preview", film)
        done = without_training("stylize", model, smoke, "--out", out, *options, absent=absent)
        assert done.returncode == 0, done.stderr
        (line,) = (line for line in done.stderr.splitlines() if "without a preview" in line)
        assert told in line
        assert f"vnca render {out}" in line
        assert "film:" not in done.stderr
        assert sorted(p.name for p in out.iterdir()) == sorted(p.name for p in painted().iterdir())
        assert not film.exists()


def test_without_torch_and_a_compiler_the_slow_step_runs_and_says_so_once(
    painted: Paint, model: Path, smoke: Path, tmp_path: Path
) -> None:
    out = tmp_path / "slow"
    absent = "vnca.engine.native._native"
    done = without_training("stylize", model, smoke, "--out", out, *QUICK, absent=absent)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("running the slow numpy step: its extension was not built") == 1
    fast = painted()
    a, b = (dense(grids(folder / "ball_0003.vdb")["Cd"])[0] for folder in (out, fast))
    np.testing.assert_allclose(a, b, atol=1e-4)


def test_what_is_missing_is_named(smoke: Path, style: Path, tmp_path: Path) -> None:
    for arguments in (
        ["train", smoke / "ball_0001.vdb", style, "--out", tmp_path / "out"],
        ["render", smoke, "--out", tmp_path / "out" / "film.mp4"],
        ["simulate", "plume", "--out", tmp_path / "out"],
    ):
        done = without_training(*arguments)
        assert done.returncode == 2, done.stderr
        assert done.stderr.count("\n") == 1, done.stderr
        assert done.stderr.startswith("vnca: ")
        assert "vnca[train]" in done.stderr
        assert not [*(tmp_path / "out").rglob("*")]


def test_smoke_is_read_as_it_was_for_training_unless_told_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rule = Rule.initial(RuleConfig(channels=4, hidden=2), Scales(), seed=0)
    recorded = asdict(SmokeFormat(velocity_units="mantaflow", fps=30, time_scale=0.4))
    Model(rule, {"smoke": recorded}).save(tmp_path / "model.safetensors")
    seen: list[Stylize] = []
    monkeypatch.setattr("vnca.recipe.painting.run", lambda options, *_: seen.append(options) or ())
    command = ["stylize", str(tmp_path / "model.safetensors"), "smoke", "--out", "out"]
    assert main(command) == 0
    assert main([*command, "--fps", "25", "--velocity-units", "m/s"]) == 0
    assert [(s.smoke.velocity_units, s.smoke.fps, s.smoke.time_scale) for s in seen] == [
        ("mantaflow", 30, 0.4),
        ("m/s", 25, 0.4),
    ]
