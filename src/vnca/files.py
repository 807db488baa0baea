"""Output appears whole under its final name, or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vnca.errors import FileFormatError, OutputError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary file beside `path`; rename it to `path` when the block succeeds.

    The data is flushed to disk before the rename, so a crash leaves either the old file or
    the new one. The temporary file keeps the suffix of `path`, for writers that look at it.

    Raises:
        OutputError: If the folder cannot be made or written, or the disk is full.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            prefix=f".{path.stem}.", suffix=path.suffix, dir=path.parent
        )
        os.close(handle)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    temporary = Path(name)
    try:
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        # mkstemp makes files private to the user; outputs get the usual permissions.
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)


def writable_folder(path: Path) -> Path:
    """`path`, if files can be put there as far as can be told; nothing is made yet.

    For asking before long work, whose output would come too late to learn it.

    Raises:
        OutputError: If it is a file, lies in one, or may not be written.
    """
    path = Path(path)
    there = next(f for f in (path.absolute(), *path.absolute().parents) if os.path.lexists(f))
    if not there.is_dir():
        raise OutputError(f"{path}: cannot be written ({there} is not a folder); choose another")
    if not os.access(there, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: cannot be written (no permission in {there}); choose another")
    return path


def writable_file(path: Path) -> Path:
    """`path`, if a file can be put there as far as can be told; nothing is made yet.

    Raises:
        OutputError: If it is a folder, or its folder cannot be written.
    """
    path = Path(path)
    if path.is_dir():
        raise OutputError(f"{path}: cannot be written (it is a folder); name a file")
    writable_folder(path.parent)
    return path


def existing_file(path: Path) -> Path:
    """`path`, if it is a readable, non-empty file.

    Raises:
        FileFormatError: If it is missing, a folder, empty or not readable.
    """
    path = Path(path)
    if not path.exists():
        raise FileFormatError(f"{path}: no such file")
    if not path.is_file():
        raise FileFormatError(f"{path}: expected a file, found a folder")
    if path.stat().st_size == 0:
        raise FileFormatError(f"{path}: the file is empty")
    if not os.access(path, os.R_OK):
        raise FileFormatError(f"{path}: no permission to read it")
    return path
