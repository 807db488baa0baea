# SPDX-License-Identifier: GPL-3.0-or-later
"""The material of painted smoke: colours of `Cd`, lit or glowing, in part or everywhere.

How opaque it is comes from the files: σ = extinction · density, per length of the object, as vnca
shows it. Glow g splits it: (1 − g) scatters light with the colour for its albedo, and g emits the
colour, so that opaque smoke that only glows is seen in exactly the colours of the painting. Outside
the mask smoke is white, and as dense as it was where the files tell.
"""

import bpy

from . import mask as masks

_STRENGTH, _GLOW, _EXTINCTION, _MASK, _EVERYWHERE, _KEPT = (
    "Strength",
    "Glow",
    "Extinction",
    "Mask",
    "Everywhere",
    "Density as It Was",
)
_OF_MASK = "Mask: "
"""What the names of nodes that make a mask begin with."""

Socket = bpy.types.NodeSocket


def make(name: str) -> bpy.types.Material:
    """A new material: everywhere, of full strength, and lit."""
    made = bpy.data.materials.new(name)
    if made.node_tree is None:  # before Blender 5
        made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    strength = _value(tree, _STRENGTH, 1.0, (-900, 300))
    glow = _value(tree, _GLOW, 0.0, (-900, 200))
    sigma = _value(tree, _EXTINCTION, 1.0, (-900, 100))
    kept = _value(tree, _KEPT, 0.0, (-900, 0))
    everywhere = _value(tree, _EVERYWHERE, 1.0, (-900, -400))
    mask = _node(tree, "NodeReroute", (-350, -400))
    mask.name = mask.label = _MASK
    tree.links.new(everywhere, mask.inputs[0])
    colour = _attribute(tree, "Cd", (-900, -100)).outputs["Color"]
    density = _attribute(tree, "density", (-900, -200)).outputs["Fac"]
    before = _attribute(tree, masks.UNPAINTED, (-900, -300)).outputs["Fac"]

    part = _math(tree, "MULTIPLY", strength, mask.outputs[0], (-200, 100))
    seen = _mix(tree, part, (1, 1, 1, 1), colour, (0, 100))
    lit = _mix(tree, glow, seen, (0, 0, 0, 1), (200, 100))
    # As it was outside the mask, where there is a grid of that: d + kept · (1 - mask) · (d' - d)
    outside = _math(tree, "MULTIPLY_ADD", mask.outputs[0], -1.0, (-200, -300), third=1.0)
    outside = _math(tree, "MULTIPLY", outside, kept, (-50, -300))
    other = _math(tree, "SUBTRACT", before, density, (-200, -150))
    density = _math(tree, "MULTIPLY_ADD", outside, other, (100, -250), third=density)
    opaque = _math(tree, "MULTIPLY", density, sigma, (200, -150))
    glowing = _math(tree, "MULTIPLY", opaque, glow, (300, -250))

    volume = _node(tree, "ShaderNodeVolumePrincipled", (450, 0))
    volume.inputs["Density Attribute"].default_value = ""
    for source, name in (
        (lit, "Color"),
        (opaque, "Density"),
        (seen, "Emission Color"),
        (glowing, "Emission Strength"),
    ):
        tree.links.new(source, volume.inputs[name])
    output = _node(tree, "ShaderNodeOutputMaterial", (750, 0))
    tree.links.new(volume.outputs["Volume"], output.inputs["Volume"])
    return made


def set_files(made: bpy.types.Material, extinction: float, *, keeps: bool) -> None:
    """What the painted files are like, if the material is ours still.

    Args:
        made: The material.
        extinction: Of density 1, per length of the object.
        keeps: Whether they have a grid of the density as it was.
    """
    _set(made, _EXTINCTION, extinction)
    _set(made, _KEPT, float(keeps))


def adjust(painted: bpy.types.Object, settings: bpy.types.PropertyGroup, strength: float) -> None:
    """Make the material of painted smoke follow the settings, where it is ours still."""
    made = painted.active_material
    if made is None or made.node_tree is None or made.library is not None:
        return
    _set(made, _STRENGTH, strength)
    _set(made, _GLOW, settings.glow)
    if _MASK in made.node_tree.nodes and _EVERYWHERE in made.node_tree.nodes:
        _set_mask(made.node_tree, settings)


