"""What `--help` and `--help-all` print: the options of a dataclass, all or those asked for most."""

import dataclasses
import inspect
import re
import shutil
import textwrap
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import tyro

from vnca.core.camera import Shot
from vnca.core.records import field_texts

SHORT = {
    "-o": "--out",
    "-p": "--preset",
    "-f": "--frames",
    "-s": "--seed",
    "-r": "--refine",
    "-d": "--device",
}
"""Short forms, the same in every command that has the option."""
ASKED = ("-h", "--help", "--help-all")
"""What asks for help."""
_SMOKE = ("velocity-units", "fps", "up-axis")
_FILM = (
    *("azimuth", "elevation", "turn", "rows", "columns", "film-fps", "background"),
    *("light", "shutter"),
)
_PEER = ("out", "frames", "features", "overwrite", *_SMOKE)
_PEERS = ("iterations", "gamma", "enlarged", "whole-picture", "seed")
COMMON: Mapping[str, tuple[str, ...]] = {
    "paint": (
        *("out", "style", "preset", "frames", "refine", "strength", "masks"),
        *("layers", "seed", *_SMOKE, "device", "resume", "overwrite"),
    ),
    "train": (
        *("out", "preset", "iterations", "view.size", "seed", "texture", "graft", *_SMOKE),
        *("device", "memory-budget", "overwrite"),
    ),
    "stylize": (
        *("out", "frames", "refine", "preview", "strength", "density-strength", "gamma", "seed"),
        *("masks", "layers", "device", "resume", "overwrite", "on-error", *_SMOKE),
    ),
    "evaluate": ("out", "frames", "refine", "style", "size", "device", "json"),
    "ablate": ("out", "preset", "seeds", "iterations", "json", "device", *_SMOKE),
    "compare": ("out", "methods", "frames", "preset", "size", "study", "seed", *_SMOKE),
    "peers run": _PEER,
    "peers run aurand": (*_PEER, *_PEERS, "changes", "octaves", "rate", "cap", "alpha"),
    "peers run aurand-forward": (*_PEER, *_PEERS, "changes", "rate", "patch", "views"),
    "peers run lnst": (*_PEER, *_PEERS, "rate", "smoothing", "spreading", "as-published"),
    "peers run tnst": (
        *(*_PEER, *_PEERS, "potential", "octaves", "rate", "views", "window", "as-published"),
    ),
    "render": (*("out", "frames", "turntable", "strip", "transparent", "gamma", "device", *_FILM),),
    "texture train": (
        "out",
        "preset",
        "iterations",
        "graft",
        "seed",
        "mesh",
        "device",
        "overwrite",
    ),
    "view": ("frames", "export", "page-fps", "browser", "port", *_SMOKE),
    "farm": ("out", "chunk-size", "handover", "styles", "seeds", "program", "env", "retries"),
    "plan": (
        *("model", "style", "frames", "refine", "machines", "chunk-size", "preroll", "tile"),
        *("halo", "again", "json"),
    ),
    "bench step": ("backends", "threads", "json", "csv"),
    "bench train": ("preset", "backends", "device", "threads", "repeats", "json", "csv"),
    "bench paint": ("grid", "occupancy", "precisions", "device", "threads", "json", "csv"),
    "bench stylize": ("model", "sequence", "frames", "backends", "threads", "json", "csv"),
}
"""The options that `--help` shows of a command, in its order; of others it shows all."""
JSON_PROGRESS = "--json-progress"
_FLAT = ("config", "rule", "smoke", "grow", "film", "direction", "chunking", "chunks")
NAMES: dict[str, str] = dict.fromkeys(_FLAT, "")
"""What options of fields are called where it is not as the field; empty for a dataclass whose
fields are options as if they were of the one around it."""
SHOT_NAMES = {"fps": "film-fps", "step": "ray-step"}
"""Likewise of how a film is taken: `--fps` is the simulation's."""
_COLUMN = 26
_WIDTHS = (60, 100)


