# SPDX-License-Identifier: Apache-2.0
"""The SOP: VDBs in, painted VDBs out.

It is a Python SOP. *Paint* writes the VDBs of its input, frame by frame, and has vnca paint them;
cooking reads the painted file of the frame. Written after SideFX's documentation and tested with a
`hou` that is faked; it was not run in Houdini.
"""

from pathlib import Path

import hou

from . import work
from .request import Painting, ProblemError, program

COOK = "from vnca_houdini import node; node.cook(hou.pwd())"
_PAINT = "from vnca_houdini import node; node.paint(hou.pwd())"
_GO_ON = "from vnca_houdini import node; node.paint(hou.pwd(), goes_on=True)"
STYLES = (
    *("cafe", "church", "embers", "engraving", "frost", "fur", "harvest"),
    *("ink", "marble", "stained_glass", "threads", "woodcut"),
)


def add_after_selected() -> "hou.Node | None":
    """The shelf's tool: a new node behind the selected one."""
    selected = hou.selectedNodes()
    if not selected:
        hou.ui.displayMessage("Select the SOP whose VDBs are to be painted")
        return None
    return add(selected[0])


def add(source: "hou.Node") -> "hou.Node":
    """A new node that paints the VDBs of another."""
    made = source.parent().createNode("python", "vnca_paint")
    made.setInput(0, source)
    group = made.parmTemplateGroup()
    for template in templates():
        group.append(template)
    made.setParmTemplateGroup(group)
    made.parm("python").set(COOK)
    made.moveToGoodPosition()
    return made


def templates() -> "list[hou.ParmTemplate]":
    """The parameters, which are those of `vnca paint`."""
    button = {"script_callback_language": hou.scriptLanguage.Python}
    return [
        hou.ButtonParmTemplate("paint", "Paint", script_callback=_PAINT, **button),
        hou.ButtonParmTemplate("goon", "Go On", script_callback=_GO_ON, **button),
        hou.MenuParmTemplate("style", "Style", ("", *STYLES), ("Picture or Model", *STYLES), 1),
        hou.StringParmTemplate(
            "model", "Picture or Model", 1, string_type=hou.stringParmType.FileReference
        ),
        hou.StringParmTemplate("folder", "Folder", 1, ("$HIP/vnca/$OS",)),
        hou.IntParmTemplate("range", "Frames", 2, (1, 24)),
        hou.FloatParmTemplate("timescale", "Time Scale", 1, (1.0,)),
        hou.FloatParmTemplate("strength", "Strength", 1, (1.0,), 0, 1),
        hou.FloatParmTemplate("densitystrength", "Density Strength", 1, (1.0,), 0, 1),
        hou.IntParmTemplate("refine", "Refine", 1, (1,), 1, 8),
        hou.IntParmTemplate("seed", "Seed", 1, (0,)),
    ]


def painting_of(node: "hou.Node") -> Painting:
    """What the parameters say.

    Raises:
        ProblemError: If they do not fit together.
    """
    style = node.parm("style").evalAsString()
    first, last = node.parmTuple("range").eval()
    return Painting(
        folder=Path(node.parm("folder").evalAsString()),
        style=style,
        model="" if style else node.parm("model").evalAsString(),
        first=first,
        last=last,
        fps=hou.fps(),
        time_scale=node.parm("timescale").eval(),
        strength=node.parm("strength").eval(),
        density_strength=node.parm("densitystrength").eval(),
        refine=node.parm("refine").eval(),
        seed=node.parm("seed").eval(),
    )


def paint(node: "hou.Node", *, goes_on: bool = False) -> None:
    """Write the input's VDBs, and paint them; Esc ends it, and *Go On* goes on.

    Raises:
        hou.NodeError: If it fails.
    """
    try:
        asked, vnca = painting_of(node), program()
        inputs = node.inputs()
        if not inputs:
            raise ProblemError("Connect the VDBs that are to be painted")
        with hou.InterruptableOperation("Painting", open_interrupt_dialog=True) as operation:
            if not goes_on:
                _write(inputs[0], asked, operation)
            work.run(
                vnca,
                asked.words(goes_on=goes_on),
                lambda part, line: operation.updateLongProgress(part, line),
            )
    except (ProblemError, OSError) as error:
        raise hou.NodeError(str(error)) from error
    node.cook(force=True)


def _write(source: "hou.Node", asked: Painting, operation: "hou.InterruptableOperation") -> None:
    asked.source(asked.first).parent.mkdir(parents=True, exist_ok=True)
    for done, number in enumerate(asked.frames):
        operation.updateLongProgress(done / len(asked.frames), f"writing frame {number}")
        geometry = source.geometryAtFrame(number)
        if not any(isinstance(prim, hou.VDB) for prim in geometry.prims()):
            raise ProblemError(f"{source.path()}: no VDB in frame {number}; Convert VDB makes some")
        geometry.saveToFile(str(asked.source(number)))


def cook(node: "hou.Node", asked: "hou.Node | None" = None) -> None:
    """Show the painted VDBs of the frame; the input's, with a warning, where there are none.

    Args:
        node: The Python SOP.
        asked: The node with the parameters, if that is another.

    Raises:
        hou.NodeError: If the parameters do not fit together.
    """
    try:
        path = painting_of(asked or node).painted(hou.frame())
    except ProblemError as error:
        raise hou.NodeError(str(error)) from error
    if not path.is_file():
        raise hou.NodeWarning(f"{path} is not painted yet")
    geometry = node.geometry()
    geometry.clear()
    geometry.loadFromFile(str(path))
