"""A painting that ended before its last frame, and how it goes on."""

import os
import shutil
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from vnca.core.volume import Volume
from vnca.engine import native
from vnca.io import SmokeFormat, read_smoke, write_painted, write_smoke
from vnca.io.sequence import find_frames
from vnca.painting import Roll, RollState
from vnca.painting.unfinished import Unfinished
from vnca.rule import Rule
from vnca.rule.model import MODEL_NAME, Model

Vnca = Callable[..., Any]
QUICK = ("--warmup", 4, "--steps-per-frame", 2)
During = Callable[[int, Callable[[], object]], None]
needs_bfloat16 = pytest.mark.skipif(
    native.unavailable("bfloat16") is not None, reason=str(native.unavailable("bfloat16"))
)
STATE = ".ball_0001.resume.safetensors"


def control_c() -> None:
    raise KeyboardInterrupt


class Painted:
    """A painting of the three frames of smoke, and the folder it is in."""

    def __init__(self, vnca: Vnca, model: Path, smoke: Path, out: Path) -> None:
        self.vnca, self.model, self.smoke, self.out = vnca, model, smoke, out

    def run(self, *options: object) -> Any:
        return self.vnca("stylize", self.model, self.smoke, "--out", self.out, *QUICK, *options)

    @property
    def files(self) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in self.out.iterdir()}


@pytest.fixture
def unharmed(vnca: Vnca, model: Path, smoke: Path, tmp_path: Path) -> dict[str, bytes]:
    """The files of a painting that came to its end at once."""
    painted = Painted(vnca, model, smoke, tmp_path / "unharmed")
    assert painted.run().code == 0
    return painted.files


@pytest.fixture
def painted(vnca: Vnca, model: Path, smoke: Path, tmp_path: Path) -> Painted:
    return Painted(vnca, model, smoke, tmp_path / "out")


@pytest.fixture
def during(monkeypatch: pytest.MonkeyPatch) -> "During":
    """Lets something happen while the n-th frame from now on is painted, counted from 1."""
    stepped, wait, event = Roll.stepped, 0, control_c

    def eventful(self: Roll, smoke: Volume, state: RollState) -> Any:
        nonlocal wait
        wait -= 1
        if wait == 0:
            event()
        return stepped(self, smoke, state)

    def set_event(frame: int, what: Callable[[], object]) -> None:
        nonlocal wait, event
        wait, event = frame, what

    monkeypatch.setattr(Roll, "stepped", eventful)
    return set_event


@pytest.fixture
def unfinished(painted: Painted, during: During) -> Painted:
    """Ended by Ctrl-C in its third frame."""
    during(3, control_c)
    outcome = painted.run()
    assert outcome.code == 130
    assert "stopped after 2 of 3 frames; --resume goes on" in outcome.err
    assert sorted(painted.files) == [STATE, "ball_0001.vdb", "ball_0002.vdb"]
    return painted


def test_a_painting_goes_on_to_the_same_files(
    unfinished: Painted, unharmed: dict[str, bytes]
) -> None:
    outcome = unfinished.run("--resume")
    assert outcome.code == 0
    assert "going on after 2 frames" in outcome.err
    assert unfinished.files == unharmed


def test_a_finer_painting_goes_on_to_the_same_files(painted: Painted, during: During) -> None:
    assert painted.run("--refine", 2).code == 0
    whole = painted.files
    during(3, control_c)
    assert painted.run("--refine", 2, "--overwrite").code == 130
    outcome = painted.run("--refine", 2, "--resume")
    assert "going on after 2 frames" in outcome.err
    assert painted.files == whole


@pytest.mark.parametrize("name", ["film.gif", "film.mp4"])
def test_a_film_is_the_same_whether_or_not_the_painting_was_interrupted(
    painted: Painted, during: During, tmp_path: Path, name: str
) -> None:
    size = ("--rows", 32, "--columns", 32, "--turn", 90)
    film, whole = tmp_path / "film" / name, tmp_path / "whole" / name
    during(3, control_c)
    assert painted.run("--preview", film, *size).code == 130
    assert not film.exists()
    leftover = film.with_name(f".film.unfinished-abcd1234{film.suffix}")
    leftover.write_bytes(b"of a film that was killed")
    assert painted.run("--preview", film, *size, "--resume").code == 0
    assert painted.run("--preview", whole, *size, "--overwrite").code == 0
    assert film.read_bytes() == whole.read_bytes()
    assert [path.name for path in film.parent.iterdir()] == [name]


def test_a_film_can_be_asked_for_when_all_frames_are_painted(
    painted: Painted, during: During, tmp_path: Path
) -> None:
    """SIGTERM came in the last frame, so only the film is missing."""
    film = tmp_path / "film.gif"
    options = ("--preview", film, "--rows", 32, "--columns", 32)
    during(3, lambda: os.kill(os.getpid(), signal.SIGTERM))
    assert painted.run(*options).code == 143
    assert not film.exists()
    during(1, lambda: pytest.fail("painted again"))
    assert painted.run(*options, "--resume").code == 0
    with Image.open(film) as pictures:
        assert getattr(pictures, "n_frames", 1) == 3