@dataclass(frozen=True)
class Option:
    """An option or a positional argument.

    Attributes:
        name: Without dashes: `view.size`.
        group: What it belongs to, a sentence; empty for the command itself.
        form: What follows it: `{1,2,3,4}`; empty for a flag.
        text: What it does.
        default: As it is written on the command line; empty where there is nothing to tell.
        is_positional: Whether it is given without its name.
        is_required: Whether it has to be given.
        is_flag: Whether it is given without a value.
    """

    name: str
    group: str
    form: str
    text: str
    default: str
    is_positional: bool
    is_required: bool
    is_flag: bool

    def head(self) -> str:
        """How it is written: `-o, --out PATH`."""
        if self.is_positional:
            return self.form
        long = f"--{self.name}"
        short = [word for word, meant in SHORT.items() if meant == long]
        forms = ", ".join([*short, long])
        if self.is_flag and self.default == "on":
            before, _, last = self.name.rpartition(".")
            forms += f", --{before}{'.' * bool(before)}no-{last}"
        return f"{forms} {self.form}".rstrip()

    def described(self) -> str:
        """What it does, and its default."""
        note = f"default: {self.default}" if self.default else ""
        note = "required" if self.is_required else note
        return f"{self.text} ({note})" if note and not self.is_positional else self.text


def help_text(
    command: str, kind: type, default: Any = None, *, all_of_them: bool, separator: str = " "
) -> str:
    """The help of a command.

    Args:
        command: As it is called, without `vnca`.
        kind: The dataclass of its options.
        default: An instance whose values are the defaults, rather than those of the fields.
        all_of_them: Whether all options are shown, or those that are asked for most.
        separator: What stands between the values of an option that takes several.
    """
    options = list(_options(kind, default, separator=separator))
    names = {option.name for option in options}
    positional = [option for option in options if option.is_positional]
    named = [option for option in options if not option.is_positional]
    # Not of the dataclass where a command has two, as that of going on with a training.
    common = [name for name in COMMON.get(command, ()) if names.issuperset(COMMON[command])]
    shown = sorted(named, key=lambda option: _rank(option.name, common))
    if common and not all_of_them:
        shown = [option for option in shown if option.name in common]
        shown = [dataclasses.replace(option, group="") for option in shown]
    call = " ".join(["usage: vnca", command, "[OPTIONS]", *(option.form for option in positional)])
    width = min(max(shutil.get_terminal_size((80, 24)).columns, _WIDTHS[0]), _WIDTHS[1])
    parts = [call, *_paragraphs(inspect.getdoc(kind) or "", width)]
    if positional:
        parts.append("\n".join(_entry(o.form, _meant(o, names), width) for o in positional))
    for group in sorted(dict.fromkeys(option.group for option in shown), key=bool):
        title = "\n".join(textwrap.wrap(group.rstrip(".") + ":", width)) if group else "options:"
        entries = [_entry(o.head(), _meant(o, names), width) for o in shown if o.group == group]
        parts.append("\n".join([title, *entries]))
    always = {
        JSON_PROGRESS: "Say what happens as JSON, an object a line on standard error.",
        "-h, --help": "Show the options that are asked for most." if common else "Show this.",
    }
    if common:
        always["--help-all"] = f"Show all {len(named)} options."
    parts.append("\n".join(_entry(name, text, width) for name, text in always.items()))
    return "\n\n".join(parts)


def _rank(name: str, common: list[str]) -> int:
    return common.index(name) if name in common else len(common)


def _paragraphs(text: str, width: int) -> list[str]:
    return ["\n".join(textwrap.wrap(paragraph, width)) for paragraph in text.split("\n\n")]


def _entry(head: str, text: str, width: int) -> str:
    lines = textwrap.wrap(text, width - _COLUMN, break_on_hyphens=False) or [""]
    begin = f"  {head}"
    if len(begin) > _COLUMN - 2:
        lines.insert(0, "")
    first, *others = lines
    return "\n".join([f"{begin:{_COLUMN}}{first}".rstrip(), *(" " * _COLUMN + o for o in others)])


def _meant(option: Option, names: Collection[str]) -> str:
    """What an option does, with the options that it speaks of as they are written."""
    before = option.name.rpartition(".")[0]

    def written(found: re.Match[str]) -> str:
        name = found[1].replace("_", "-")
        for known in (f"{before}.{name}", name):
            if known in names:
                return f"--{known}"
        return found[0]

    return re.sub(r"`([a-z_.]+)`", written, option.described())


