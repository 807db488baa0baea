"""Jobs as OpenCue has them: a job specification in XML, for `opencue.api.launchSpec`.

Reference: OpenCue, Job Specification Language (cjsl-1.12.dtd), and the tokens of its commands.
"""

import getpass
import os
import re
import shlex
from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from vnca.core.errors import OptionError
from vnca.farm.job import Job, Task

_HEAD = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<!DOCTYPE spec SYSTEM "http://localhost:8080/spcue/dtd/cjsl-1.12.dtd">\n'
)
SHOW, SHOT = "testing", "vnca"
"""Under which the job is listed; `testing` is the show that a new OpenCue has."""
_CHUNK = "#FRAME_START#-#FRAME_END#"
_TOKEN = re.compile(r"#[A-Z_]+#")


def written(job: Job) -> str:
    """The specification: a layer a task, whose frames OpenCue hands out in chunks.

    Raises:
        OptionError: If a frame has a negative number, or a word looks like a token.
    """
    spec = Element("spec")
    for name, text in (("show", SHOW), ("shot", SHOT), ("user", getpass.getuser())):
        SubElement(spec, name).text = text
    if hasattr(os, "getuid"):
        SubElement(spec, "uid").text = str(os.getuid())
    listed = SubElement(spec, "job", name=_name(job.title, "vnca"))
    SubElement(listed, "paused").text = "0"
    SubElement(listed, "maxretries").text = str(job.retries)
    if job.environment:
        variables = SubElement(listed, "env")
        for name, value in job.environment.items():
            SubElement(variables, "key", name=name).text = value
    names = {task.name: _name(task.name, f"l{at}") for at, task in enumerate(job.tasks, 1)}
    layers = SubElement(listed, "layers")
    for task in job.tasks:
        _layer(layers, task, names[task.name])
    _depends(SubElement(spec, "depends"), job.tasks, listed.attrib["name"], names)
    indent(spec)
    return _HEAD + tostring(spec, encoding="unicode") + "\n"


def _layer(layers: Element, task: Task, name: str) -> None:
    for word in task.words:
        if found := _TOKEN.search(word):
            raise OptionError(f"{word}: OpenCue takes {found[0]} for a token; rename it")
    layer = SubElement(layers, "layer", name=name, type="Render")
    words, shown = task.words, "1"
    if task.frames is not None:
        words, shown = task.with_chunk(_CHUNK), str(task.frames)
        if task.frames.numbers[0] < 0:
            raise OptionError(
                f"frame {task.frames.numbers[0]}: OpenCue has no negative frames; use `handover` "
                "state, which has a task a chunk, or number them from 0"
            )
    # A shell reads the command; tokens hold nothing that it would take for more than text.
    command = " ".join(word if word == _CHUNK else shlex.quote(word) for word in words)
    SubElement(layer, "cmd").text = command
    SubElement(layer, "range").text = shown
    SubElement(layer, "chunk").text = "1" if task.frames is None else str(task.frames.size)


def _depends(depends: Element, tasks: Iterable[Task], job: str, names: dict[str, str]) -> None:
    for task in tasks:
        for before in task.after:
            depend = SubElement(depends, "depend", type="LAYER_ON_LAYER", anyframe="False")
            for tag, text in (
                ("depjob", job),
                ("deplayer", names[task.name]),
                ("onjob", job),
                ("onlayer", names[before]),
            ):
                SubElement(depend, tag).text = text


def _name(text: str, unique: str) -> str:
    """A name as OpenCue allows: small letters, digits and underscores, at least three."""
    plain = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
    return f"{unique}_{plain or 'job'}"
