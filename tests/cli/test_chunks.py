"""Chunks of a sequence, painted apart: the same files as in one painting."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.io import read_smoke, write_smoke
from vnca.painting import Roll, RollState
from vnca.rule.model import MODEL_NAME, Model

Vnca = Callable[..., Any]
QUICK = ("--warmup", 4, "--steps-per-frame", 2)
DIRECTED = (
    *("--refine", 2, "--pattern-speed", 1, "--exposure", "age:0..3->0..0.5"),
    *("--masks", "right=advected(x:0..0.8)", "old=age:0..3", "--layers", "MODEL=@old"),
    *("--strength", "@right", "--steps-per-frame", "2 + 2 * @right"),
)


def files_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.vdb")}


class Chunks:
    """Paints chunks of the frames of smoke with a model, by the command line."""

    def __init__(self, vnca: Vnca, model: Path, smoke: Path, folder: Path) -> None:
        self.vnca, self.model, self.smoke, self.folder = vnca, model, smoke, folder

    def run(self, out: str, *options: object) -> Any:
        paths = self.model, self.smoke, "--out", self.folder / out
        layer = f"{self.model / MODEL_NAME}=@old"
        words = [layer if word == "MODEL=@old" else word for word in options]
        return self.vnca("stylize", *paths, *QUICK, *words)

    def state(self, name: str) -> Path:
        return self.folder / f"{name}.safetensors"


@pytest.fixture
def chunks(vnca: Vnca, model: Path, smoke: Path, tmp_path: Path) -> Chunks:
    return Chunks(vnca, model, smoke, tmp_path)


@pytest.mark.parametrize("options", [(), DIRECTED], ids=["plain", "directed"])
def test_chunks_one_after_the_other_are_the_whole_painting(
    chunks: Chunks, options: tuple[object, ...]
) -> None:
    assert chunks.run("whole", "--state-out", chunks.state("whole"), *options).code == 0
    first = ("--chunk", "1", "--state-out", chunks.state("a"))
    second = ("--chunk", "2", "--state-in", chunks.state("a"), "--state-out", chunks.state("b"))
    last = ("--chunk", "3", "--state-in", chunks.state("b"), "--state-out", chunks.state("c"))
    for chunk in (first, second, last):
        assert chunks.run("chunks", *chunk, *options).code == 0
    assert files_of(chunks.folder / "chunks") == files_of(chunks.folder / "whole")
    assert chunks.state("c").read_bytes() == chunks.state("whole").read_bytes()
    assert sorted(p.name for p in (chunks.folder / "chunks").iterdir()) == [
        f"ball_000{number}.vdb" for number in (1, 2, 3)
    ]


@pytest.mark.parametrize("options", [(), DIRECTED], ids=["plain", "directed"])
def test_a_preroll_from_the_first_frame_on_is_exact(
    chunks: Chunks, options: tuple[object, ...]
) -> None:
    assert chunks.run("whole", *options).code == 0
    assert chunks.run("chunk", "--chunk", "3", "--preroll", 2, *options).code == 0
    whole = files_of(chunks.folder / "whole")
    assert files_of(chunks.folder / "chunk") == {"ball_0003.vdb": whole["ball_0003.vdb"]}


def test_a_shorter_preroll_paints_something_else_and_says_so(chunks: Chunks) -> None:
    """Each file tells of its painting: frames of the whole are not taken for those of a chunk."""
    assert chunks.run("painted").code == 0
    whole = files_of(chunks.folder / "painted")
    asked = ("--chunk", "3", "--preroll", 0)
    assert "holds painted frames already" in chunks.run("painted", *asked, "--resume").complaint
    assert chunks.run("painted", *asked, "--overwrite").code == 0
    assert files_of(chunks.folder / "painted") != whole
    assert chunks.run("again", "--chunk", "3", "--preroll", 0, "--state-out", chunks.state("s"))
    refused = chunks.run("x", "--chunk", "3", "--state-in", chunks.state("s")).complaint
    assert "--preroll is another" in refused


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--state-in", "a"], "--state-in: begins a chunk; name its frames with --chunk"),
        (["--chunk", "1,3"], "frame 2 lies between these"),
        (["--chunk", "7-9"], "--chunk 7-9: none of these frames is in the sequence, 1 to 3"),
        (["--chunk", "x"], "expected something like 30-53"),
        (["--chunk", "2", "--preroll", "-1"], "--preroll -1: must not be negative"),
        (["--chunk", "2", "--state-in", "a", "--preroll", "1"], "one of them, not both"),
        (["--chunk", "2", "--state-in", "a", "--state-out", "a"], "two files are needed"),
        (["--chunk", "2", "--state-in", "nothing"], "nothing: no such file"),
        (["--chunk", "3", "--state-in", "a"], "goes on with frame 2, and the chunk begins with"),
        (["--chunk", "2", "--state-in", "a", "--seed", "1"], "--seed is another"),
        (["--chunk", "2", "--state-in", "a", "--refine", "2"], "--refine is another"),
        (["--chunk", "2", "--state-in", "a", "--frames", "1-2"], "the list of frames is another"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_does_not_fit_is_refused_in_one_line(
    chunks: Chunks, options: list[str], words: str
) -> None:
    state = chunks.state("a")
    assert chunks.run("out", "--chunk", "1", "--state-out", state).code == 0
    before = files_of(chunks.folder / "out")
    asked = [str(state) if word == "a" else word for word in options]
    assert words in chunks.run("out", *asked).complaint
    assert files_of(chunks.folder / "out") == before


def test_a_state_of_another_rule_or_lattice_is_refused(
    chunks: Chunks, model: Path, smoke: Path
) -> None:
    state = chunks.state("a")
    asked = ("--chunk", "2", "--state-in", state)
    assert chunks.run("out", "--chunk", "1", "--state-out", state).code == 0
    whole = state.read_bytes()
    state.write_bytes(whole[: len(whole) // 2])
    assert "name another as --state-in" in chunks.run("out", *asked).complaint
    state.write_bytes(whole)
    assert "--gamma is another" in chunks.run("out", *asked, "--gamma", 2).complaint
    rule = Model.load(model).rule
    other = replace(rule, bias=rule.bias + 1)
    Model(other).save(chunks.folder / "other.safetensors")
    chunks.model = chunks.folder / "other.safetensors"
    assert "the model is another" in chunks.run("out", *asked).complaint
    chunks.model = model
    for path in smoke.iterdir():
        volume = read_smoke(path)
        matrix = volume.index_to_world @ np.diag([2.0, 2, 2, 1])
        write_smoke(path, replace(volume, index_to_world=matrix))
    assert "the place of its cells in the world is another" in chunks.run("out", *asked).complaint


def test_a_chunk_goes_on_after_an_end(chunks: Chunks, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also one that ended in its pre-roll; what it hands over is the same, too."""
    asked = ("--chunk", "2-3", "--preroll", 1)
    assert chunks.run("whole", *asked, "--state-out", chunks.state("whole")).code == 0
    ends, names = iter((1, 2, 3)), ("passed", "stepped")

    def ending(name: str) -> None:
        do = getattr(Roll, name)

        def eventful(self: Roll, smoke: object, state: RollState) -> object:
            nonlocal left
            left -= 1
            if left == 0:
                raise KeyboardInterrupt
            return do(self, smoke, state)

        monkeypatch.setattr(Roll, name, eventful)

    left = 0
    for name in names:
        ending(name)
    for end in ends:
        left = end
        out = f"ended_{end}"
        left_behind = ("--state-out", chunks.state(out))
        assert chunks.run(out, *asked, *left_behind).code == 130
        left = 0
        assert chunks.run(out, *asked, *left_behind, "--resume").code == 0
        assert files_of(chunks.folder / out) == files_of(chunks.folder / "whole")
        assert chunks.state(out).read_bytes() == chunks.state("whole").read_bytes()
    # A farm that is not sure does it once more.
    assert chunks.run(out, *asked, *left_behind, "--resume").code == 0
    assert chunks.state(out).read_bytes() == chunks.state("whole").read_bytes()


