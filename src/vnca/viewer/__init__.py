"""A page on which a rule can be watched while it paints, and what it is given to show.

The page itself is in `page/`, built from the TypeScript in `web/` at the root of the project.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

PAGE = ("index.html", "viewer.js", "viewer.css")
"""The files of the page."""
SHOW_NAME = "show.json"
"""What the page reads first: what there is to show."""
SMOKE_NAME = "smoke.bin"
"""The sequence."""
RUN_NAME = "run.json"
"""How far a training has come that the page watches."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; media-src blob:; base-uri 'none'; form-action 'none'"
)
"""What the page may load and ask: itself. Its HTML says the same, for sites of others."""


@dataclass(frozen=True)
class ShownRule:
    """A rule to choose from.

    Attributes:
        name: By which it is called.
        title: What it was learned from.
        model: The bytes of its model file.
        thumbnail: A picture in WebP, or none.
    """

    name: str
    title: str
    model: bytes
    thumbnail: bytes | None = None


@dataclass(frozen=True)
class Show:
    """What a page shows.

    Attributes:
        title: What it is called.
        rules: Those to choose from, the first of which paints.
        settings: What differs from the page's own, by the names of its `Settings`.
        run: Whether a training is watched: then there is a file of its progress.
    """

    title: str
    rules: Sequence[ShownRule]
    settings: Mapping[str, Any]
    run: bool = False


def page_file(name: str) -> bytes:
    """A file of the page."""
    return files("vnca.viewer").joinpath("page").joinpath(name).read_bytes()


def model_name(number: int) -> str:
    """The file of a rule, by its number among those of a show."""
    return f"rules/{number}.safetensors"


def contents(show: Show) -> dict[str, bytes]:
    """The files that a page is made of, by name, but for the sequence."""
    made: dict[str, bytes] = {name: page_file(name) for name in PAGE}
    listed = []
    for number, rule in enumerate(show.rules):
        entry = {"name": rule.name, "title": rule.title, "model": model_name(number)}
        made[entry["model"]] = rule.model
        if rule.thumbnail is not None:
            entry["thumbnail"] = f"rules/{number}.webp"
            made[entry["thumbnail"]] = rule.thumbnail
        listed.append(entry)
    described = {
        "title": show.title,
        "rules": listed,
        "smoke": SMOKE_NAME,
        "settings": dict(show.settings),
        "run": show.run,
    }
    made[SHOW_NAME] = json.dumps(described, indent=1).encode()
    return made
