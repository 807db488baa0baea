from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from vnca.core.errors import OptionError
from vnca.core.records import field_texts, with_values


@dataclass(frozen=True)
class Inner:
    """Inside."""

    size: int = 1
    """How large."""


@dataclass(frozen=True)
class Outer:
    """Outside."""

    inner: Inner = field(default_factory=Inner)
    length: float = 1.0
    """How
    long."""
    kind: Literal["one", "two"] = "one"
    cells: tuple[int, int, int] = (1, 2, 3)
    names: tuple[str, ...] = ()
    path: Path | None = None
    scale: float | Literal["fit"] = 1.0
    is_on: bool = False


def test_values_take_the_type_of_their_field() -> None:
    changed = with_values(
        Outer(),
        {
            "inner": {"size": np.int64(4)},
            "length": 2,
            "cells": [4, 5, 6],
            "names": ["a"],
            "path": "here",
            "scale": "fit",
            "is_on": True,
        },
    )
    assert changed == Outer(
        Inner(4), 2.0, cells=(4, 5, 6), names=("a",), path=Path("here"), scale="fit", is_on=True
    )
    assert type(changed.length) is float
    assert type(changed.inner.size) is int
    assert with_values(Outer(), {"inner": Inner(5)}).inner.size == 5


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"inner": {"size": 1.5}}, r"`inner.size` 1.5: expected a whole number"),
        ({"inner": {"sise": 1}}, r"`inner.sise`: .* did you mean `inner.size`"),
        ({"inner": 3}, r"`inner` 3: expected its own fields"),
        ({"length": "long"}, r"`length` 'long': expected a number"),
        ({"length": None}, r"`length` None: expected a number"),
        ({"length": True}, r"`length` True"),
        ({"kind": "three"}, r"`kind` 'three': expected one or two"),
        ({"cells": [1, 2]}, r"`cells` \[1, 2\]: expected a list, each a whole number"),
        ({"names": "ab"}, r"`names` 'ab': expected a list"),
        ({"path": 3}, r"`path` 3: expected a path"),
        ({"scale": "good"}, r"`scale` 'good': expected a number or fit"),
        ({"is_on": 1}, r"`is_on` 1: expected true or false"),
        ({"nothing": 1}, r"`nothing`: no such option; expected one of cells, inner"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(given: dict[str, Any], told: str) -> None:
    with pytest.raises(OptionError, match=told):
        with_values(Outer(), given)


def test_texts_stand_under_their_fields() -> None:
    assert field_texts(Inner) == {"size": "How large."}
    assert " ".join(field_texts(Outer)["length"].split()) == "How long."