def test_chunks_share_a_folder_and_leave_each_other_alone(chunks: Chunks) -> None:
    out = chunks.folder / "out"
    assert chunks.run("out", "--chunk", "3", "--preroll", 2).code == 0
    painted = files_of(out)
    other = out / ".ball_0001.unfinished-abcd1234.vdb"
    other.write_bytes(b"another machine is writing this")
    assert chunks.run("out", "--chunk", "2", "--preroll", 1).code == 0
    assert other.exists()
    assert files_of(out)["ball_0003.vdb"] == painted["ball_0003.vdb"]


def test_a_broken_frame_before_a_chunk_is_held_as_in_the_whole(chunks: Chunks, smoke: Path) -> None:
    (smoke / "ball_0002.vdb").write_bytes(b"broken")
    for on_error in ("hold", "skip"):
        asked = ("--on-error", on_error)
        assert chunks.run(on_error, *asked).code == 0
        whole = files_of(chunks.folder / on_error)
        out, state = f"{on_error} chunk", chunks.state(on_error)
        assert chunks.run(out, *asked, "--chunk", "3", "--preroll", 2).code == 0
        assert chunks.run(out, *asked, "--chunk", "1", "--state-out", state).code == 0
        assert chunks.run(out, *asked, "--chunk", "2", "--state-in", state).code == 0
        assert files_of(chunks.folder / out) == whole


