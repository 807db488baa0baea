"""What all recipes share: whom they tell how far they have come, and what was recorded before.

The library prints nothing; whoever calls it may. Runs and models record their options and inputs,
which are read back here.
"""

import dataclasses
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import UnionType
from typing import (
    Any,
    Literal,
    Protocol,
    TypeAlias,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import FileFormatError, ModelError
from vnca.core.files import existing_file
from vnca.core.records import distributed
from vnca.io.picture import read_style, style_array
from vnca.io.smoke_format import SmokeFormat
from vnca.painting import StylizeConfig
from vnca.rule.model import CONFIG_NAME, STYLES_TOLD, Model, from_record
from vnca.rule.styles import names_of

T = TypeVar("T")


class Watch(Protocol):
    """Is told what long work does, in the thread that does it.

    What a method raises ends the work. `Cancelled` ends it as Ctrl-C does: everything finished so
    far is kept, and the work can be resumed.
    """

    def progress(self, what: str, done: int, total: int, unit: str, note: str = "") -> None:
        """Some of the work is done.

        The first call for a piece of work says how much of it was done before.

        Args:
            what: The work, as a present participle: "training".
            done: How many units are finished.
            total: How many units there are.
            unit: What is counted, in the plural: "frames".
            note: What else there is to tell, such as a loss.
        """

    def note(self, line: str) -> None:
        """Something that the user should know, in one line; arguments are in backquotes."""

    def made(self, what: str, path: Path) -> None:
        """A result is there, whole: what it is, as "film", and its file or folder."""


class Silent:
    """A `Watch` that tells nobody."""

    def progress(self, what: str, done: int, total: int, unit: str, note: str = "") -> None:
        """Do nothing."""

    def note(self, line: str) -> None:
        """Do nothing."""

    def made(self, what: str, path: Path) -> None:
        """Do nothing."""


SILENT = Silent()


def tracked(
    items: Iterable[T], watch: Watch, what: str, total: int, unit: str, *, already: int = 0
) -> Iterator[T]:
    """`items`, each told to `watch` once the loop over them comes back for the next."""
    watch.progress(what, already, total, unit)
    for done, item in enumerate(items, already + 1):
        yield item
        watch.progress(what, done, total, unit)


IN_MEMORY = Path("in-memory")
"""In the place of the path of an input that came from no file."""
PICTURE_CELLS = "picture_cells"
"""What says in a model how many cells wide the rule was shown its picture, the shorter side."""
COMPARES_REGIONS = "compares_regions"
"""What says whether the rule was taught the colours of regions, which measures compare, too."""


PictureGiven: TypeAlias = str | Path | AnyArray
"""A picture as it may be given from Python: a file, or linear RGB `[r, c, 3]` from 0 to 1."""


def given_pictures(
    style: PictureGiven | Sequence[PictureGiven],
) -> tuple[list[Path], list[FloatArray] | None]:
    """The paths of pictures, and the pictures themselves unless all of them are files."""
    several: list[Any] = [*style] if isinstance(style, (list, tuple)) else [style]
    paths = [Path(one) if isinstance(one, (str, Path)) else IN_MEMORY for one in several]
    if IN_MEMORY not in paths:
        return paths, None
    given = zip(several, paths, strict=True)
    return paths, [style_array(one) if at == IN_MEMORY else read_style(at) for one, at in given]


def told_of_styles(paths: Sequence[Path], cells: Sequence[float]) -> dict[str, Any]:
    """What a model tells of its picture; or of each of several, how wide it was shown, too."""
    told: dict[str, Any] = {"style": ", ".join(path.name for path in paths)}
    if len(paths) > 1:
        several = zip(names_of(paths), paths, cells, strict=True)
        told[STYLES_TOLD] = [
            {"name": name, "style": path.name, PICTURE_CELLS: round(width, 2)}
            for name, path, width in several
        ]
    return told


def recorded(options: Any) -> dict[str, Any]:
    """The fields of a dataclass, and of those inside it, as JSON values."""
    return dataclasses.asdict(options, dict_factory=_json)


def first_difference(path: Path, now: Mapping[str, Any], instead: str) -> str | None:
    """The name of what a file of JSON values, written before, has otherwise; None if nothing.

    Args:
        path: The file.
        now: The values that it should have.
        instead: What to do if it cannot be read.

    Raises:
        FileFormatError: If it cannot.
    """
    try:
        then = json.loads(existing_file(path).read_text(encoding="utf-8"))
        return next((name for name in now if then.get(name) != now[name]), None)
    except (OSError, ValueError, AttributeError) as error:
        raise FileFormatError(f"{path}: damaged ({error}); {instead}") from error


def _json(fields: list[tuple[str, Any]]) -> dict[str, Any]:
    return {name: _plain(value) for name, value in fields}


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    return str(value) if isinstance(value, Path) else value


def restored(kind: type[T], values: Mapping[str, Any]) -> T:
    """An instance of the dataclass `kind` of what was recorded of one.

    Raises:
        TypeError: If a field is missing, unknown, or of another type.
        OptionError: If the dataclass refuses a value.
    """
    hints = get_type_hints(kind)
    if not isinstance(values, Mapping) or hints.keys() != values.keys():
        raise TypeError(f"expected the options {', '.join(hints)}, got {', '.join(values)}")
    return kind(**{name: _restored(hint, values[name], name) for name, hint in hints.items()})


def _restored(hint: Any, value: Any, name: str) -> Any:
    origin, inside = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        for one in inside:
            with suppress(TypeError):
                return _restored(one, value, name)
    elif origin is Literal:
        if value in inside:
            return value
    elif origin is tuple:
        if isinstance(value, list):
            return tuple(_restored(inside[0], item, name) for item in value)
    elif dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return restored(hint, value)
    elif hint is Path and isinstance(value, str):
        return Path(value)
    elif type(value) is hint or (hint is float and type(value) is int and abs(value) < 2**53):
        return value
    raise TypeError(f"{name}: {value!r} is not of its type")


def recorded_smoke(path: Path, model: Model) -> SmokeFormat | None:
    """How smoke was read for the training of a model, if its file, at `path`, tells.

    Raises:
        ModelError: If what it tells makes no sense.
    """
    smoke = model.training.get("smoke")
    if not smoke:
        return None
    try:
        return from_record(SmokeFormat, smoke)
    except TypeError as error:
        raise ModelError(f"{path}: damaged model metadata (smoke: {error})") from error


def load(path: str | Path) -> Model:
    """Read a model file, or the model in the folder of a run, with where its inputs are.

    Raises:
        FileFormatError: If the file is missing or empty.
        ModelError: If it is not a model, of a newer format, or inconsistent.
    """
    path = Path(path)
    folder = path if path.is_dir() else path.parent
    try:
        told = json.loads((folder / CONFIG_NAME).read_text())["inputs"]
        inputs: dict[str, Any] = {n: Path(at) for n, at in told.items() if isinstance(at, str)}
        if isinstance(others := told.get("more_styles"), list):
            inputs[STYLES_TOLD] = (inputs["style"], *map(Path, others))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        inputs = {}
    return dataclasses.replace(Model.load(path), inputs=inputs)


def applied(
    model: str | Path | Model, options: Mapping[str, Any]
) -> tuple[Path, Model, SmokeFormat, StylizeConfig]:
    """A model as a call from Python applies it.

    Args:
        model: The model, or its path.
        options: Fields of `SmokeFormat` and `StylizeConfig`, in the place of those recorded.

    Returns:
        Where it lies, the model, how smoke is read for it and how it is rolled.

    Raises:
        ModelError: As of `load`, or if what it tells of smoke makes no sense.
        FileFormatError: As of `load`.
        OptionError: If an option is unknown or out of range.
    """
    path = IN_MEMORY if isinstance(model, Model) else Path(model)
    model = model if isinstance(model, Model) else load(model)
    recorded = recorded_smoke(path, model) or SmokeFormat()
    smoke, config = distributed(options, recorded, StylizeConfig())
    return path, model, smoke, config
