"""Painting with `mpirun` as a user asks for it: the files of one program."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from vnca.core.errors import BackendUnavailableError
from vnca.engine import native
from vnca.ranks import launched

MPIRUN = shutil.which("mpirun", path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
QUICK = ("--warmup", 2, "--steps-per-frame", 2)
pytestmark = pytest.mark.skipif(
    native.unavailable() is not None, reason="other backends round by how many cells there are"
)


def launcher(size: int) -> list[str]:
    """What starts some ranks."""
    pytest.importorskip("mpi4py", reason="the extra mpi is not installed")
    if MPIRUN is None:
        pytest.skip("no mpirun")
    return [MPIRUN, "-n", str(size), "--oversubscribe", "--allow-run-as-root", sys.executable]


@pytest.fixture
def command() -> Callable[..., list[str]]:
    """The command line of some ranks."""

    def words(size: int, *arguments: object) -> list[str]:
        return [*launcher(size), "-m", "vnca", *map(str, arguments)]

    return words


@pytest.fixture
def mpirun(command: Any) -> Callable[..., subprocess.CompletedProcess[str]]:
    def run(size: int, *arguments: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command(size, *arguments), capture_output=True, text=True, timeout=300
        )

    return run


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_ranks_paint_the_files_of_one(
    vnca: Any, mpirun: Any, model: Path, smoke: Path, tmp_path: Path
) -> None:
    given = ("stylize", model, smoke, *QUICK, "--refine", 2)
    assert vnca(*given, "--out", tmp_path / "one").code == 0
    done = mpirun(3, *given, "--out", tmp_path / "three", "--tile", 8, "--halo", 2)
    assert done.returncode == 0, done.stderr
    assert files(tmp_path / "three") == files(tmp_path / "one")
    assert done.stderr.count("painted: ") == 1


def test_a_rank_that_is_killed_ends_all_and_others_go_on(
    vnca: Any, command: Any, mpirun: Any, model: Path, smoke: Path, tmp_path: Path
) -> None:
    given = ("stylize", model, smoke, *QUICK)
    out = ("--out", tmp_path / "out", "--tile", 8, "--halo", 1)
    assert vnca(*given, "--out", tmp_path / "one").code == 0
    with subprocess.Popen(command(2, *given, *out), stderr=subprocess.PIPE, text=True) as job:
        first = tmp_path / "out" / "ball_0001.vdb"
        while not first.exists():
            assert job.poll() is None
            time.sleep(0.02)
        os.kill(max(ranks_of(job.pid)), signal.SIGKILL)
        assert job.stderr is not None
        said = job.stderr.read()
    assert job.returncode == 137, said
    assert "exited on" in said
    assert "Traceback" not in said
    done = mpirun(3, *given, *out, "--resume")
    assert done.returncode == 0, done.stderr
    assert "going on after" in done.stderr
    assert files(tmp_path / "out") == files(tmp_path / "one")


def ranks_of(launcher: int) -> list[int]:
    """The programs that were started by one."""
    listed = subprocess.run(
        ["ps", "-e", "-o", "pid=,ppid=,args="], capture_output=True, text=True, check=True
    )
    lines = [line.split(None, 2) for line in listed.stdout.splitlines()]
    below, found = {launcher}, []
    for _ in range(4):
        below |= {int(pid) for pid, parent, _ in lines if int(parent) in below}
    for pid, _, arguments in lines:
        if int(pid) in below and arguments.startswith(sys.executable):
            found.append(int(pid))
    return found


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("stylize", "--tile", 12), "--tile 12: expected a multiple of 8"),
        (("stylize", "--guide", "z"), "frames are painted as wholes; leave it out and paint"),
        (("stylize", "--on-error", "skip"), "--on-error skip: not with several ranks of MPI"),
        (("info",), "mpirun: ranks share paint and stylize alone, not info"),
    ],
)
def test_what_ranks_cannot_do_is_refused_in_one_line(
    mpirun: Any, model: Path, smoke: Path, tmp_path: Path, options: Any, words: str
) -> None:
    command, *others = options
    done = mpirun(2, command, model, smoke, "--out", tmp_path / "out", *others)
    assert done.returncode == 2
    assert words in done.stderr
    assert done.stderr.count("vnca: ") == 1
    assert not (tmp_path / "out").exists()


BROKEN = """
import sys
from vnca.cli import main
from vnca.core.errors import OutputError
from vnca.painting.tiles.roll import TiledRoll

begin = TiledRoll._begin_tile

def broken(self, *given):
    if self.ranks.rank == 2:
        raise OutputError("scratch: no room")
    return begin(self, *given)

TiledRoll._begin_tile = broken
sys.exit(main())
"""


def test_what_one_rank_finds_is_told_once(
    command: Any, model: Path, smoke: Path, tmp_path: Path
) -> None:
    words = command(3, "stylize", model, smoke, "--out", tmp_path / "out", *QUICK, "--tile", 8)
    at = words.index("-m")
    words[at : at + 2] = ["-c", BROKEN]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300)
    assert done.returncode == 2
    assert done.stderr.count("vnca: ") == 1
    assert "vnca: scratch: no room" in done.stderr
    assert "Traceback" not in done.stderr


def test_mpirun_without_mpi4py_is_refused(vnca: Any, model: Path, monkeypatch: Any) -> None:
    launched.cache_clear()
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    try:
        outcome = vnca("info", model)
        assert "started by mpirun, which needs mpi4py: pip install 'vnca[mpi]'" in outcome.complaint
        with pytest.raises(BackendUnavailableError):
            launched()
    finally:
        monkeypatch.undo()
        launched.cache_clear()
