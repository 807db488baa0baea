"""A shot: all that is asked of a painting, as a TOML file; what is wrong is told by its place.

Paths in it are meant from the folder of the file.
"""

import dataclasses
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from vnca.core.errors import FileFormatError, OptionError, TextError
from vnca.core.files import existing_file
from vnca.core.records import require_known, with_values
from vnca.direction import NUMBERS, Direction
from vnca.direction.grammar import rebased

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SUFFIX = ".toml"
T = TypeVar("T")
_DIRECTION = "direction"
_TABLE = re.compile(r"\s*\[{1,2}\s*([^\[\]]+?)\s*\]{1,2}\s*(?:#.*)?")
_KEY = re.compile(
    r"""\s*(?P<key>(?:[\w.-]|\s*\.\s*|"[^"]*"|'[^']*')+?)\s*=\s*(?P<quote>["']{0,3})"""
)
_SYNTAX = re.compile(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", re.DOTALL)
_ARGUMENT = re.compile(r"`([\w.]+)`")
_FILES = ("sequence", "preset")
"""Texts that are paths, or may be."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A shot file.

    Attributes:
        path: Where it is.
        text: What it says.
        values: That as TOML has it.
    """

    path: Path
    text: str
    values: Mapping[str, Any]

    @classmethod
    def load(cls, path: str | Path) -> "Shot":
        """Read a shot file.

        Raises:
            FileFormatError: If it cannot be read, or is not TOML.
        """
        path = Path(path)
        try:
            text = existing_file(path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise FileFormatError(f"{path}: cannot be read as text ({error})") from error
        try:
            return cls(path, text, tomllib.loads(text))
        except (tomllib.TOMLDecodeError, RecursionError) as error:
            told = _SYNTAX.fullmatch(str(error))
            what, line, column = told.groups() if told else (str(error), None, None)
            last = text.count("\n") + 1
            raise FileFormatError(f"{path}:{line or last}:{column or 1}: {what}") from error

    def applied(self, default: T) -> T:
        """A dataclass of options with those of the shot.

        Args:
            default: An instance, with a `Direction` in its field `direction`, whose fields are keys
                of the file itself.

        Raises:
            FileFormatError: If a key is unknown, or has a value that cannot be.
            TextError: If the text of a value cannot be read.
        """
        hints = get_type_hints(type(default))
        directed = [field.name for field in dataclasses.fields(Direction)]
        known = {*hints, *directed} - {_DIRECTION}
        try:
            require_known(self.values, known)
        except OptionError as error:
            raise self._refused(error, of_key=True) from error
        direction = {n: v for n, v in self.values.items() if n in directed}
        others = {n: v for n, v in self.values.items() if n not in directed}
        try:
            asked = with_values(getattr(default, _DIRECTION), direction)
            others = {n: self._from_here(n, hints[n], v) for n, v in others.items()}
            others[_DIRECTION] = dataclasses.replace(asked, **dict(self._rebased(asked)))
            return with_values(default, others)
        except TextError as error:
            line, column = self._place(_named(error))
            where = f"{self.path}:{line}:{column + error.at}"
            raise TextError(f"{where}: {_plain(error)}", error.text, error.at) from error
        except OptionError as error:
            raise self._refused(error) from error

    def _refused(self, error: OptionError, *, of_key: bool = False) -> FileFormatError:
        line, column = self._place(_named(error), of_key=of_key)
        return FileFormatError(f"{self.path}:{line}:{column}: {_plain(error)}")

    def _from_here(self, name: str, hint: Any, value: Any) -> Any:
        """A value, with a path that is meant from the folder of the file."""
        is_path = Path in (hint, *get_args(hint)) or name in _FILES
        if not (is_path and isinstance(value, str)):
            return value
        is_word = name == "preset" and not value.endswith(SUFFIX)
        return value if is_word else str(self.path.parent / value)

    def _rebased(self, asked: Direction) -> Iterator[tuple[str, Any]]:
        """Those fields of a direction in which there are paths."""
        folder = self.path.parent
        for name in (*NUMBERS, "guide"):
            value = getattr(asked, name)
            if isinstance(value, str):
                yield name, rebased(value, folder)
        for name in ("masks", "style_mix", "layers", "blend"):
            yield name, tuple(_of_entry(each, name, folder) for each in getattr(asked, name))
        if asked.match is not None:
            yield "match", folder / asked.match

    @cached_property
    def _places(self) -> dict[str, tuple[int, int, int]]:
        """Line, column of the key and of its value, from 1, by the dotted name of each key."""
        found: dict[str, tuple[int, int, int]] = {}
        table, closing = "", ""
        for number, line in enumerate(self.text.splitlines(), 1):
            if closing:
                closing = "" if closing in line else closing
            elif header := _TABLE.fullmatch(line):
                table = f"{_bare(header[1])}."
            elif key := _KEY.match(line):
                name = f"{table}{_bare(key['key'])}"
                found.setdefault(name, (number, key.start("key") + 1, key.end() + 1))
                is_open = len(key["quote"]) == 3 and key["quote"] not in line[key.end() :]
                closing = key["quote"] if is_open else ""
        return found

    def _place(self, name: str, *, of_key: bool = False) -> tuple[int, int]:
        """Line and column of the value of a key, or of the table that it stands in."""
        while name and name not in self._places:
            name = name.rpartition(".")[0]
        line, key, value = self._places.get(name, (1, 1, 1))
        return line, key if of_key else value


def _of_entry(text: str, option: str, folder: Path) -> str:
    name, sign, value = text.partition("=")
    there = folder / name.strip()
    is_file = option in ("layers", "blend") and there.exists()
    if not sign:
        return text
    return f"{there if is_file else name.strip()}={rebased(value.strip(), folder)}"


def _named(error: OptionError) -> str:
    """The argument that an error is about."""
    found = _ARGUMENT.search(str(error))
    return found[1] if found else ""


def _plain(error: OptionError) -> str:
    """What an error says, in which keys are no arguments of a call."""
    return str(error).replace("`", "")


def _bare(key: str) -> str:
    """A key without quotes and blanks."""
    return re.sub(r"""\s*\.\s*""", ".", re.sub(r"""["']""", "", key.strip()))
