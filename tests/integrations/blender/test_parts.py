"""The parts of the Blender extension that know nothing of Blender."""

import importlib
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vnca.cli import main
from vnca.core import Box
from vnca.io.vdb import Grid, Transform, open_vdb, write_vdb
from vnca.rule.library import style_names

ROOT = Path(__file__).parents[3] / "integrations" / "blender"
CACHES = ROOT / "tests" / "data"
NAMES = ("cache", "interpreter", "job", "problem", "request", "styles")


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.syspath_prepend(str(ROOT))
    yield SimpleNamespace(**{n: importlib.import_module(f"extension.{n}") for n in NAMES})
    for name in [name for name in sys.modules if name.split(".")[0] == "extension"]:
        del sys.modules[name]


@pytest.fixture
def staging(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.syspath_prepend(str(ROOT / "extension" / "worker"))
    yield importlib.import_module("staging")
    del sys.modules["staging"], sys.modules["inside"]


def test_the_simulator_tells_where_cells_are(parts: Any) -> None:
    config = parts.cache.read_config(CACHES / "adaptive" / "config" / "config_0004.uni")
    assert config.cells == (21, 21, 32)
    assert config.first == (4, 0, 0)
    assert not config.is_whole
    place = parts.cache.placement(config, 3 / 32)
    # Of cells of 2/21 and, in a domain of scale 1.5, 2/32.
    assert place.scale == pytest.approx((64 / 63, 64 / 63, 2 / 3))
    assert place.shift == pytest.approx((-1 + 1 / 21, -1 + 1 / 21, -1 + 1 / 32))


@pytest.mark.parametrize("content", [b"", b"no config", b"\x1f\x8b"])
def test_a_damaged_config_is_a_message(parts: Any, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "config_0001.uni"
    path.write_bytes(content)
    with pytest.raises(parts.problem.ProblemError, match="config_0001"):
        parts.cache.read_config(path)


def test_frames_are_found_by_number(parts: Any) -> None:
    assert list(parts.cache.frames(CACHES / "noise", parts.cache.DATA)) == [3, 4]
    assert list(parts.cache.frames(CACHES / "plain", parts.cache.NOISE)) == []


def test_what_lies_beside_the_frames_of_a_cache_is_none_of_them(parts: Any, tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    for name in ("fluid_data_0012.vdb", "fluid_data_-003.vdb", "fluid_data_10000.vdb"):
        (tmp_path / "data" / name).touch()
    for name in ("fluid_particles_0012.vdb", "fluid_data_0013.uni", ".fluid_data_0014.vdb",
                 "fluid_data_0015.vdb.part", "fluid_data.vdb"):  # fmt: skip
        (tmp_path / "data" / name).touch()
    assert list(parts.cache.frames(tmp_path, parts.cache.DATA)) == [-3, 12, 10000]


def test_frames_of_an_adaptive_domain_are_put_in_their_places(staging: Any, tmp_path: Path) -> None:
    told: list[dict[str, Any]] = []
    data = CACHES / "adaptive" / "data" / "fluid_data_0004.vdb"
    frame = {
        "number": 4, "data": str(data), "noise": None, "first": (4, 0, 0), "voxel": 3 / 32,
        "finer": 1, "keeps": False,
    }  # fmt: skip
    staging.stage([frame], tmp_path / "staged", lambda kind, **facts: told.append(facts))
    with open_vdb(tmp_path / "staged" / "smoke_0004.vdb") as ours, open_vdb(data) as theirs:
        assert set(ours.grids) == set(theirs.grids)
        for name in ours.grids:
            assert ours.grids[name].transform.index_to_world[:3, 3] == pytest.approx((0.375, 0, 0))
        one, other = (file.read("density") for file in (ours, theirs))
        box = other.active_box()
        np.testing.assert_array_equal(one.to_dense(box)[0], other.to_dense(box)[0])
    assert told == [{"what": "reading", "done": 0, "total": 1, "unit": "frames"}]
    (tmp_path / "staged" / "of the artist.txt").touch()
    staging.clear(tmp_path / "staged")
    assert [path.name for path in (tmp_path / "staged").iterdir()] == ["of the artist.txt"]


def test_noise_lies_in_the_cells_of_its_simulation(staging: Any, tmp_path: Path) -> None:
    ones = np.ones((2, 2, 2), np.float32)
    for name, cells in (("density", ones), ("density_noise", ones.repeat(4, 0))):
        grid = Grid.from_dense(name, cells, cells > 0, (0, 0, 0), transform=Transform.uniform(9))
        write_vdb(tmp_path / f"{name}.vdb", [grid])
    frame = {
        "number": 1, "data": str(tmp_path / "density.vdb"), "first": (1, 0, 0), "voxel": 0.5,
        "noise": str(tmp_path / "density_noise.vdb"), "finer": 4, "keeps": False,
    }  # fmt: skip
    staging.stage([frame], tmp_path / "staged", lambda *_, **__: None)
    with open_vdb(tmp_path / "staged" / "smoke_0001.vdb") as file:
        assert list(file.grids) == ["density"]
        matrix = file.grids["density"].transform.index_to_world
    # Cell 0 is an eighth of 0.5 behind the lower face of cell 1, which is at 0.25.
    assert matrix[:3, 3] == pytest.approx((0.25 + 0.0625, -0.25 + 0.0625, -0.25 + 0.0625))


def ball(radius: float, rings: int = 12) -> np.ndarray:
    """Triangles `[n, 3, 3]` of a closed ball around the origin."""
    turn, tilt = np.meshgrid(
        np.linspace(0, 2 * np.pi, 2 * rings + 1), np.linspace(0, np.pi, rings + 1), indexing="ij"
    )
    at = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], -1)
    at[-1], at = at[0], radius * at
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    return np.concatenate([np.stack(t, -2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])


def test_cells_inside_a_mesh_are_those_whose_middle_is(staging: Any) -> None:
    inside = sys.modules["inside"]
    matrix = Transform.uniform(0.1, (0.03, -0.02, 0.01)).index_to_world
    box = Box((-12, -12, -12), (12, 12, 12))
    middles = (np.stack(np.indices(box.shape), -1) - 12) * 0.1 + (0.03, -0.02, 0.01)
    far = np.linalg.norm(middles, axis=-1)
    mesh = np.concatenate([ball(0.9, 40), ball(0.4, 40)])  # a shell
    found = inside.cells(mesh, box, matrix)
    clear = (abs(far - 0.9) > 0.01) & (abs(far - 0.4) > 0.01)
    np.testing.assert_array_equal(found[clear], ((far < 0.9) & (far > 0.4))[clear])
    # Edges and corners right on the lines upwards through the middles of cells.
    corners = np.array([[x, y, z] for x in (-5, 5) for y in (-5, 5) for z in (-5, 5)], float)
    faces = [
        (0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]  # fmt: skip
    cube = inside.cells(corners[np.array(faces)], box, np.eye(4))
    assert cube.sum() in range(9**3, 11**3 + 1)
    assert cube[8:17, 8:17, 8:17].all()
    # A mesh that reaches beyond the box on every side.
    assert inside.cells(100 * corners[np.array(faces)], box, np.eye(4)).all()


def test_masked_frames_keep_their_density_and_know_the_mesh(staging: Any, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    cells = rng.random((8, 8, 8), np.float32)
    density, other = (
        Grid.from_dense(name, cells, cells > 0, (-4, -4, -4), transform=Transform.uniform(1))
        for name in ("density", "flame")
    )
    source = tmp_path / "own_0007.vdb"
    write_vdb(source, [density, other], metadata={"creator": "a program"})
    np.save(tmp_path / "mesh.npy", ball(3.2))
    frame = {"number": 7, "data": str(source), "noise": None, "first": None, "keeps": True}
    told: list[object] = []
    for _ in range(2):
        staging.stage(
            [frame], tmp_path, lambda *a, **_: told.append(a), mesh=str(tmp_path / "mesh.npy")
        )
    staged = tmp_path / "smoke_0007.vdb"
    with open_vdb(staged) as file, open_vdb(source) as before:
        assert set(file.grids) == {"density", "flame", "unpainted", "vnca_mask"}
        assert file.metadata["creator"] == before.metadata["creator"]
        box = before.read("density").active_box()
        for name in ("density", "unpainted"):
            np.testing.assert_array_equal(file.read(name).to_dense(box)[0], cells)
        mask = file.read("vnca_mask").to_dense(box)[0]
    assert mask[4, 4, 4] == 1
    assert mask[0, 0, 0] == 0
    # Copied again once the smoke is newer.
    written = staged.stat().st_mtime_ns
    write_vdb(source, [other, density])
    staging.stage([frame], tmp_path, lambda *_, **__: None)
    assert staged.stat().st_mtime_ns > written
    # A frame without smoke has nothing to keep.
    write_vdb(source, [])
    staging.stage([frame], tmp_path, lambda *_, **__: None, mesh=str(tmp_path / "mesh.npy"))
    with open_vdb(staged) as file:
        assert not file.grids


def test_the_words_are_ones_that_vnca_takes(parts: Any, tmp_path: Path) -> None:
    request = parts.request
    smoke = request.Smoke("Plume", str(tmp_path / "gone_####.vdb"), (1, 2), "mantaflow", 24.0, 0.5)
    look = request.Look("ink", None)
    words = request.paint_words(smoke, look, str(tmp_path / "out"), "1-2")
    # It is read to the end, and then there is no smoke.
    assert main(words) == 2
    assert "--time-scale" in words
    model = request.Look(None, "model.safetensors")
    assert request.paint_words(smoke, model, "out", "1")[:3] == [
        "paint",
        smoke.sequence,
        "model.safetensors",
    ]
    frame = str(tmp_path / "gone.vdb")
    trained = request.train_words(smoke, frame, "gone.png", str(tmp_path / "run"), "draft", 3)
    assert main(trained) == 2
    assert main(request.resume_words(str(tmp_path / "run"))) == 2


def test_a_frame_is_named_as_its_sequence_is(parts: Any) -> None:
    smoke = parts.request.Smoke("Plume", "a#/p.##.vdb", (7,), "m/s", 24.0)
    assert smoke.file(7) == "a#/p.07.vdb"
    assert parts.request.Smoke("P", "a#/p_#.vdb", (12,), "m/s", 24.0).file(12) == "a#/p_12.vdb"
    single = parts.request.Smoke("P", "p_7.vdb", (7,), "m/s", 24.0, is_sequence=False)
    assert single.file(7) == "p_7.vdb"
    masked = single.masked("out/staged")
    assert masked.sequence == masked.file(7) == "out/staged/smoke_0007.vdb"
    assert masked.staged == (parts.request.Staged(7, "p_7.vdb", keeps=True),)
    masked = smoke.masked("out/staged")
    assert masked.file(7) == "out/staged/smoke_0007.vdb"
    assert masked.staged[0].data == "a#/p.07.vdb"


@pytest.mark.parametrize(
    ("numbers", "text"), [((1, 2, 3), "1-3"), ((7,), "7"), ((1, 3, 4, 9), "1,3-4,9")]
)
def test_frames_are_written_as_vnca_reads_them(
    parts: Any, numbers: tuple[int, ...], text: str
) -> None:
    assert parts.request.numbers_text(numbers) == text


@pytest.mark.parametrize(
    ("units", "expected"),
    [("m/s", ("SECOND", 0.5)), ("cells/frame", ("FRAME", 0.1)), ("mantaflow", ("FRAME", 0.005))],
)
def test_velocities_become_lengths_of_the_object(
    parts: Any, units: str, expected: tuple[str, float]
) -> None:
    smoke = parts.request.Smoke("Plume", "a_####.vdb", (1,), units, 25.0, 0.5)
    unit, scale = parts.request.velocity_scale(smoke, "", 0.1)
    assert (unit, scale) == (expected[0], pytest.approx(expected[1]))
    assert parts.request.velocity_scale(smoke, "cells/frame", 0.1) == ("FRAME", 0.1)


def test_the_library_is_that_of_vnca(parts: Any) -> None:
    library = parts.styles.library()
    assert [style.name for style in library] == style_names()
    assert all(style.title and style.thumbnail.is_file() for style in library)
    assert {style.label for style in library} >= {"Stained glass", "Ink"}


def work(parts: Any, folder: Path, code: str) -> Any:
    (folder / "worker.py").write_text(f"import json, os, sys, time\n{code}\n")
    runs = parts.interpreter.Interpreter((sys.executable, str(folder / "worker.py")))
    return parts.job.Job(parts.request.job("paint", ["words"]), runs, folder / "job")


def finished(job: Any) -> Any:
    while job.poll():
        time.sleep(0.01)
    return job


def say(**facts: Any) -> str:
    return f"print({json.dumps(facts)!r}, file=sys.stderr, flush=True)"


def test_a_job_tells_how_far_it_has_come(parts: Any, tmp_path: Path) -> None:
    progress = {"what": "painting", "done": 1, "total": 4, "unit": "frames", "seconds_left": 9.0}
    code = "\n".join(
        [
            say(event="progress", **progress),
            say(event="note", text="a note"),
            say(event="picture", path="a.png"),
            say(event="unheard of"),
            "print('no JSON', file=sys.stderr)",
            "assert json.load(open(sys.argv[1]))['words'] == ['words']",
            say(event="finished", files=["a.vdb"]),
        ]
    )
    job = finished(work(parts, tmp_path, code))
    assert (job.state, job.fraction, job.seconds_left) == ("done", 0.25, 9.0)
    assert (job.notes, job.picture, job.result["files"]) == (["a note"], "a.png", ["a.vdb"])
    assert "no JSON" in job.last_lines()


@pytest.mark.parametrize(
    ("code", "message"),
    [
        (say(event="error", message="why") + "; sys.exit(2)", "why"),
        ("sys.exit(3)", "code 3"),
        ("os.kill(os.getpid(), 9)", "signal 9"),
        ("", "code 0"),
    ],
)
def test_a_job_that_fails_says_why(parts: Any, code: str, message: str, tmp_path: Path) -> None:
    job = finished(work(parts, tmp_path, code))
    assert job.state == "failed"
    assert message in job.message


@pytest.mark.parametrize("code", ["sys.stdin.read()", "time.sleep(600)"])
def test_a_job_is_cancelled_whether_it_listens_or_not(
    parts: Any, code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parts.job, "PATIENCE", 0.2)
    job = work(parts, tmp_path, code)
    assert job.poll()
    job.cancel()
    assert job.state == "cancelled"  # at once: whoever waits for it is free
    assert finished(job).state == "cancelled"


def test_a_cancelled_job_that_is_writing_still_is_ended(parts: Any, tmp_path: Path) -> None:
    job = work(parts, tmp_path, "time.sleep(600)")
    job.cancel()
    job.end()
    assert not job.poll()
    assert job.state == "cancelled"
    job.end()  # again, as when Blender quits


def test_an_environment_is_found_by_its_folder(
    parts: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find, worker = parts.interpreter.trainer, tmp_path / "worker"
    python = tmp_path / "env" / "bin" / "python3"
    python.parent.mkdir(parents=True)
    python.touch()
    assert find(str(tmp_path / "env"), worker).words == (str(python), str(worker))
    assert find(str(python), worker).words[0] == str(python)
    monkeypatch.setenv("PYTHONPATH", "of Blender")
    assert "PYTHONPATH" not in find(str(python), worker).variables()
    with pytest.raises(parts.problem.ProblemError, match="no Python environment"):
        find(str(tmp_path / "gone"), worker)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(parts.problem.ProblemError, match="pip install"):
        find("", worker)
    program = python.with_name("vnca")
    program.touch(mode=0o755)
    monkeypatch.setenv("PATH", str(program.parent))
    assert find("", worker).words[0] == str(python)


def test_blenders_python_paints_or_blender_itself(parts: Any, tmp_path: Path) -> None:
    painter = parts.interpreter.painter
    assert painter("/b/python3.11", "/b/blender", tmp_path).words == (
        "/b/python3.11",
        str(tmp_path),
    )
    words = painter("/b/blender", "/b/blender", tmp_path).words
    assert words[:2] == ("/b/blender", "--background")
    assert words[-2:] == (str(tmp_path / "__main__.py"), "--")
