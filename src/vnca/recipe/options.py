"""From the keywords of a Python call to the dataclasses that they are fields of."""

import dataclasses
from collections.abc import Mapping
from typing import Any, TypeVar

from vnca.core.records import require_known, with_values

T = TypeVar("T")


def distributed(given: Mapping[str, Any], *defaults: Any) -> tuple[Any, ...]:
    """Dataclasses with some of their fields replaced, each keyword in the one that has it.

    A field that is a dataclass itself takes an instance or a mapping of its own fields.

    Args:
        given: New values by the name of the field.
        defaults: Instances that share no field.

    Raises:
        OptionError: If no dataclass has a field of a name, or one refuses a value.
    """
    names = [{field.name for field in dataclasses.fields(one)} for one in defaults]
    require_known(given, set().union(*names))
    return tuple(
        with_values(one, {name: value for name, value in given.items() if name in own})
        for one, own in zip(defaults, names, strict=True)
    )


def changed(name: str, default: T, given: T | Mapping[str, Any] | None) -> T:
    """The dataclass `given`, or `default` with those of its fields that a mapping gives.

    Raises:
        OptionError: If it has no field of a name, or refuses a value.
    """
    if given is None:
        return default
    return with_values(default, given, f"{name}.") if isinstance(given, Mapping) else given
