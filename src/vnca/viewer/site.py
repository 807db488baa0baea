"""A page as a folder that any web server can hold."""

from collections.abc import Callable
from pathlib import Path

from vnca.core.errors import OutputError
from vnca.core.files import whole_file, writable_folder
from vnca.viewer import SMOKE_NAME, Show, contents


def export(show: Show, folder: Path, write_smoke: Callable[[Path], None]) -> None:
    """Write a site: all its addresses are relative, so it works in a folder of any name.

    `index.html` comes last: a site that can be opened is whole.

    Args:
        show: What it shows.
        folder: Where; it may hold an earlier site, and nothing else that is called the same.
        write_smoke: Writes the sequence to a path.

    Raises:
        OutputError: If it cannot be written.
    """
    writable_folder(folder)
    made = contents(show)
    index = made.pop("index.html")
    try:
        (folder / "index.html").unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error
    write_smoke(folder / SMOKE_NAME)
    for name, content in [*made.items(), ("index.html", index)]:
        with whole_file(folder / name) as temporary:
            temporary.write_bytes(content)
