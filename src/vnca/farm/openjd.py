"""Jobs as Open Job Description has them, which AWS Deadline Cloud runs and `openjd run` tries.

Reference: Open Job Description, Template Schemas (jobtemplate-2023-09); RFC 0001, Task Chunking.
"""

import json
from collections.abc import Iterable
from typing import Any

from vnca.core.errors import OptionError, printable
from vnca.farm.job import Job, Task

CHUNKING = "TASK_CHUNKING"
_PARAMETER = "Frames"
_LONGEST = {"job": 128, "step": 64}


def written(job: Job) -> str:
    """The template, as JSON. Retries are the scheduler's: a template has no word for them.

    Raises:
        OptionError: If a word looks like a parameter of the template.
    """
    names = _step_names(job.tasks)
    template: dict[str, Any] = {
        "specificationVersion": "jobtemplate-2023-09",
        "name": _literal(_named(job.title, "job")),
        "steps": [_step(task, names) for task in job.tasks],
    }
    if any(task.frames is not None for task in job.tasks):
        template["extensions"] = [CHUNKING]
    if job.environment:
        variables = {name: _literal(value) for name, value in job.environment.items()}
        template["jobEnvironments"] = [{"name": "variables", "variables": variables}]
    return json.dumps(template, indent=2, ensure_ascii=False) + "\n"


def _step(task: Task, names: dict[str, str]) -> dict[str, Any]:
    program, *arguments = map(_literal, task.words)
    step: dict[str, Any] = {"name": names[task.name]}
    if task.after:
        step["dependencies"] = [{"dependsOn": names[name]} for name in task.after]
    if task.frames is not None:
        step["parameterSpace"] = {
            "taskParameterDefinitions": [
                {
                    "name": _PARAMETER,
                    "type": "CHUNK[INT]",
                    "range": str(task.frames),
                    "chunks": {
                        "defaultTaskCount": task.frames.size,
                        "rangeConstraint": "CONTIGUOUS",
                    },
                }
            ]
        }
        program, *arguments = task.with_chunk(f"{{{{Task.Param.{_PARAMETER}}}}}")
    step["script"] = {"actions": {"onRun": {"command": program, "args": arguments}}}
    return step


def _step_names(tasks: Iterable[Task]) -> dict[str, str]:
    """What tasks are called in the template: short names that differ."""
    names: dict[str, str] = {}
    for number, task in enumerate(tasks, 1):
        name = _named(task.name, "step")
        if name in names.values():
            name = f"{number} {name}"[: _LONGEST["step"]]
        names[task.name] = name
    return names


def _named(text: str, kind: str) -> str:
    return printable(text)[: _LONGEST[kind]]


def _literal(text: str) -> str:
    """Text that stands for itself in a template.

    Raises:
        OptionError: If it cannot.
    """
    if "{{" in text or "}}" in text:
        raise OptionError(
            f"{text}: Open Job Description takes what stands in double braces for a parameter; "
            "rename it"
        )
    return text
