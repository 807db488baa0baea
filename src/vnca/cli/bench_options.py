"""What the options of all benchmarks have in common: `64x64x96`, `plain,native`, and tables."""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args

from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from vnca.bench.measurement import append_csv, write_json
from vnca.cli.options import STDOUT, parse, print_json
from vnca.core.errors import OptionError
from vnca.core.files import writable_file
from vnca.core.typing import Index

T = TypeVar("T")
Rows = Sequence[Mapping[str, Any]]
_RULES = ConstructorRegistry()


def parse_bench(command: str, options: Callable[..., T], arguments: Sequence[str]) -> T:
    """As `parse`, with grids written as XxYxZ and names divided by commas."""
    with _RULES:
        return parse(f"bench {command}", options, arguments, separator=",")


@_RULES.primitive_rule
def _grid(asked: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Index] | None:
    if get_args(asked.type) != (int, int, int):
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="XxYxZ",
        instance_from_str=lambda words: _index(words[0]),
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda grid: ["x".join(map(str, grid))],
    )


@_RULES.primitive_rule
def _names(asked: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[tuple[str, ...]] | None:
    if get_args(asked.type) != (str, ...):
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="NAME,…",
        instance_from_str=lambda words: tuple(words[0].split(",")),
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda names: [",".join(names)],
    )


def _index(text: str) -> Index:
    numbers = text.split("x")
    if len(numbers) != 3 or not all(number.isdecimal() for number in numbers):
        raise OptionError(f"--grid {text}: expected cells along x, y and z, such as 64x64x96")
    x, y, z = map(int, numbers)
    return x, y, z


@dataclass(frozen=True)
class Tables:
    """Where what is measured is kept."""

    json: Path | None = None
    """Write the rows of this run here; - prints them, and the table on standard error."""
    csv: Path | None = None
    """Add the rows to this table."""

    def require_writable(self) -> None:
        """Refuse files that could not be written when all is measured.

        Raises:
            OutputError: If there is one.
        """
        for path in (None if self.json == STDOUT else self.json, self.csv):
            if path is not None:
                writable_file(path)

    def print(self, text: str) -> None:
        """Show a part of a table: on standard error where JSON is printed."""
        print(text, file=sys.stderr if self.json == STDOUT else sys.stdout)

    def keep(
        self, facts: Mapping[str, Any], rows: Rows, peaks: Mapping[str, Any] | None = None
    ) -> None:
        """Write the rows where they are asked for.

        Args:
            facts: What all rows share.
            rows: What was measured.
            peaks: Of the machine, for the object in JSON.

        Raises:
            VncaError: If a file cannot be written.
        """
        if self.json == STDOUT:
            print_json({**facts, **(peaks or {}), "rows": rows})
        elif self.json is not None:
            write_json(self.json, {**facts, **(peaks or {})}, rows)
        if self.csv is not None:
            append_csv(self.csv, facts, rows)


def short(value: float | None) -> str:
    """Three digits, or all before the point; nothing for what could not be measured."""
    if value is None:
        return ""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
