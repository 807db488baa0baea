# SPDX-License-Identifier: GPL-3.0-or-later
"""The library of styles: rules that come with vnca."""

import json
import struct
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

_MOST_HEADER = 1 << 20


@dataclass(frozen=True)
class Style:
    """A style of the library.

    Attributes:
        name: As vnca calls it.
        title: What its picture shows.
        thumbnail: A picture of smoke painted in it.
    """

    name: str
    title: str
    thumbnail: Path

    @property
    def label(self) -> str:
        """Its name as a person reads it."""
        return self.name.replace("_", " ").capitalize()


def library() -> list[Style]:
    """The styles that came with vnca, in alphabetical order; none without vnca."""
    spec = find_spec("vnca")
    if spec is None or not spec.origin:
        return []
    paths = sorted((Path(spec.origin).parent / "data" / "styles").glob("*.safetensors"))
    return [Style(path.stem, _title(path), path.with_suffix(".webp")) for path in paths]


def _title(path: Path) -> str:
    """What a model tells of its picture. The file begins with its metadata, as JSON."""
    with path.open("rb") as file:
        (size,) = struct.unpack("<Q", file.read(8))
        header = json.loads(file.read(min(size, _MOST_HEADER)))
    facts = json.loads(header.get("__metadata__", {}).get("vnca", "{}"))
    return str(facts.get("training", {}).get("title", ""))
