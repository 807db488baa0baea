"""`vnca peers`: other methods of stylising smoke."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from vnca.cli.options import parse, run_subcommand
from vnca.cli.terminal import Terminal
from vnca.core.errors import OptionError
from vnca.peers import Name
from vnca.peers.aurand import AurandSettings
from vnca.peers.feedforward import ForwardSettings
from vnca.peers.lnst import LnstSettings
from vnca.peers.methods import METHODS
from vnca.peers.tnst import TnstSettings
from vnca.recipe import peers

COMMANDS = {
    "run": "stylize a sequence with one of them",
    "list": "list them, and those that cannot be run",
}
_HOMES = {"run": "peers:run_run", "list": "peers:run_list"}
NOT_RUN = {
    "guo": "Guo et al. 2021, volumetric appearance stylization: not run, as neither code nor any "
    "number of it is public. It claims colour for clouds and smoke from any picture, in one pass "
    "that gives a volume of albedo, coherent over time; the VNCA paper says of it more than 70 h "
    "of training and more than 12 GB",
}
"""Methods of which too little is public to run them."""


def run(arguments: Sequence[str]) -> None:
    """Run one of the subcommands."""
    run_subcommand("peers", "Other methods of stylizing smoke.", COMMANDS, _HOMES, arguments)


@dataclass(frozen=True, kw_only=True)
class _Sequence(peers.PeersRun):
    """What all methods are given."""

    sequence: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SMOKE")]
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    picture: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PICTURE")]
    """The picture; it is made grey, as all of them change density only."""


@dataclass(frozen=True, kw_only=True)
class Run(_Sequence):
    """Stylize a sequence with another method, in grey: density changes, colour does not.

    A method has options of its own: ask for help with its name.
    """

    method: Annotated[tyro.conf.Positional[Name], tyro.conf.arg(metavar="METHOD")]
    """Comes first: aurand, aurand-forward, lnst or tnst (vnca peers list tells of each)."""


@dataclass(frozen=True, kw_only=True)
class _Aurand(_Sequence):
    """Aurand 2022, optimised: each frame is moved a little, or multiplied, and averaged in time."""

    config: AurandSettings = field(default_factory=AurandSettings)
    """Of the method."""


@dataclass(frozen=True, kw_only=True)
class _Forward(_Sequence):
    """Aurand 2022, feed-forward: a network learns on patches, then changes each frame at once."""

    config: ForwardSettings = field(default_factory=ForwardSettings)
    """Of the method."""


@dataclass(frozen=True, kw_only=True)
class _Lnst(_Sequence):
    """LNST, Kim 2020: densities of particles that follow the smoke are optimised."""

    config: LnstSettings = field(default_factory=LnstSettings)
    """Of the method."""


@dataclass(frozen=True, kw_only=True)
class _Tnst(_Sequence):
    """TNST, Kim 2019: smoke is moved along a potential, optimised from several sides."""

    config: TnstSettings = field(default_factory=TnstSettings)
    """Of the method."""


_RUNS = {"aurand": _Aurand, "aurand-forward": _Forward, "lnst": _Lnst, "tnst": _Tnst}


def run_run(arguments: Sequence[str]) -> None:
    """Read the options of the method that comes first, and run it."""
    if not arguments or arguments[0] not in _RUNS:
        name = parse("peers run", Run, arguments).method
        raise OptionError(f"`method` {name}: comes first, before the smoke")
    name, *rest = arguments
    asked = parse(f"peers run {name}", _RUNS[name], rest)
    for _ in peers.run(asked, asked.config, Terminal()):
        pass


def run_list(arguments: Sequence[str]) -> None:
    """Print what methods there are."""
    parse("peers list", List, arguments)
    told = {name: method.paper for name, method in METHODS.items()} | NOT_RUN
    for name, what in told.items():
        print(f"{name:16}{what}")


@dataclass(frozen=True)
class List:
    """List other methods of stylizing smoke, and those that cannot be run."""
