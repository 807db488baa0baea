"""Attributes that hold an array or the field it stands for, and are read as arrays."""

from collections.abc import Callable
from typing import Any, TypeVar

from vnca.core.bricks.field import Field
from vnca.core.typing import Index

T = TypeVar("T")


def dense(*names: str, what: Callable[[Any], str]) -> Callable[[type[T]], type[T]]:
    """A decorator for dataclasses: what some attributes hold may be fields.

    Read, those are arrays all the same, each made the first time; `field_of` gives the field.

    Args:
        names: Of the attributes.
        what: What a message calls an instance whose arrays are too large.
    """

    def decorated(kind: type[T]) -> type[T]:
        for name in names:
            setattr(kind, name, _Dense(name, what))
        return kind

    return decorated


def field_of(instance: object, name: str, origin: Index, *, outside: float = 0) -> Any:
    """What such an attribute holds, as a field; None where that is what it holds.

    Args:
        instance: Whose attribute.
        name: Its name.
        origin: Index coordinates of the first cell, if it is an array.
        outside: The most frequent value, if it is an array.
    """
    held = instance.__dict__[name]
    if held is None or isinstance(held, Field):
        return held
    return Field.from_dense(held, origin, outside=outside)


def shape_of(instance: object, name: str) -> tuple[int, ...] | None:
    """The shape of such an attribute, which is not made an array for that; None of None."""
    held = instance.__dict__[name]
    return None if held is None else held.shape


class _Dense:
    def __init__(self, name: str, what: Callable[[Any], str]) -> None:
        self._name = name
        self._what = what

    def __get__(self, instance: Any, owner: type) -> Any:
        if instance is None:
            return self
        held = instance.__dict__[self._name]
        if not isinstance(held, Field):
            return held
        made = f"{self._name} as an array"
        if made not in instance.__dict__:
            instance.__dict__[made] = held.dense(what=self._what(instance))
        return instance.__dict__[made]

    def __set__(self, instance: Any, value: Any) -> None:
        instance.__dict__[self._name] = value