def test_sigterm_finishes_the_frame(
    painted: Painted, during: During, unharmed: dict[str, bytes]
) -> None:
    during(2, lambda: os.kill(os.getpid(), signal.SIGTERM))
    outcome = painted.run()
    assert outcome.code == 143
    assert "stopped after 2 of 3 frames" in outcome.err
    assert sorted(painted.files) == [STATE, "ball_0001.vdb", "ball_0002.vdb"]
    during(2, control_c)  # Nothing is painted twice: the third is the last.
    assert painted.run("--resume").code == 0
    assert painted.files == unharmed


def test_a_painting_ends_several_times(
    painted: Painted, during: During, unharmed: dict[str, bytes]
) -> None:
    options: list[str] = []
    for frame in (1, 3, 1):
        during(frame, control_c)
        assert painted.run(*options).code == 130
        options = ["--resume"]
    assert painted.run("--resume").code == 0
    assert painted.files == unharmed


def other_model(painted: Painted) -> None:
    model = Model.load(painted.model)
    rule = model.rule
    other = Rule(rule.hidden, rule.bias + 1, rule.output, rule.config, rule.scales)
    Model(other).save(painted.model / MODEL_NAME)


def touched(painted: Painted) -> None:
    os.utime(painted.smoke / "ball_0002.vdb", ns=(1, 1))


def one_more_frame(painted: Painted) -> None:
    shutil.copy(painted.smoke / "ball_0003.vdb", painted.smoke / "ball_0004.vdb")


def without_a_painted_frame(painted: Painted) -> None:
    (painted.out / "ball_0001.vdb").unlink()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--seed", 1], "--seed is another than when the painting was begun (0, now 1)"),
        (["--steps-per-frame", 5], "--steps-per-frame"),
        (["--refine", 2], "--refine is another than when the painting was begun (1, now 2)"),
        (["--domain", "box"], '--domain is another than when the painting was begun ("active", '),
        (["--strength", 0.5], "--strength"),
        (["--density-scale", 0.5], "--density-scale"),
        (["--gamma", 2], "--gamma is another than when the painting was begun (0.7, now 2.0)"),
        (["--colour-grid", "color"], "--colour-grid"),
        (["--backend", "reference"], "--backend"),
        pytest.param(["--precision", "bfloat16"], "--precision", marks=needs_bfloat16),
        (["--velocity-scale", 2], "--velocity-scale"),
        (["--frames", "1-2"], "the list of frames"),
        (other_model, "the model is another"),
        (one_more_frame, "the list of frames is another"),
        (touched, "ball_0002.vdb: has changed since it was painted"),
        (without_a_painted_frame, "ball_0001.vdb: was finished but is gone"),
    ],
    ids=lambda value: value.__name__ if callable(value) else str(value[0]) if value else "",
)
def test_a_painting_does_not_go_on_with_something_else(
    unfinished: Painted, options: Any, words: str
) -> None:
    if callable(options):
        options(unfinished)
        options = []
    before = unfinished.files
    complaint = unfinished.run("--resume", *options).complaint
    assert words in complaint
    assert "--resume" in complaint
    assert unfinished.files == before


def test_what_does_not_touch_the_files_may_be_another(
    unfinished: Painted, unharmed: dict[str, bytes], tmp_path: Path
) -> None:
    film = ("--preview", tmp_path / "film.gif", "--rows", 32, "--columns", 32)
    assert unfinished.run("--resume", *film, "--on-error", "hold").code == 0
    assert unfinished.files == unharmed


def test_the_steps_of_the_rule_may_be_asked_for_or_not(painted: Painted, during: During) -> None:
    steps = Model.load(painted.model).rule.config.steps_per_frame
    command = ("stylize", painted.model, painted.smoke, "--out", painted.out, "--warmup", 0)
    during(3, control_c)
    assert painted.vnca(*command).code == 130
    assert painted.vnca(*command, "--steps-per-frame", steps, "--resume").code == 0


def test_frames_that_are_there_are_replaced_only_if_asked_for(
    unfinished: Painted, during: During, unharmed: dict[str, bytes]
) -> None:
    before = unfinished.files
    assert "interrupted; go on with --resume, or choose" in unfinished.run().complaint
    during(1, control_c)
    assert unfinished.run("--overwrite").code == 130
    assert unfinished.files == before  # Still time to think again.
    assert unfinished.run("--overwrite").code == 0
    assert unfinished.files == unharmed
    complaint = unfinished.run("--seed", 1).complaint
    assert "holds painted frames already, such as ball_0001.vdb; choose another --out" in complaint
    assert unfinished.files == unharmed
    assert unfinished.run("--seed", 1, "--overwrite").code == 0
    assert unfinished.files != unharmed