def _options(
    kind: type, default: Any, prefix: str = "", group: str = "", separator: str = " "
) -> Iterator[Option]:
    hints, texts = get_type_hints(kind, include_extras=True), field_texts(kind)
    for field in dataclasses.fields(kind):
        hint: Any = hints[field.name]
        marks: tuple[Any, ...] = ()
        if get_origin(hint) is Annotated:
            hint, *rest = get_args(hint)
            marks = tuple(rest)
        value = default_of(field, default)
        named = option_name(kind, field.name)
        name = prefix + (field.name.replace("_", "-") if named is None else named)
        if dataclasses.is_dataclass(hint) and isinstance(hint, type):
            inside = f"{name}." if named != "" else prefix
            title = (inspect.getdoc(hint) or "").partition("\n\n")[0]
            yield from _options(hint, value, inside, title, separator)
            continue
        is_required = _is_missing(value)
        metavar = next((m.metavar for m in marks if getattr(m, "metavar", None)), None)
        yield Option(
            name,
            group,
            "" if hint is bool else metavar or _form(hint, separator),
            " ".join(texts.get(field.name, "").split()),
            "" if is_required else _written(value, separator),
            is_positional=any(mark is _POSITIONAL for mark in marks),
            is_required=is_required,
            is_flag=hint is bool,
        )


_MISSING = (dataclasses.MISSING, tyro.MISSING, tyro.MISSING_NONPROP)
_POSITIONAL: Any = list(get_args(tyro.conf.Positional[int]))[1]


def option_name(kind: type, field: str) -> str | None:
    """What the option of a field is called where it is not called like the field.

    Empty for a dataclass whose own fields are options as if they were of the one around it.
    """
    name = (SHOT_NAMES if issubclass(kind, Shot) else NAMES).get(field)
    # A number may be called like a dataclass elsewhere.
    inside = name != "" or dataclasses.is_dataclass(get_type_hints(kind)[field])
    return name if inside else None


def as_option(argument: str) -> str:
    """The option of an argument as the library names it: `--view.size` of `view.size`."""
    name = argument.removeprefix("film.")
    if name != argument:
        name = SHOT_NAMES.get(name, name)
    return "--" + name.replace("_", "-")


def _is_missing(value: Any) -> bool:
    """Whether a default says that there is none."""
    return any(value is one for one in _MISSING)


def default_of(field: "dataclasses.Field[Any]", instance: Any) -> Any:
    """The value of a field that is not given: that of an instance, or else the field's own."""
    if instance is not None and not _is_missing(instance):
        return getattr(instance, field.name)
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return tyro.MISSING if field.default is dataclasses.MISSING else field.default


def _form(hint: Any, separator: str) -> str:
    """How a value of a type is written on the command line."""
    origin: Any = get_origin(hint)
    inside: list[Any] = list(get_args(hint))
    if origin is Annotated:
        return _form(inside[0], separator)
    if origin is Literal:
        return "{" + ",".join(map(str, inside)) + "}" if len(inside) > 1 else str(inside[0])
    if origin in (Union, UnionType) and {float, str} <= {*inside}:
        return "VALUE"
    if origin in (Union, UnionType):
        return "|".join(_form(one, separator) for one in inside if one is not type(None))
    if origin is tuple and inside[-1] is not Ellipsis:
        return "XxYxZ"
    if origin is tuple:
        one = _form(inside[0], separator)
        return f"{one}{separator}…" if separator.strip() else f"{one} …"
    names: dict[Any, str] = {bool: "{True,False}", Path: "PATH", str: "TEXT"}
    return names.get(hint) or hint.__name__.upper()


def _written(value: Any, separator: str) -> str:
    if value is None or value is False:
        return ""
    if value is True:
        return "on"
    if isinstance(value, tuple):
        joint = "x" if _is_grid(value) else separator
        return joint.join(_written(one, separator) for one in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _is_grid(value: tuple[Any, ...]) -> bool:
    return len(value) == 3 and all(type(one) is int for one in value)
