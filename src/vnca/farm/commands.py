"""Jobs as a script of a POSIX shell, for one machine or any cluster that runs commands.

Reference: POSIX.1-2017, Shell Command Language.
"""

import shlex

from vnca.core.errors import printable
from vnca.farm.job import Job

_HEAD = """\
#!/bin/sh
# {title}: {count} tasks.
# `sh FILE` does them all, one after the other; `sh FILE 3` only the third.
# `sh FILE list` says which each has to wait for: its number, a colon, and theirs.
set -u
"""
_TAIL = """\
attempt() {{
  left={retries}
  while :; do
    task "$1" && return 0
    code=$?
    case $code in 2 | 130 | 143) return $code ;; esac  # mended by a user, or stopped
    [ "$left" -gt 0 ] || return $code
    left=$((left - 1))
  done
}}

if [ "${{1-}}" = list ]; then
  cat <<'END'
{listed}
END
  exit 0
fi
[ $# -gt 0 ] || set -- {all}
for number in "$@"; do
  attempt "$number" || exit $?
done
"""


def written(job: Job) -> str:
    """The script: each task a command, with the numbers of those that it waits for."""
    job = job.cut()
    numbers = {task.name: number for number, task in enumerate(job.tasks, 1)}
    waits = {task.name: [numbers[name] for name in task.after] for task in job.tasks}
    lines = [_HEAD.format(title=printable(job.title), count=len(numbers))]
    lines += [f"export {name}={shlex.quote(value)}" for name, value in job.environment.items()]
    lines += ["", "task() {", '  case "$1" in']
    for task in job.tasks:
        lines.append(f"  {numbers[task.name]})  # {printable(task.name)}")
        lines.append(f"    {shlex.join(task.words)} ;;")
    lines += ["  *)", '    echo "$0: no task $1" >&2', "    return 2 ;;", "  esac", "}", ""]
    listed = (f"{numbers[name]}: {' '.join(map(str, waits[name]))}".rstrip() for name in numbers)
    tail = _TAIL.format(
        retries=job.retries,
        listed="\n".join(listed),
        all=" ".join(map(str, numbers.values())),
    )
    return "\n".join([*lines, tail])
