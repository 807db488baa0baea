"""Jobs in the formats of farms: judged by their own tools where these are to be had."""

import json
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from vnca.core.errors import OptionError
from vnca.farm.formats import write_job
from vnca.farm.job import Job
from vnca.farm.opencue import written as opencue
from vnca.farm.openjd import CHUNKING
from vnca.farm.openjd import written as openjd
from vnca.farm.shots import Chunks, shots_job
from vnca.farm.tractor import written as tractor

Recorder = Any
Expected = Callable[[Job], dict[str, tuple[list[str], set[str]]]]
OPENJD = str(Path(sys.executable).with_name("openjd"))
DTD = Path(__file__).parent.parent / "data" / "cjsl-1.12.dtd"


def judged(*words: str) -> str:
    """What the command line of Open Job Description says to a template that it takes."""
    done = subprocess.run([OPENJD, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_template_of_open_job_description_runs(
    job: Job, recorder: Recorder, tmp_path: Path
) -> None:
    """In chunks that its own tool cuts: never over a gap, each frame once, films at the end."""
    path = tmp_path / "job.json"
    write_job(job, "openjd", path)
    judged("check", str(path), "--extensions", CHUNKING)
    judged("run", str(path), "--extensions", CHUNKING)
    calls = recorder.calls
    assert {variable for _, variable in calls} == {'b "c" $d'}
    wanted = {task.name: task for task in job.tasks}
    for style in ("ink", "frost"):
        own = [words for words, _ in calls if style in words]
        chunks = [words[words.index("--chunk") + 1] for words in own if "--chunk" in words]
        assert chunks == ["1-2", "3-3", "5-6"]
        paint = wanted[f"a shot {style} paint"].with_chunk("1-2")
        assert own[0] == [*paint[len(recorder.program) :]]
        film = wanted[f"a shot {style} film"].words
        assert own[-1] == [*film[len(recorder.program) :]]


def test_a_template_paints_and_films_a_shot(shot: Path, tmp_path: Path) -> None:
    """As a farm does, from frames to film; the painting is that of one machine."""
    program = (sys.executable, "-m", "vnca")
    job = shots_job([shot], Chunks(chunk_size=3, handover="preroll"), program)
    path = tmp_path / "job.json"
    write_job(job, "openjd", path)
    judged("run", str(path), "--extensions", CHUNKING)
    whole = tmp_path / "whole"
    words = [*program, "paint", str(shot), "--out", str(whole), "--without-film"]
    subprocess.run(words, check=True, stderr=subprocess.DEVNULL)
    farmed = shot.parent / "painted"
    assert {p.name: p.read_bytes() for p in (farmed / "painted").iterdir()} == {
        p.name: p.read_bytes() for p in (whole / "painted").iterdir()
    }
    assert (farmed / "film.mp4").stat().st_size > 0


def test_long_names_are_cut_and_differ(job: Job) -> None:
    long = Job("t" * 300, tuple(job.tasks))
    renamed = [task.__class__(f"{'x' * 80} {n}", task.words) for n, task in enumerate(long.tasks)]
    template = json.loads(openjd(Job(long.title, tuple(renamed))))
    names = [step["name"] for step in template["steps"]]
    assert len({*names}) == len(names)
    assert max(map(len, names)) <= 64
    assert len(template["name"]) == 128


@pytest.mark.parametrize(
    ("written", "word", "complaint"),
    [
        (openjd, "a{{b}}", "double braces"),
        (tractor, "smoke_%04d", "per cent sign"),
        (opencue, "a #IFRAME# b", "#IFRAME#"),
    ],
)
def test_words_that_a_farm_would_replace_are_refused(
    job: Job, written: Callable[[Job], str], word: str, complaint: str
) -> None:
    task = job.tasks[-1]
    odd = task.__class__(task.name, (*task.words, word))
    with pytest.raises(OptionError, match=re.escape(complaint)):
        written(Job(job.title, (odd,)))


def test_opencue_has_no_negative_frames(job: Job) -> None:
    task = job.tasks[0]
    assert task.frames is not None
    below = task.frames.__class__((-2, -1), 2)
    with pytest.raises(OptionError, match="frame -2: OpenCue has no negative frames"):
        opencue(Job("below", (task.__class__(task.name, task.words, frames=below),)))


def content_models(dtd: str) -> dict[str, re.Pattern[str]]:
    """Which elements may stand in each, in which order, as the DTD has it."""
    found = re.findall(r"<!ELEMENT\s+(\w+)\s+\(([^>]*)\)(\*?)>", dtd)
    models = {}
    for name, model, _ in found:
        plain = "" if "#PCDATA" in model else re.sub(r"(\w+)", r"(?:\1 )", model).replace(",", "")
        models[name] = re.compile(plain)
    return models


def test_a_specification_of_opencue_is_as_its_dtd_says(job: Job, expected: Expected) -> None:
    text = opencue(job)
    models, spec = content_models(DTD.read_text()), ElementTree.fromstring(text)
    for element in spec.iter():
        inside = "".join(f"{child.tag} " for child in element)
        assert models[element.tag].fullmatch(inside), (element.tag, inside)
    names = [layer.attrib["name"] for layer in spec.iter("layer")]
    assert all(re.fullmatch(r"[a-z0-9_]{3,}", name) for name in names)
    assert len({*names}) == len(names)
    assert spec.findtext("job/env/key") == 'b "c" $d'
    waits = {
        (depend.findtext("deplayer"), depend.findtext("onlayer")) for depend in spec.iter("depend")
    }
    by_task = dict(zip((task.name for task in job.tasks), names, strict=True))
    assert waits == {(by_task[t.name], by_task[name]) for t in job.tasks for name in t.after}
    wanted = expected(job)
    for task, layer in zip(job.tasks, spec.iter("layer"), strict=True):
        command = layer.findtext("cmd") or ""
        chunks = task.frames.chunks() if task.frames else [(1, 1)]
        for first, last in chunks:
            # As OpenCue does it, in which a shell then reads it.
            told = command.replace("#FRAME_START#", str(first)).replace("#FRAME_END#", str(last))
            name = f"{task.name} {first}-{last}" if task.frames else task.name
            assert shlex.split(told) == wanted[name][0]
    (first, *_) = spec.iter("layer")
    assert (first.findtext("range"), first.findtext("chunk")) == ("1-3,5-6", "2")


OPERATORS = r"""
set ::tasks {}
proc option {name list} {
  array set found $list
  if {[info exists found($name)]} { return $found($name) }
}
proc Job args { eval [option -subtasks $args] }
proc Task {title args} {
  lappend ::tasks [list $title [children [option -subtasks $args]] [option -cmds $args]]
  eval [option -subtasks $args]
}
proc Instance title {}
proc children script {
  set ::found {}
  set child [interp create]
  $child eval {set names {}}
  $child eval {proc Task {title args} {lappend ::names $title}}
  $child eval {proc Instance title {lappend ::names $title}}
  $child eval $script
  set names [$child eval {set names}]
  interp delete $child
  return $names
}
proc RemoteCmd {command args} { return $command }
"""


def test_a_script_of_tractor_is_read_by_tcl_as_it_is_meant(job: Job, expected: Expected) -> None:
    tkinter = pytest.importorskip("tkinter")
    tcl = tkinter.Tcl()
    tcl.eval(OPERATORS)
    tcl.eval(tractor(job))
    split = tcl.splitlist
    found = {}
    for entry in split(tcl.eval("set ::tasks")):
        title, children, commands = split(entry)
        words = split(tcl.eval(commands))
        found[title] = [*words], {*split(children)}
    variable = "PAINT=" + 'b "c" $d'
    assert found == {
        name: (["env", variable, *words], after) for name, (words, after) in expected(job).items()
    }


def test_what_several_tasks_of_tractor_wait_for_is_done_once() -> None:
    from vnca.farm.job import Task

    tasks = Task("train", ("a",)), Task("x", ("b",), ("train",)), Task("y", ("c",), ("train",))
    text = tractor(Job("shared", tasks))
    assert text.count("Task train") == 1
    assert text.count("Instance train") == 1


def run_script(path: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["sh", str(path), *arguments], capture_output=True, text=True)


def test_a_script_runs_all_commands_in_order(
    job: Job, recorder: Recorder, expected: Expected, tmp_path: Path
) -> None:
    path = tmp_path / "jo b.sh"
    write_job(job, "commands", path)
    assert run_script(path).returncode == 0
    skipped = len(recorder.program)
    wanted = expected(job)
    assert recorder.calls == [([*words[skipped:]], 'b "c" $d') for words, _ in wanted.values()]
    listed = dict(line.split(":") for line in run_script(path, "list").stdout.splitlines())
    names = [*wanted]
    for number, waits in listed.items():
        assert {names[int(one) - 1] for one in waits.split()} == wanted[names[int(number) - 1]][1]
    recorder.calls_path.unlink()
    assert run_script(path, "4").returncode == 0
    assert [words for words, _ in recorder.calls] == [wanted[names[3]][0][skipped:]]
    assert run_script(path, "77").returncode == 2


@pytest.mark.parametrize(("times", "code", "calls"), [(2, 1, 3), (3, 1, 3), (1, 2, 1)])
def test_a_script_tries_again_what_may_go_well(
    job: Job, recorder: Recorder, tmp_path: Path, times: int, code: int, calls: int
) -> None:
    """But not what only a user can mend, which ends with code 2."""
    recorder.fails("1-2", times, code)
    path = tmp_path / "job.sh"
    write_job(job, "commands", path)
    done = run_script(path, "1")
    assert done.returncode == (0 if times < calls else code)
    assert len(recorder.calls) == calls


def test_a_path_that_is_no_text_is_refused(job: Job, tmp_path: Path) -> None:
    task = job.tasks[0]
    odd = Job("odd", (task.__class__("odd", ("vnca", "\udcff")),))
    with pytest.raises(OptionError, match="no text"):
        write_job(odd, "commands", tmp_path / "job.sh")
    assert not (tmp_path / "job.sh").exists()
