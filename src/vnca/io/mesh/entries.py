"""What stands under a name in an entry of a glTF document, if it is what glTF says.

JSON may hold anything anywhere, and most of it numpy takes without a word: a text times a whole
number is that text many times over, `true` is one, and −1 is the last of a list.
"""

import math
from typing import Any

import numpy as np

from vnca.core import AnyArray


def numbers(entry: dict[str, Any], name: str, default: tuple[float, ...]) -> AnyArray:
    """As many finite numbers as the default has, which stands for a missing list; float64.

    Raises:
        ValueError: If there is something else.
    """
    values = entry.get(name, default)
    if not (
        isinstance(values, (list, tuple))
        and len(values) == len(default)
        and all(map(_is_number, values))
    ):
        raise ValueError(f"its `{name}` should be {len(default)} finite numbers")
    return np.array(values, np.float64)


def number(entry: dict[str, Any], name: str, default: float) -> float:
    """A finite number; the default where there is none.

    Raises:
        ValueError: If there is something else.
    """
    value = entry.get(name, default)
    if not _is_number(value):
        raise ValueError(f"its `{name}` should be a finite number")
    return float(value)


def whole(entry: dict[str, Any], name: str, default: int | None = None) -> int:
    """A whole number from zero on; the default where there is none.

    Raises:
        ValueError: If there is something else, or nothing and no default.
    """
    value = entry.get(name, default)
    # JSON knows one kind of numbers: some writers put 3.0.
    if not _is_number(value) or value != int(value) or value < 0:
        raise ValueError(f"its `{name}` should be a whole number from 0 on")
    return int(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
