"""Writing down what was measured."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vnca.core.errors import FileFormatError
from vnca.core.files import existing_file, whole_file

Row = Mapping[str, Any]


def write_json(path: Path, facts: Row, rows: Sequence[Row]) -> None:
    """One object: facts of the run, and its rows.

    Raises:
        OutputError: If it cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps({**facts, "rows": rows}, indent=2) + "\n")


def append_csv(path: Path, facts: Row, rows: Sequence[Row]) -> None:
    """Add rows, each with the facts of the run, to a table, or begin it.

    Raises:
        FileFormatError: If the table there has other columns.
        OutputError: If it cannot be written.
    """
    columns = [*facts, *rows[0]]
    earlier = ""
    if path.exists():
        earlier = existing_file(path).read_text()
        found = next(csv.reader(earlier.splitlines()), [])
        if found != columns:
            raise FileFormatError(
                f"{path}: a table with other columns than these; name another file"
            )
    text = io.StringIO()
    table = csv.DictWriter(text, columns, lineterminator="\n")
    if not earlier:
        table.writeheader()
    table.writerows({**facts, **row} for row in rows)
    with whole_file(path) as temporary:
        temporary.write_text(earlier + text.getvalue())
