"""The formats in which jobs are written, by name."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Literal, TypeAlias

from vnca.core.errors import OptionError
from vnca.core.files import whole_file
from vnca.farm.job import Job

Format: TypeAlias = Literal["openjd", "opencue", "tractor", "commands"]


def write_job(job: Job, format: Format, path: Path) -> None:
    """Write a job for a farm.

    Args:
        job: The job.
        format: `openjd` (Deadline Cloud), `opencue`, `tractor`, or `commands` of a shell.
        path: The file.

    Raises:
        OptionError: If the format has no way to say something of it.
        OutputError: If the file cannot be written.
    """
    written: Callable[[Job], str] = import_module(f"vnca.farm.{format}").written
    try:
        text = written(job).encode()
    except UnicodeEncodeError as error:
        raise OptionError(
            f"{error.object!r}: a path that is no text cannot be written into a job"
        ) from None
    with whole_file(path) as temporary:
        temporary.write_bytes(text)
