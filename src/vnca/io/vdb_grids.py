"""Grids of an OpenVDB file by what they hold: which of them are velocity, and how to list them."""

from vnca.core.errors import GridError
from vnca.io.smoke_format import NO_VELOCITY, SmokeFormat
from vnca.io.vdb import VALUE_TYPES, GridHeader, VdbFile

VELOCITY_NAMES = ("velocity", "vel", "v")
_AXES = ("xyz", "XYZ")
_WAY_OUT = "choose another with `velocity_grid`, or leave it out with `velocity_grid` none"
_SEPARATORS = (".", "_")


def components(header: GridHeader) -> int | None:
    """1 for a grid of numbers, 3 for one of vectors, None for others."""
    value_type = VALUE_TYPES.get(header.value_type)
    return value_type.components if value_type else None


def listed_vectors(file: VdbFile) -> str:
    """What could be velocity: grids of vectors, and grids of numbers that are three of a kind.

    Empty if there are none.
    """
    vectors = [f"{name} ({header.value_type})" for name, header in _vectors(file).items()]
    triples = [parts for parts in _triples(file).values() if not _missing(file, parts)]
    return ", ".join(vectors + [f"{x} with {y} and {z}" for x, y, z in triples])


def velocity_headers(file: VdbFile, format: SmokeFormat) -> list[GridHeader]:
    """One grid of vectors, or three of numbers in the order x, y, z, or none; all can be placed.

    A grid of just the name counts first, or three such as NAME.x; then those of the name in any
    case, the axis behind `.`, `_` or nothing. Three are also chosen by the name of the first.

    Raises:
        GridError: If several could be it, a component is missing, one of the name is of a type that
            cannot be read, or lies where no linear transform puts it, or none has the name that
            was asked for.
    """
    headers = _named_velocity(file, format)
    for header in headers:
        if header.linear_transform is None:
            raise GridError(
                f"{file.path}: velocity grid {header.name!r} has a {header.map_type}, and only "
                f"linear transforms are supported; {_WAY_OUT}"
            )
    return headers


def _named_velocity(file: VdbFile, format: SmokeFormat) -> list[GridHeader]:
    asked = format.velocity_grid
    if asked == NO_VELOCITY:
        return []
    names = VELOCITY_NAMES if asked is None else (asked,)
    vectors, triples = _vectors(file), _triples(file)
    for name in names:
        if name in vectors:
            return [vectors[name]]
        for first in (f"{name}.x", name):
            if first in triples:
                return _three(file, triples[first])
    alike = {name.casefold() for name in names}
    like = [parts for parts in triples.values() if _stem(parts).casefold() in alike]
    found = [(name,) for name in vectors if name.casefold() in alike]
    found += [parts for parts in like if not _missing(file, parts)]
    if len(found) > 1:
        raise GridError(
            f"{file.path}: several grids could be the velocity; choose with `velocity_grid` from "
            f"{', '.join(parts[0] for parts in found)}"
        )
    if found:
        return [file.grids[part] for part in found[0]]
    if like:
        return _three(file, like[0])
    for name, header in file.grids.items():
        if components(header) is None and name.casefold() in alike:
            raise GridError(
                f"{file.path}: grid {name!r} is of type {header.value_type}, which cannot be read "
                f"as velocity; {_WAY_OUT}"
            )
    if asked is None:
        return []
    raise GridError(
        f"{file.path}: no velocity {asked!r}; choose with `velocity_grid` none or "
        f"a grid of vectors from {file.listed()}"
    )


def _vectors(file: VdbFile) -> dict[str, GridHeader]:
    return {name: header for name, header in file.grids.items() if components(header) == 3}


def _triples(file: VdbFile) -> dict[str, tuple[str, str, str]]:
    """Names that differ in their axis only, by the first: at least one of them is there."""
    triples = {}
    for name, header in file.grids.items():
        for x, y, z in _AXES:
            if components(header) == 1 and name[-1:] in (x, y, z):
                parts = (name[:-1] + x, name[:-1] + y, name[:-1] + z)
                if _stem(parts):
                    triples[parts[0]] = parts
    return triples


def _stem(parts: tuple[str, str, str]) -> str:
    """`vel` of `vel.x`, `vel_x` or `velx`."""
    shared = parts[0][:-1]
    return shared[:-1] if shared.endswith(_SEPARATORS) else shared


def _missing(file: VdbFile, parts: tuple[str, str, str]) -> list[str]:
    return [p for p in parts if p not in file.grids or components(file.grids[p]) != 1]


def _three(file: VdbFile, parts: tuple[str, str, str]) -> list[GridHeader]:
    missing = _missing(file, parts)
    if missing:
        raise GridError(
            f"{file.path}: velocity {_stem(parts)!r} lacks the scalar grid {', '.join(missing)}; "
            "leave the velocity out with `velocity_grid` none"
        )
    return [file.grids[part] for part in parts]
