# SPDX-License-Identifier: Apache-2.0
"""The digital asset, from its source: `hython -m vnca_houdini.asset vnca.hda`.

A subnet with the parameters of `node`, and in it the Python SOP that shows what was painted. It was
tested with a `hou` that is faked; it was not run in Houdini.
"""

import sys
from pathlib import Path

import hou

from .node import templates

TYPE, LABEL = "vnca::paint::1.0", "Paint Smoke"
COOK = "from vnca_houdini import node; node.cook(hou.pwd(), hou.pwd().parent())"


def build(path: Path) -> None:
    """Write the asset's library."""
    container = hou.node("/obj").createNode("geo", "vnca_asset")
    try:
        subnet = container.createNode("subnet", "vnca_paint")
        shown = subnet.createNode("python", "painted")
        shown.setInput(0, subnet.indirectInputs()[0])
        shown.parm("python").set(COOK)
        shown.setDisplayFlag(True)
        shown.setRenderFlag(True)
        asset = subnet.createDigitalAsset(
            TYPE,
            hda_file_name=str(path),
            description=LABEL,
            min_num_inputs=1,
            max_num_inputs=1,
        )
        definition = asset.type().definition()
        definition.setParmTemplateGroup(hou.ParmTemplateGroup(templates()))
        options = definition.options()
        options.setLockContents(True)
        definition.setOptions(options)
        definition.save(str(path))
    finally:
        container.destroy()


if __name__ == "__main__":
    build(Path(sys.argv[1]).absolute())
