"""What a painted file tells of its painting, so that every view of it shows it alike."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Any

from vnca.core.errors import FileFormatError, OptionError
from vnca.core.records import changed, changed_fields
from vnca.io.smoke_format import SmokeFormat, UpAxis
from vnca.io.vdb import Metadata, open_vdb

PREFIX = "vnca_"
"""Of all entries in the metadata of a file that tell of its painting."""
_UP_AXES: tuple[UpAxis, ...] = ("z", "y")
_VELOCITY = ("velocity_grid", "staggered", "velocity_units", "fps", "time_scale", "velocity_scale")


@dataclass(frozen=True)
class Provenance:
    """How a frame was painted.

    Attributes:
        extinction: Of density 1 in the file, per length of its world, with which it is to be seen.
        gamma: The γ that comes to: the extinction of what the rule took for density 1, per cell of
            the smoke. Another γ changes the extinction in proportion.
        up_axis: Which axis of the file points up.
        facts: What else is worth telling: the rule's name, version, options; text or numbers.
        velocity: How the velocity in the file is to be read: fields of `SmokeFormat` by name, where
            they are not the defaults.
    """

    extinction: float
    gamma: float
    up_axis: UpAxis
    facts: Mapping[str, str | int | float] = field(default_factory=dict)
    velocity: Mapping[str, Any] = field(default_factory=dict)

    def seen_with(self, gamma: float | None) -> float:
        """The extinction with another γ, if one is given."""
        return self.extinction if gamma is None else self.extinction * gamma / self.gamma

    @property
    def metadata(self) -> Metadata:
        """As the entries of a file."""
        values: dict[str, Any] = {
            "extinction": self.extinction,
            "gamma": self.gamma,
            "up_axis": self.up_axis,
            **({"velocity": json.dumps(self.velocity)} if self.velocity else {}),
            **self.facts,
        }
        return Metadata.of({PREFIX + name: _storable(value) for name, value in values.items()})


def velocity_of(format: SmokeFormat) -> dict[str, Any]:
    """What a painted file is to tell of a velocity that was read like that."""
    asked = changed_fields(format, SmokeFormat())
    return {name: getattr(format, name) for name in _VELOCITY if name in asked}


def as_told(format: SmokeFormat, told: Provenance) -> SmokeFormat:
    """How a painted file is read: as it tells, but for what is asked for otherwise."""
    velocity = {} if velocity_of(format) else told.velocity
    return replace(format, up_axis=format.up_axis or told.up_axis, **velocity)


def without_provenance(metadata: Mapping[str, Any]) -> Metadata:
    """The entries that tell of no painting: a file that is painted again has another."""
    return Metadata((n, entry) for n, entry in metadata.items() if not n.startswith(PREFIX))


def read_provenance(path: Path) -> Provenance | None:
    """What a file tells of its painting; None of files that were not painted, or long ago.

    Raises:
        FileFormatError: If the file cannot be read, or what it tells makes no sense.
    """
    if path.suffix.lower() != ".vdb":
        return None
    with open_vdb(path) as file:
        told = {
            name.removeprefix(PREFIX): entry.value
            for name, entry in file.metadata.items()
            if name.startswith(PREFIX)
        }
    if "extinction" not in told:
        return None
    numbers = [_positive(path, name, told.pop(name, None)) for name in ("extinction", "gamma")]
    up_axis = told.pop("up_axis", None)
    if up_axis not in _UP_AXES:
        raise _damaged(path, "up_axis", up_axis)
    velocity = _velocity(path, told.pop("velocity", "{}"))
    return Provenance(numbers[0], numbers[1], up_axis, told, velocity)


def _velocity(path: Path, text: Any) -> dict[str, Any]:
    try:
        velocity = json.loads(text)
        if isinstance(velocity, dict) and set(velocity) <= set(_VELOCITY):
            return velocity_of(changed("velocity", SmokeFormat(), velocity))
    except (TypeError, ValueError, OptionError):
        pass
    raise _damaged(path, "velocity", text)


def _storable(value: str | int | float) -> str | int | float:
    """A value as a file can hold it: names of files need not be text, and a seed may be long."""
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        return str(value)
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode()
    return value


def _positive(path: Path, name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < inf:
        raise _damaged(path, name, value)
    return float(value)


def _damaged(path: Path, name: str, value: object) -> FileFormatError:
    return FileFormatError(
        f"{path}: what it tells of its painting is damaged ({PREFIX}{name}: {value!r}); paint it "
        "again, or remove that from its metadata"
    )
