"""Tables of trainings: read, trained side by side, and told of in one page."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from vnca.core.errors import FileFormatError, OptionError
from vnca.farm.sweep import REPORT, Sweep, shared_budget, sweep_job, train_all
from vnca.io import write_smoke
from vnca.recipe import SILENT
from vnca.rule.model import MODEL_NAME, Model

TINY = """
[settings.tiny]
iterations = 2
texture = 0
shortest_rollout = 2
longest_rollout = 3
rule = { hidden = 8, channels = 6 }
view = { size = 32 }
appearance = { samples = 64, layers = ["stem", "block1"] }
"""


class Notes:
    """A watch that keeps what it is told."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def progress(self, what: str, done: int, total: int, unit: str, note: str = "") -> None:
        pass

    def note(self, line: str) -> None:
        self.notes.append(line)

    def made(self, what: str, path: Path) -> None:
        pass


@pytest.fixture
def table(tiny_smoke: object, tmp_path: Path) -> Path:
    """Two pictures, of which one is no picture, and a setting that takes a moment."""
    write_smoke(tmp_path / "ball_0001.vdb", tiny_smoke)  # type: ignore[arg-type]
    gradient = Image.linear_gradient("L").resize((40, 40))
    Image.merge("RGB", [gradient, gradient.rotate(90), gradient]).save(tmp_path / "night.png")
    (tmp_path / "broken.png").write_bytes(b"no picture")
    path = tmp_path / "a table.toml"
    path.write_text(
        'frame = "ball_0001.vdb"\npictures = ["broken.png", "night.png"]\nout = "runs"\n'
        f'device = "cpu"\n{TINY}'
    )
    return path


def test_a_table_is_every_combination(table: Path) -> None:
    text = table.read_text().replace("device", "seeds = [3, 4]\ndevice")
    table.write_text(text + "[settings.wide]\nrule = { hidden = 32 }\n")
    sweep = Sweep.load(table)
    assert [training.name for training in sweep.trainings] == [
        f"{picture}_{setting}_{seed}"
        for setting in ("tiny", "wide")
        for picture in ("broken", "night")
        for seed in (3, 4)
    ]
    last = sweep.trainings[-1]
    assert (last.config.rule.hidden, last.config.seed) == (32, 4)
    assert last.picture == table.parent / "night.png"
    assert sweep.folder(last) == table.parent / "runs" / "night_wide_4"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("frame =", "frmae ="), "frmae: no such option"),
        (lambda text: re.sub("frame = .*", "", text), "frame is missing"),
        (lambda text: text.replace('["broken.png", "night.png"]', "3"), "pictures 3: expected a"),
        (lambda text: text.replace("iterations", "itertions"), "settings.tiny.itertions: no such"),
        (lambda text: text.replace("hidden = 8", 'hidden = "8"'), "settings.tiny.rule.hidden '8'"),
        (lambda text: text.replace("iterations = 2", "seed = 2"), "without the seed"),
        (lambda text: text.replace("broken", "night"), "two trainings are called night_tiny_0"),
        (lambda text: text + "[", "a table.toml:1"),
    ],
)
def test_a_table_that_cannot_be_is_refused_by_its_name(
    table: Path, change: Callable[[str], str], words: str
) -> None:
    table.write_text(change(table.read_text()))
    with pytest.raises(FileFormatError, match=re.escape(words)) as refused:
        Sweep.load(table)
    assert str(refused.value).startswith(str(table))


def test_what_is_free_is_not_shared() -> None:
    assert shared_budget("8GB", 2) == "4000MB"
    assert shared_budget("auto", 1) == "auto"
    with pytest.raises(OptionError, match="name a size"):
        shared_budget("auto", 2)


def test_a_farm_does_each_and_then_the_report(table: Path) -> None:
    tasks = sweep_job(table, ("vnca",)).tasks
    call = ("vnca", "sweep", str(table))
    assert [task.words for task in tasks] == [
        (*call, "--only", "broken_tiny_0"),
        (*call, "--only", "night_tiny_0"),
        (*call, "--report"),
    ]
    assert tasks[-1].after == ("broken_tiny_0", "night_tiny_0")


def test_one_that_fails_does_not_stop_the_others(table: Path) -> None:
    """And whoever calls it again goes on: what is done is left as it is."""
    sweep, watch = Sweep.load(table), Notes()
    assert train_all(sweep, 2, "2GB", watch) == ["broken_tiny_0"]
    (note,) = watch.notes
    assert "broken_tiny_0.log says why" in note
    assert "broken.png" in (sweep.table.out / "broken_tiny_0.log").read_text()
    done = sweep.table.out / "night_tiny_0" / MODEL_NAME
    assert Model.load(done).training["seed"] == 0
    before = done.stat().st_mtime_ns
    sweep.train(sweep.named("night_tiny_0"), "auto", SILENT)
    assert done.stat().st_mtime_ns == before
    table.write_text(table.read_text().replace("iterations = 2", "iterations = 3"))
    other = Sweep.load(table)
    with pytest.raises(OptionError, match="was begun with another iterations than"):
        other.train(other.named("night_tiny_0"), "auto", SILENT)
    path = sweep.report()
    assert path.name == REPORT
    page = path.read_text()
    assert "trainings: 2, of which 1 are done" in page
    assert page.count("<img") == 2  # the picture, and what it paints; of the broken one its name
    assert "broken.png" in page
    assert "2 of 2" in page
    assert "not begun" in page
    assert not re.search(r'(src|href)="(?!data:)', page)


def test_a_report_of_nothing_yet(table: Path) -> None:
    shutil.rmtree(table.parent / "runs", ignore_errors=True)
    page = Sweep.load(table).report().read_text()
    assert "trainings: 2, of which 0 are done" in page
    assert "Nothing has been learned yet." in page
