"""Jobs of shots: what is trained, painted and filmed, and what waits for what."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from vnca.core.errors import OptionError, SequenceError, VncaError
from vnca.farm.shots import Chunks, shots_job

VNCA = ("vnca",)


def tasks_of(shot: Path, **options: Any) -> dict[str, tuple[list[str], tuple[str, ...]]]:
    """Of each task, what follows the folder of the painting, and what it waits for."""
    job = shots_job([shot], Chunks(**options), VNCA).cut()
    common = ("vnca", "paint", str(shot), "--out")
    for task in job.tasks:
        assert task.words[:4] == common
    return {task.name: ([*task.words[5:]], task.after) for task in job.tasks}


def test_a_state_is_handed_from_chunk_to_chunk(shot: Path) -> None:
    state = str(shot.parent / "painted" / ".state_0003.safetensors")
    paint = ["--resume", "--only", "paint", "--chunk"]
    assert tasks_of(shot, chunk_size=3) == {
        "a shot paint 1-3": ([*paint, "1-3", "--state-out", state], ()),
        "a shot paint 5-6": ([*paint, "5-6", "--state-in", state], ("a shot paint 1-3",)),
        "a shot film": (["--resume", "--only", "film"], ("a shot paint 5-6",)),
    }


def test_chunks_after_a_preroll_wait_for_nothing(shot: Path) -> None:
    paint = ["--resume", "--only", "paint", "--chunk"]
    assert tasks_of(shot, chunk_size=4, handover="preroll", preroll=9) == {
        "a shot paint 1-5": ([*paint, "1-5", "--preroll", "9"], ()),
        "a shot paint 6-6": ([*paint, "6-6", "--preroll", "9"], ()),
        "a shot film": (
            ["--resume", "--only", "film"],
            ("a shot paint 1-5", "a shot paint 6-6"),
        ),
    }


def test_a_shot_with_a_picture_is_trained_first(shot: Path) -> None:
    shot.write_text(shot.read_text().replace('style = "ink"', 'picture = "night.png"'))
    found = tasks_of(shot, handover="preroll")
    assert found["a shot train"] == (["--resume", "--only", "train"], ())
    assert found["a shot paint 1-6"][1] == ("a shot train",)


def test_a_shot_without_a_film_is_painted_only(shot: Path) -> None:
    text = shot.read_text().partition("[film]")[0]
    shot.write_text(text + "without_film = true\n")
    assert [*tasks_of(shot)] == ["a shot paint 1-6"]


def test_styles_and_seeds_are_painted_side_by_side(shot: Path) -> None:
    job = shots_job([shot], Chunks(styles=("ink", "frost"), seeds=(3, 4)), VNCA)
    films = [task for task in job.tasks if task.name.endswith("film")]
    assert [task.name for task in films] == [
        f"a shot {style} {seed} film" for style in ("ink", "frost") for seed in (3, 4)
    ]
    folders = {task.words[4] for task in job.tasks}
    assert folders == {
        str(shot.parent / "painted" / f"{style}_{seed}")
        for style in ("ink", "frost")
        for seed in (3, 4)
    }
    assert films[0].words[5:9] == ("--style", "ink", "--seed", "3")


def test_several_shots_are_one_job(shot: Path) -> None:
    other = shot.with_name("other.toml")
    other.write_text(shot.read_text().replace('"painted"', '"elsewhere"'))
    job = shots_job([shot, other], Chunks(), VNCA)
    assert job.title == "a shot other"
    assert [task.name for task in job.tasks] == [
        "a shot paint 1-6", "a shot film", "other paint 1-6", "other film",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (lambda text: text.replace('out = "painted"\n', ""), OptionError, "names no `out`"),
        (lambda text: text.replace('"smoke"', '"gone"'), SequenceError, "no such file or folder"),
        (lambda text: text.replace("style =", "styel ="), VncaError, "did you mean style"),
        (lambda text: text.replace('style = "ink"\n', ""), OptionError, "expected one of them"),
    ],
)
def test_a_shot_that_cannot_be_painted_is_refused(
    shot: Path, change: Callable[[str], str], error: type[VncaError], words: str
) -> None:
    shot.write_text(change(shot.read_text()))
    with pytest.raises(error, match=words):
        shots_job([shot], Chunks(), VNCA)


def test_two_shots_do_not_paint_to_one_folder(shot: Path) -> None:
    other = shot.with_name("other.toml")
    other.write_text(shot.read_text())
    with pytest.raises(OptionError, match="both a shot and other would paint there"):
        shots_job([shot, other], Chunks(), VNCA)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"chunk_size": 0}, "expected 1 to 150"),
        ({"handover": "preroll", "preroll": -1}, "must not be negative"),
        ({"preroll": 4}, "needs `handover` preroll"),
        ({"seeds": (1, 1)}, "one is there twice"),
    ],
)
def test_chunks_that_cannot_be_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(OptionError, match=words):
        Chunks(**options)
