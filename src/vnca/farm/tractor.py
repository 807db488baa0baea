"""Jobs as Pixar's Tractor has them: a job script in the format of Alfred, for `tractor-spool`.

Reference: Tractor, Job Scripting and Job Scripting Operators: launch expressions are lists of Tcl
that no shell sees; a task is done after its subtasks; `Instance` names one that stands elsewhere.
"""

import re
from collections.abc import Iterator

from vnca.core.errors import OptionError
from vnca.farm.job import Job, Task

_PLAIN = re.compile(r"[\w./:=,@+-]+")
_RETRIED = "1 137 143"
"""Exit codes after which a command is tried again: not 2, which only a user can mend."""
SERVICE = "PixarRender"
"""What a machine has to offer: what those of a new Tractor do."""


def written(job: Job) -> str:
    """The job script: tasks are nested in those that wait for them.

    Raises:
        OptionError: If a word has a per cent sign, which Tractor replaces.
    """
    job = job.cut()
    by_name = {task.name: task for task in job.tasks}
    waited_for = {name for task in job.tasks for name in task.after}
    written: set[str] = set()
    lines = ["##AlfredToDo 3.0", f"Job -title {_word(job.title)} -serialsubtasks 0 -subtasks {{"]
    for task in job.tasks:
        if task.name not in waited_for:
            lines += _lines(task, job, by_name, written, "  ")
    return "\n".join([*lines, "}", ""])


def _lines(
    task: Task, job: Job, by_name: dict[str, Task], written: set[str], margin: str
) -> Iterator[str]:
    title = _word(task.name)
    if task.name in written:
        yield f"{margin}Instance {title}"
        return
    written.add(task.name)
    yield f"{margin}Task {title} -serialsubtasks 0 -subtasks {{"
    for name in task.after:
        yield from _lines(by_name[name], job, by_name, written, margin + "  ")
    yield f"{margin}}} -cmds {{"
    words = task.words
    if job.environment:
        words = ("env", *(f"{name}={value}" for name, value in job.environment.items()), *words)
    retried = f" -retryrc {{{_RETRIED}}}" if job.retries else ""
    command = " ".join(map(_word, words))
    yield f"{margin}  RemoteCmd {{{command}}} -service {{{SERVICE}}}{retried}"
    yield f"{margin}}}"


def _word(text: str) -> str:
    """An element of a list of Tcl that stands for a text.

    Raises:
        OptionError: If Tractor would replace something in it.
    """
    if "%" in text:
        raise OptionError(f"{text}: Tractor replaces what follows a per cent sign; rename it")
    if _PLAIN.fullmatch(text):
        return text
    if not re.search(r"[{}\\\n]", text):
        return f"{{{text}}}"
    return re.sub(r"[^\w./:=,@+-]", lambda found: _escaped(found[0]), text)


def _escaped(character: str) -> str:
    return r"\n" if character == "\n" else f"\\{character}"