@pytest.mark.parametrize("kills", [2, pytest.param(20, marks=pytest.mark.slow)])
def test_a_chunk_that_is_killed_at_any_moment_goes_on_to_the_same_bytes(
    chunks: Chunks, tmp_path: Path, kills: int
) -> None:
    """kill -9, as when a machine of the farm is taken away."""
    begun = time.monotonic()
    _finished(_chunk(chunks, tmp_path / "whole"))
    lasts = time.monotonic() - begun
    moments = random.Random(5)
    for kill in range(kills):
        out = tmp_path / f"killed_{kill}"
        process = _chunk(chunks, out)
        time.sleep(lasts * moments.uniform(0.2, 1))
        process.send_signal(signal.SIGKILL)
        process.communicate()
        _finished(_chunk(chunks, out))
        assert files_of(out) == files_of(tmp_path / "whole")
        assert (out / "state").read_bytes() == (tmp_path / "whole" / "state").read_bytes()


def _chunk(chunks: Chunks, out: Path) -> subprocess.Popen[bytes]:
    words = ("stylize", chunks.model, chunks.smoke, "--out", out, "--chunk", "2-3", "--preroll", 1)
    words += (*QUICK, "--state-out", out / "state", "--resume", "--refine", 4)
    return subprocess.Popen(
        [sys.executable, "-m", "vnca", *map(str, words)],
        stderr=subprocess.PIPE,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )


def _finished(process: subprocess.Popen[bytes]) -> None:
    _, told = process.communicate()
    assert process.returncode == 0, told


def test_parts_of_a_painting_are_done_one_by_one(vnca: Vnca, smoke: Path, tmp_path: Path) -> None:
    """As a farm does it; the film is the same to the bit as that of one call."""
    small = ("--refine", 1, "--rows", 32, "--columns", 32)
    style = ("paint", smoke, "--style", "ink", *small)
    whole, farmed = tmp_path / "whole", tmp_path / "farmed"
    assert vnca(*style, "--out", whole).code == 0
    parts = (*style, "--out", farmed, "--resume", "--only")
    assert "ball_0001.vdb: is not painted yet" in vnca(*parts, "film").complaint
    assert vnca(*parts, "paint", "--chunk", "1-2").code == 0
    assert "ball_0003.vdb: is not painted yet" in vnca(*parts, "film").complaint
    assert vnca(*parts, "paint", "--chunk", "3", "--preroll", 2).code == 0
    assert not (farmed / "film.mp4").exists()
    assert vnca(*parts, "film").code == 0
    assert files_of(farmed / "painted") == files_of(whole / "painted")
    assert (farmed / "film.mp4").read_bytes() == (whole / "film.mp4").read_bytes()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--style", "ink", "--chunk", "1"], "--chunk: needs --only paint"),
        (["--style", "ink", "--only", "train"], "ink is a model, which is trained already"),
        (["--style", "ink", "--only", "film", "--without-film"], "one of them, not both"),
        (["picture.png", "--only", "paint"], "no model to paint with yet; --only train first"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_parts_that_cannot_be_done_are_refused(
    vnca: Vnca, smoke: Path, tmp_path: Path, options: list[str], words: str
) -> None:
    assert words in vnca("paint", smoke, "--out", tmp_path / "out", *options).complaint
