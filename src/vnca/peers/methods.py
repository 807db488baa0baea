"""The methods, by their names."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from torch import Tensor

from vnca.core.errors import OptionError
from vnca.peers import Clip, Look, Name, Settings, Tell
from vnca.peers.aurand import AurandSettings, aurand
from vnca.peers.feedforward import ForwardSettings, aurand_forward
from vnca.peers.lnst import LnstSettings, lnst
from vnca.peers.tnst import TnstSettings, tnst

Stylise = Callable[[Clip, Look, Any, Tell], Tensor]
"""Densities `[t, x, y, z]` of a clip that look like a picture."""


@dataclass(frozen=True)
class Method:
    """A method.

    Attributes:
        settings: What there is to choose.
        stylise: What does it.
        paper: Where it was published.
    """

    settings: type[Settings]
    stylise: Stylise
    paper: str


METHODS: Mapping[Name, Method] = {
    "aurand": Method(
        AurandSettings, aurand, "Aurand et al. 2022, optimised (no public code; from notes)"
    ),
    "aurand-forward": Method(
        ForwardSettings, aurand_forward, "Aurand et al. 2022, feed-forward (from notes)"
    ),
    "lnst": Method(LnstSettings, lnst, "LNST, Kim et al. 2020"),
    "tnst": Method(TnstSettings, tnst, "TNST, Kim et al. 2019"),
}


def method_named(name: str) -> Method:
    """A method by its name.

    Raises:
        OptionError: If there is none.
    """
    for known, method in METHODS.items():
        if known == name:
            return method
    raise OptionError(f"`method` {name}: expected one of {', '.join(METHODS)}")
