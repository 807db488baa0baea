"""`vnca simulate`: smoke to play with."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from vnca.cli.options import parse
from vnca.cli.terminal import Terminal
from vnca.recipe.simulation import Scene, SimulateRun, simulate


@dataclass(frozen=True, kw_only=True)
class Simulate(SimulateRun):
    """Write a smoke simulation: density and velocity (cells/frame), an OpenVDB file a frame."""

    scene: Annotated[
        tyro.conf.Positional[Scene],
        tyro.conf.arg(metavar="{plume,jets,ring,jet,sphere,billowy,bunny}"),
    ]
    """A rising plume, two colliding jets, a rising vortex ring; the paper's jet, a plume against a
    sphere, billowy smoke, or smoke around a mesh (bunny)."""
    preset: Annotated[Literal["paper"] | None, tyro.conf.arg(metavar="paper")] = None
    """The jet as the paper has it: 200 cells across, 300 high, 120 frames."""
    out: Path
    """Folder for the frames, named SCENE_0001.vdb and on."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and simulate."""
    options = parse("simulate", Simulate, arguments)
    asked = {f.name: getattr(options, f.name) for f in dataclasses.fields(SimulateRun)}
    for _ in simulate(**asked, watch=Terminal()):
        pass
