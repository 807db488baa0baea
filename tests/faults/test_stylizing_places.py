"""Disks that are full, read-only or limited while a sequence is painted."""

import resource
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from vnca.cli import main
from vnca.core.volume import Volume
from vnca.io.vdb import open_vdb
from vnca.painting import Roll, RollState

pytestmark = [
    pytest.mark.faults,
    pytest.mark.skipif(sys.platform != "linux", reason="mounts and limits as Linux has them"),
]


@pytest.fixture
def stylize(
    stylizing: list[object], capfd: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str]]:
    """Paints the sequence; the exit code, and the complaint if there was one."""

    def run(*options: object) -> tuple[int, str]:
        capfd.readouterr()
        code = main([str(word) for word in (*stylizing, *options)])
        lines = capfd.readouterr().err.splitlines()
        complaints = [line for line in lines if line.startswith("vnca: ")]
        assert lines[-1:] == complaints if code else not complaints
        return code, "".join(complaints)

    return run


Stylize = Callable[..., tuple[int, str]]


@pytest.fixture
def expected(stylize: Stylize, tmp_path: Path) -> dict[str, bytes]:
    assert stylize("--out", tmp_path / "unharmed") == (0, "")
    return contents(tmp_path / "unharmed")


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def require_whole(folder: Path, *, fewer_than: int) -> None:
    """Some frames, all of which open; nothing else but, perhaps, the state to go on from."""
    frames = sorted(folder.glob("[!.]*"))
    assert 0 < len(frames) < fewer_than
    for path in frames:
        with open_vdb(path) as file:
            for header in file.grids.values():
                header.read()
    others = {path.name for path in folder.iterdir()} - {path.name for path in frames}
    assert others <= {f".{frames[0].stem}.resume.safetensors"}


def test_a_full_disk_keeps_the_frames_before_and_goes_on_when_there_is_room(
    stylize: Stylize, expected: dict[str, bytes], disk: Path, fill: Callable[[int], Path]
) -> None:
    out = disk / "out"
    sizes = [len(data) for data in expected.values()]
    filler = fill(sum(sizes[:3]) + 400_000)
    code, complaint = stylize("--out", out)
    assert code == 2
    assert f"{out}/" in complaint
    assert "cannot be written (No space left on device)" in complaint
    require_whole(out, fewer_than=len(expected))
    filler.unlink()
    assert stylize("--out", out, "--resume") == (0, "")
    assert contents(out) == expected


@pytest.mark.parametrize("name", ["film.mp4", "film.gif"])
def test_a_full_disk_for_the_film_leaves_none_until_there_is_room(
    stylize: Stylize,
    expected: dict[str, bytes],
    disk: Path,
    fill: Callable[[int], Path],
    tmp_path: Path,
    name: str,
) -> None:
    out, film = tmp_path / "out", disk / name
    options = ("--out", out, "--preview", film, "--rows", 96, "--columns", 96)
    filler = fill(4096)
    code, complaint = stylize(*options)
    assert code == 2
    assert "No space left on device" in complaint
    assert [path.name for path in disk.iterdir()] == ["filler"]
    filler.unlink()
    assert stylize(*options, "--resume") == (0, "")
    assert contents(out) == expected
    assert film.stat().st_size > 4096


def test_a_read_only_disk_is_refused_before_work(
    stylize: Stylize,
    disk: Path,
    remount: Callable[[str], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Roll, "stepped", lambda *_: pytest.fail("painted"))
    remount("ro")
    for options in (("--out", disk / "out"), ("--out", "out", "--preview", disk / "film.gif")):
        code, complaint = stylize(*options)
        assert code == 2
        assert "cannot be written" in complaint


def test_a_disk_that_becomes_read_only_keeps_the_frames_before(
    stylize: Stylize,
    expected: dict[str, bytes],
    disk: Path,
    remount: Callable[[str], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As the system makes a disk that fails."""
    paint, painted = Roll.stepped, 0

    def eventful(self: Roll, smoke: Volume, state: RollState) -> Any:
        nonlocal painted
        painted += 1
        if painted == 4:
            remount("ro")
        return paint(self, smoke, state)

    monkeypatch.setattr(Roll, "stepped", eventful)
    out = disk / "out"
    code, complaint = stylize("--out", out)
    assert code == 2
    assert "cannot be written (Read-only file system)" in complaint
    require_whole(out, fewer_than=len(expected))
    remount("rw")
    assert stylize("--out", out, "--resume") == (0, "")
    assert contents(out) == expected


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Nobody may write larger files: as a full disk, but without the right to mount one."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_limit_of_the_system_is_as_a_full_disk(
    stylize: Stylize, expected: dict[str, bytes], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    with largest_file(100_000):
        code, complaint = stylize("--out", out)
    assert code == 2
    assert "cannot be written (File too large)" in complaint
    require_whole(out, fewer_than=len(expected))
    assert stylize("--out", out, "--resume") == (0, "")
    assert contents(out) == expected
