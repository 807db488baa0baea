"""A frame that is broken, gone or changing in the middle of a sequence."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from vnca.core.volume import Volume
from vnca.io import SmokeFormat, read_smoke, write_smoke
from vnca.io.vdb import Grid, open_vdb, write_vdb
from vnca.painting import Roll, RollState

Vnca = Callable[..., Any]
Paint = Callable[..., Any]
QUICK = ("--warmup", 4, "--steps-per-frame", 2)
FILM = ("--rows", 32, "--columns", 32)


@pytest.fixture
def paint(vnca: Vnca, model: Path, smoke: Path, tmp_path: Path) -> Paint:
    """Paints the three frames of smoke into a folder."""

    def run(out: str, *options: object) -> Any:
        anew = () if "--resume" in options else ("--overwrite",)
        return vnca("stylize", model, smoke, "--out", tmp_path / out, *QUICK, *anew, *options)

    return run


@pytest.fixture
def while_painting(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], object]], None]:
    """Lets something happen while the first frame is painted, when the second is read already."""
    stepped = Roll.stepped

    def patch(event: Callable[[], object]) -> None:
        def eventful(self: Roll, smoke: Volume, state: RollState) -> Any:
            if smoke.frame == 1:
                event()
            return stepped(self, smoke, state)

        monkeypatch.setattr(Roll, "stepped", eventful)

    return patch


def poison(path: Path) -> None:
    """Headers stay as they are; the values cannot be used."""
    with open_vdb(path) as file:
        density = file.grids["density"].read()
        values, active = density.to_dense(density.active_box())
        values[5, 5, 5] = np.nan
        box = density.active_box()
        poisoned = Grid.from_dense("density", values, active, box.lower, like=density)
        write_vdb(path, [poisoned, file.grids["velocity"]])


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:100])


def unlink(path: Path) -> None:
    """Leave a link to a file that is not there."""
    path.unlink()
    path.symlink_to(path.with_name("gone.vdb"))


def colours(path: Path) -> bytes:
    with open_vdb(path) as file:
        grid = file.grids["Cd"].read()
        return grid.to_dense(grid.active_box())[0].tobytes()


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def paint_of(folder: Path) -> dict[str, bytes]:
    return {path.name: colours(path) for path in folder.iterdir()}


def test_stopping_keeps_what_is_painted_and_goes_on_when_the_frame_is_mended(
    paint: Paint, smoke: Path, tmp_path: Path
) -> None:
    assert paint("unharmed").code == 0
    broken = smoke / "ball_0002.vdb"
    whole = broken.read_bytes()
    poison(broken)
    outcome = paint("out")
    assert outcome.code == 2
    assert outcome.err.splitlines()[-1].startswith(f"vnca: {broken}: ")
    assert names(tmp_path / "out") == [".ball_0001.resume.safetensors", "ball_0001.vdb"]
    broken.write_bytes(whole)
    assert paint("out", "--resume").code == 0
    assert contents(tmp_path / "out") == contents(tmp_path / "unharmed")


def test_a_frame_whose_header_is_broken_stops_before_long_work(
    paint: Paint, smoke: Path, tmp_path: Path
) -> None:
    truncate(smoke / "ball_0003.vdb")
    assert "ball_0003.vdb" in paint("out").complaint
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("harm", [poison, truncate, unlink, lambda path: path.write_bytes(b"")])
def test_a_skipped_frame_leaves_a_gap_and_one_line(
    paint: Paint, smoke: Path, tmp_path: Path, harm: Callable[[Path], object]
) -> None:
    assert paint("expected", "--frames", "1,3").code == 0
    assert paint("out").code == 0  # An earlier painting, whose frame must not stay in the gap.
    harm(smoke / "ball_0002.vdb")
    outcome = paint("out", "--on-error", "skip", "--preview", tmp_path / "film.gif", *FILM)
    assert outcome.code == 0
    (told,) = [line for line in outcome.err.splitlines() if "ball_0002.vdb" in line]
    assert told.endswith("; leaving it out")
    # Their metadata tell that they are of a painting of other frames.
    assert paint_of(tmp_path / "out") == paint_of(tmp_path / "expected")
    with Image.open(tmp_path / "film.gif") as pictures:
        assert getattr(pictures, "n_frames", 1) == 2


@pytest.mark.parametrize("harm", [poison, truncate])
def test_held_smoke_is_painted_on_so_that_no_frame_is_missing(
    paint: Paint, smoke: Path, tmp_path: Path, harm: Callable[[Path], object]
) -> None:
    standing = tmp_path / "standing"
    shutil.copytree(smoke, standing)
    shutil.copy(smoke / "ball_0001.vdb", standing / "ball_0002.vdb")
    harm(smoke / "ball_0002.vdb")
    outcome = paint("out", "--on-error", "hold", "--preview", tmp_path / "film.gif", *FILM)
    assert outcome.code == 0
    (told,) = [line for line in outcome.err.splitlines() if "ball_0002.vdb" in line]
    assert told.endswith("; holding frame 1 in its place")
    out = tmp_path / "out"
    assert names(out) == ["ball_0001.vdb", "ball_0002.vdb", "ball_0003.vdb"]
    assert colours(out / "ball_0001.vdb") != colours(out / "ball_0002.vdb")
    # As if the smoke had stood still.
    shutil.rmtree(smoke)
    standing.rename(smoke)
    assert paint("expected").code == 0
    assert contents(out) == contents(tmp_path / "expected")
    with Image.open(tmp_path / "film.gif") as pictures:
        assert getattr(pictures, "n_frames", 1) == 3


def test_a_broken_first_frame_has_none_before_it_to_hold(
    paint: Paint, smoke: Path, tmp_path: Path
) -> None:
    truncate(smoke / "ball_0001.vdb")
    outcome = paint("out", "--on-error", "hold")
    assert outcome.code == 0
    assert "ball_0001.vdb" in outcome.err
    assert "leaving it out" in outcome.err
    assert names(tmp_path / "out") == ["ball_0002.vdb", "ball_0003.vdb"]


def test_a_last_frame_that_is_a_link_to_nothing_is_not_dropped(
    paint: Paint, smoke: Path, tmp_path: Path
) -> None:
    last = smoke / "ball_0003.vdb"
    unlink(last)
    assert (
        paint("out").complaint == f"vnca: {last}: no such file: it is a link to {last.readlink()}"
    )
    assert not (tmp_path / "out").exists()
    outcome = paint("out", "--on-error", "hold")
    assert f"{last.readlink()}; holding frame 2 in its place" in outcome.err
    assert names(tmp_path / "out") == ["ball_0001.vdb", "ball_0002.vdb", "ball_0003.vdb"]


@pytest.mark.parametrize("on_error", ["skip", "hold"])
def test_when_every_frame_is_broken_there_is_nothing_to_paint(
    paint: Paint, smoke: Path, tmp_path: Path, on_error: str
) -> None:
    for path in smoke.iterdir():
        truncate(path)
    assert "ball_0003.vdb" in paint("out", "--on-error", on_error).complaint
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("on_error", "left"), [("stop", [1, 2]), ("skip", [1, 2]), ("hold", [1, 2, 3])]
)
def test_a_frame_that_disappears_meanwhile(
    paint: Paint,
    smoke: Path,
    tmp_path: Path,
    while_painting: Callable[[Callable[[], object]], None],
    on_error: str,
    left: list[int],
) -> None:
    gone = smoke / "ball_0003.vdb"
    while_painting(gone.unlink)
    outcome = paint("out", "--on-error", on_error)
    assert outcome.code == (2 if on_error == "stop" else 0)
    assert f"{gone}: no such file" in outcome.err
    frames = [name for name in names(tmp_path / "out") if not name.startswith(".")]
    assert frames == [f"ball_{number:04d}.vdb" for number in left]


@pytest.fixture
def while_the_second_is_painted(
    monkeypatch: pytest.MonkeyPatch,
) -> Callable[[Callable[[], object]], None]:
    """Lets something happen between the reading of the second frame and its writing."""
    stepped = Roll.stepped

    def patch(event: Callable[[], object]) -> None:
        def eventful(self: Roll, smoke: Volume, state: RollState) -> Any:
            if smoke.frame == 2:
                event()
            return stepped(self, smoke, state)

        monkeypatch.setattr(Roll, "stepped", eventful)

    return patch


def test_a_frame_that_disappears_once_it_was_read_is_painted(
    paint: Paint,
    smoke: Path,
    tmp_path: Path,
    while_the_second_is_painted: Callable[[Callable[[], object]], None],
) -> None:
    """It is open still, for the grids that pass through."""
    assert paint("whole").code == 0
    while_the_second_is_painted((smoke / "ball_0002.vdb").unlink)
    assert paint("out").code == 0
    for name in ("ball_0002.vdb", "ball_0003.vdb"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


@pytest.mark.parametrize(
    ("on_error", "left"), [("stop", [1]), ("skip", [1, 3]), ("hold", [1, 2, 3])]
)
def test_a_frame_that_is_written_to_once_it_was_read_is_broken(
    paint: Paint,
    smoke: Path,
    tmp_path: Path,
    while_the_second_is_painted: Callable[[Callable[[], object]], None],
    on_error: str,
    left: list[int],
) -> None:
    path = smoke / "ball_0002.vdb"
    while_the_second_is_painted(lambda: path.write_bytes(bytes(path.stat().st_size)))
    outcome = paint("out", "--on-error", on_error)
    assert outcome.code == (2 if on_error == "stop" else 0)
    assert f"{path}: has changed while it was painted" in outcome.err
    frames = [name for name in names(tmp_path / "out") if not name.startswith(".")]
    assert frames == [f"ball_{number:04d}.vdb" for number in left]


def test_smoke_that_moves_out_of_the_box_of_the_sequence_is_told(
    paint: Paint, smoke: Path, while_painting: Callable[[Callable[[], object]], None]
) -> None:
    changing = smoke / "ball_0003.vdb"

    def change() -> None:
        volume = read_smoke(changing, SmokeFormat())
        far = Volume(volume.density, volume.velocity, (90, 0, 0), volume.index_to_world, 3)
        write_smoke(changing, far)

    while_painting(change)
    outcome = paint("out")
    assert outcome.code == 2
    assert f"{changing}: has changed since the start" in outcome.err


@pytest.mark.parametrize("on_error", ["skip", "hold"])
def test_a_painting_with_a_broken_frame_goes_on_to_the_same_files(
    paint: Paint, smoke: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, on_error: str
) -> None:
    """Also where the frame to hold was painted before the end, and where it was a held one."""
    for number in (4, 5):
        shutil.copy(smoke / "ball_0001.vdb", smoke / f"ball_{number:04d}.vdb")
    for number in (2, 3):
        truncate(smoke / f"ball_{number:04d}.vdb")
    options = ("--on-error", on_error)
    assert paint("unharmed", *options).code == 0
    paint_frame, count = Roll.stepped, 0

    def interrupted(self: Roll, volume: Volume, state: RollState) -> Any:
        nonlocal count
        count += 1
        if count % 2 == 0:
            raise KeyboardInterrupt
        return paint_frame(self, volume, state)

    monkeypatch.setattr(Roll, "stepped", interrupted)
    codes = [paint("out", *options).code]
    while codes[-1]:
        codes.append(paint("out", *options, "--resume").code)
    assert set(codes) == {130, 0}
    assert contents(tmp_path / "out") == contents(tmp_path / "unharmed")


def test_a_velocity_scale_is_fitted_to_the_frames_that_can_be_read(
    paint: Paint, smoke: Path, tmp_path: Path
) -> None:
    truncate(smoke / "ball_0003.vdb")
    outcome = paint("out", "--on-error", "skip", "--velocity-scale", "fit")
    assert outcome.code == 0, outcome.err
    assert names(tmp_path / "out") == ["ball_0001.vdb", "ball_0002.vdb"]