def test_where_a_painting_is_overwritten_the_new_one_is_what_goes_on(
    unfinished: Painted, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A frame of another is in its place: the state must be that one's before the frame is."""
    save = Unfinished.save

    def only_first(self: Unfinished, path: Path) -> None:
        if self.sources:
            control_c()
        save(self, path)

    with monkeypatch.context() as patch:
        patch.setattr(Unfinished, "save", only_first)
        assert unfinished.run("--seed", 1, "--overwrite").code == 130
    assert "--seed is another" in unfinished.run("--resume").complaint
    assert "going on after 0 frames" in unfinished.run("--seed", 1, "--resume").err


def test_a_script_may_always_ask_to_go_on(
    painted: Painted, unharmed: dict[str, bytes], during: During, tmp_path: Path
) -> None:
    outcome = painted.run("--resume")
    assert outcome.code == 0
    assert "nothing unfinished there; starting with the first frame" in outcome.err
    during(1, lambda: pytest.fail("painted again"))
    film = tmp_path / "film.gif"
    outcome = painted.run("--resume", "--preview", film, "--rows", 32, "--columns", 32)
    assert outcome.code == 0
    assert "all 3 frames are painted already" in outcome.err
    assert film.exists()
    assert painted.files == unharmed


@pytest.mark.parametrize("change", [touched, other_model, without_a_painted_frame])
def test_frames_of_another_painting_are_not_taken_for_its_own(
    painted: Painted, change: Callable[[Painted], None]
) -> None:
    assert painted.run().code == 0
    change(painted)
    if change is touched:
        os.utime(painted.smoke / "ball_0002.vdb")
    before = painted.files
    assert "and none to go on from; choose" in painted.run("--resume").complaint
    assert painted.files == before
    assert painted.run("--resume", "--overwrite").code == 0


def test_parts_of_a_sequence_share_a_folder(
    painted: Painted, during: During, unharmed: dict[str, bytes]
) -> None:
    """As on a farm: one machine paints the first frames, another the last."""
    during(2, control_c)
    assert painted.run("--frames", "1-2").code == 130
    assert painted.run("--frames", "3").code == 0
    assert painted.run("--frames", "1-2", "--resume").code == 0
    assert sorted(painted.files) == sorted(unharmed)


def test_what_a_killed_run_left_is_cleared_away(
    unfinished: Painted, unharmed: dict[str, bytes]
) -> None:
    for name in (
        "ball_0003.unfinished-abcd1234.vdb",
        f"{STATE[:-12]}.unfinished-0_0_0_0_.safetensors",
    ):
        (unfinished.out / f".{name}").write_bytes(b"half")
    (unfinished.out / ".mine.vdb").write_bytes(b"mine")
    assert unfinished.run("--resume").code == 0
    assert unfinished.files == {**unharmed, ".mine.vdb": b"mine"}
    assert len(find_frames(unfinished.out)) == 3


def test_a_damaged_state_is_refused_in_one_line_or_does_no_harm(unfinished: Painted) -> None:
    state = unfinished.out / STATE
    whole, random = state.read_bytes(), np.random.default_rng(3)
    header = int.from_bytes(whole[:8], "little")
    refused = 0
    for trial in range(60):
        damaged = bytearray(whole)
        at = int(random.integers(0, 8 + header if trial % 4 else len(whole)))
        damaged[at] ^= 1 << int(random.integers(8))
        state.write_bytes(damaged)
        outcome = unfinished.run("--resume")
        if outcome.code:
            refused += 1
            assert "--resume" in outcome.complaint
    assert refused > 30
    for content in (b"", whole[:100], whole[:-1]):
        state.write_bytes(content)
        assert STATE in unfinished.run("--resume").complaint


@pytest.mark.parametrize("seconds", [1.0, 0.001])
def test_keeping_the_state_takes_little_time(
    painted: Painted, monkeypatch: pytest.MonkeyPatch, seconds: float
) -> None:
    """Where it is slow the state is kept less often, but always the first time and at the end."""
    now, saved, save = 0.0, [], Unfinished.save

    def slowly(self: Unfinished, path: Path) -> None:
        nonlocal now
        now += seconds
        saved.append(len(self.sources))
        save(self, path)

    def writing(*arguments: Any, **options: Any) -> None:
        nonlocal now
        now += 10
        write_painted(*arguments, **options)

    monkeypatch.setattr(Unfinished, "save", slowly)
    monkeypatch.setattr("vnca.painting.painter.write_painted", writing)
    monkeypatch.setattr("vnca.painting.behind.time.monotonic", lambda: now)
    assert painted.run().code == 0
    assert saved == ([0, 1, 3] if seconds == 1 else [0, 1, 2, 3])


def test_a_painting_does_not_go_on_where_its_cells_lie_elsewhere(
    painted: Painted, smoke: Path, during: During
) -> None:
    """The first frame was broken, and tells now of other cells than those that were painted on."""
    first = smoke / "ball_0001.vdb"
    whole = first.read_bytes()
    first.write_bytes(whole[:100])
    during(2, control_c)
    assert painted.run("--on-error", "skip").code == 130
    first.write_bytes(whole)
    volume = read_smoke(first, SmokeFormat())
    matrix = volume.index_to_world.copy()
    matrix[0, 3] += 0.03
    write_smoke(first, replace(volume, index_to_world=matrix))
    outcome = painted.run("--on-error", "skip", "--resume")
    assert outcome.code == 2
    assert "since the place of its cells in the world is another" in outcome.err
