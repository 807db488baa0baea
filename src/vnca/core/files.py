"""Output appears whole under its final name, or not at all."""

import os
import re
import stat
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from vnca.core.errors import FileFormatError, OutputError

_TEMPORARY = re.compile(r"\.(?P<stem>.+)\.unfinished-[a-z0-9_]{8}(?P<suffix>\.[^.]+)?")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary file beside `path`; rename it to `path` when the block succeeds.

    The data is flushed to disk before the rename, and the rename after it, so a crash or a loss
    of power leaves either the old file or the new one, and the new one once this has returned.
    The temporary file keeps the suffix of `path`, for writers that look at it.

    Raises:
        OutputError: If the folder cannot be made or written, or the disk is full.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            prefix=f".{path.stem}.unfinished-", suffix=path.suffix, dir=path.parent
        )
        os.close(handle)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    temporary = Path(name)
    try:
        yield temporary
        with temporary.open("r+b") as file:
            os.fsync(file.fileno())
        # mkstemp makes files private to the user; outputs get the usual permissions.
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        with suppress(OSError):  # A disk that is gone takes the temporary file with it.
            temporary.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    # Some platforms and network disks cannot: there, a rename lasts as soon as they see to it.
    with suppress(OSError, AttributeError):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def remove_leftovers(folder: Path, names: Collection[str]) -> None:
    """Remove what a program that was killed while it wrote files of these names left in a folder.

    Only temporary files of `whole_file` are; never while another program may be writing them.

    Raises:
        OutputError: If one cannot be removed.
    """
    try:
        for file in folder.iterdir() if folder.is_dir() else ():
            match = _TEMPORARY.fullmatch(file.name)
            if match and match["stem"] + (match["suffix"] or "") in names:
                remove_file(file)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be listed ({error.strerror})") from error


def remove_file(path: Path) -> None:
    """Remove a file if it is there.

    Raises:
        OutputError: If it cannot be removed.
    """
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{path}: cannot be removed ({error.strerror})") from error


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
    try:
        status = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        target = f": it is a link to {path.readlink()}" if path.is_symlink() else ""
        raise FileFormatError(f"{path}: no such file{target}") from None
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read ({error.strerror})") from error
    if not stat.S_ISREG(status.st_mode):
        found = "a folder" if stat.S_ISDIR(status.st_mode) else "something else"
        raise FileFormatError(f"{path}: expected a file, found {found}")
    if status.st_size == 0:
        raise FileFormatError(f"{path}: the file is empty")
    if not os.access(path, os.R_OK):
        raise FileFormatError(f"{path}: no permission to read it")
    return path


def cache_folder() -> Path:
    """The folder of what can be made again; it may not exist yet."""
    if own := os.environ.get("VNCA_CACHE"):
        return Path(own)
    if shared := os.environ.get("XDG_CACHE_HOME"):
        return Path(shared) / "vnca"
    return Path.home() / ".cache" / "vnca"
