# SPDX-License-Identifier: Apache-2.0
"""The TOP recipe for farms: command lines of a *Generic Generator*, one a painting.

A frame needs the state of the one before, so a painting is one work item; several styles, shots and
seeds are painted side by side. Tested with a `hou` that is faked; it was not run in Houdini.
"""

import shlex
from collections.abc import Sequence

import hou

from .request import Painting


def command(painting: Painting, vnca: str = "vnca") -> str:
    """The command line of a painting whose smoke is written already; it may be run again."""
    return shlex.join([vnca, *painting.words(goes_on=True)])


def add(network: "hou.Node", paintings: Sequence[Painting], vnca: str = "vnca") -> "hou.Node":
    """A Generic Generator for each painting, and a node that waits for all of them."""
    merged = network.createNode("waitforall", "painted")
    for at, painting in enumerate(paintings):
        made = network.createNode("genericgenerator", f"paint_{painting.folder.name}")
        made.parm("pdg_command").set(command(painting, vnca))
        made.parm("itemcount").set(1)
        merged.setInput(at, made)
    network.layoutChildren()
    return merged