def _set(made: bpy.types.Material, label: str, wanted: float) -> None:
    if made.node_tree is not None and label in made.node_tree.nodes:
        made.node_tree.nodes[label].outputs[0].default_value = wanted


def _set_mask(tree: bpy.types.NodeTree, settings: bpy.types.PropertyGroup) -> None:
    """Lead the mask that is wanted to where it is used."""
    kind, shape = settings.mask, settings.mask_object
    for node in [node for node in tree.nodes if node.name.startswith(_OF_MASK)]:
        tree.nodes.remove(node)
    source = tree.nodes[_EVERYWHERE].outputs[0]
    if not masks.is_wanted(settings):
        pass
    elif grid := masks.grid_of(settings):
        node = _attribute(tree, grid, (-900, -550))
        node.name = _OF_MASK + "grid"
        # A flame may be hotter than 1; a mask is not.
        source = _math(tree, "MAXIMUM", node.outputs["Fac"], 0.0, (-650, -550), _OF_MASK + "least")
        source = _math(tree, "MINIMUM", source, 1.0, (-500, -550), _OF_MASK + "most")
    else:
        place = _node(tree, "ShaderNodeTexCoord", (-900, -450))
        place.name, place.object = _OF_MASK + "object", shape
        away, most = place.outputs["Object"], 1.0
        if kind == "BOX":  # how far outside |x|, |y|, |z| <= 1
            away = _vector(tree, "ABSOLUTE", away, None, (-850, -600))
            away = _vector(tree, "SUBTRACT", away, (1, 1, 1), (-750, -600))
            away, most = _vector(tree, "MAXIMUM", away, (0, 0, 0), (-650, -600)), 1e-6
        away = _vector(tree, "LENGTH", away, None, (-550, -600))
        source = _math(tree, "LESS_THAN", away, most, (-450, -450), _OF_MASK + "inside")
    tree.links.new(source, tree.nodes[_MASK].inputs[0])


def _node(tree: bpy.types.NodeTree, kind: str, at: tuple[float, float]) -> bpy.types.Node:
    node = tree.nodes.new(kind)
    node.location = at
    return node


def _value(tree: bpy.types.NodeTree, label: str, start: float, at: tuple[float, float]) -> Socket:
    node = _node(tree, "ShaderNodeValue", at)
    node.name = node.label = label
    node.outputs[0].default_value = start
    return node.outputs[0]


def _attribute(tree: bpy.types.NodeTree, grid: str, at: tuple[float, float]) -> bpy.types.Node:
    node = _node(tree, "ShaderNodeAttribute", at)
    node.attribute_type, node.attribute_name = "GEOMETRY", grid
    return node


def _math(
    tree: bpy.types.NodeTree,
    operation: str,
    one: Socket,
    other: Socket | float,
    at: tuple[float, float],
    name: str = "",
    *,
    third: "Socket | float | None" = None,
) -> Socket:
    node = _node(tree, "ShaderNodeMath", at)
    node.operation = operation
    node.name = name or node.name
    tree.links.new(one, node.inputs[0])
    _give(tree, node.inputs[1], other)
    if third is not None:
        _give(tree, node.inputs[2], third)
    return node.outputs[0]


def _vector(
    tree: bpy.types.NodeTree,
    operation: str,
    one: Socket,
    other: tuple[float, float, float] | None,
    at: tuple[float, float],
) -> Socket:
    node = _node(tree, "ShaderNodeVectorMath", at)
    node.operation, node.name = operation, _OF_MASK + operation
    tree.links.new(one, node.inputs[0])
    if other is not None:
        node.inputs[1].default_value = other
    return node.outputs["Value" if operation == "LENGTH" else "Vector"]


def _mix(
    tree: bpy.types.NodeTree,
    part: Socket,
    one: "Socket | tuple[float, ...]",
    other: "Socket | tuple[float, ...]",
    at: tuple[float, float],
) -> Socket:
    node = _node(tree, "ShaderNodeMix", at)
    node.data_type = "RGBA"
    sockets = {socket.identifier: socket for socket in (*node.inputs, *node.outputs)}
    tree.links.new(part, sockets["Factor_Float"])
    _give(tree, sockets["A_Color"], one)
    _give(tree, sockets["B_Color"], other)
    return sockets["Result_Color"]


def _give(tree: bpy.types.NodeTree, socket: Socket, value: object) -> None:
    if isinstance(value, bpy.types.NodeSocket):
        tree.links.new(value, socket)
    else:
        socket.default_value = value
