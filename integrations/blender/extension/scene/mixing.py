# SPDX-License-Identifier: GPL-3.0-or-later
"""Mixes painted and white smoke by geometry nodes, as grids: for what reads grids, not materials.

Nodes for grids came with Blender 5.0. The material mixes in any version.
"""

import bpy

from . import material

GROUP = "Mix Painted Smoke"
"""Of the group of nodes, and of the modifier that has it."""
_STRENGTH = "Strength"


def is_possible() -> bool:
    """Whether this Blender has nodes for grids."""
    return bpy.app.version >= (5, 0, 0)


def modifier_of(painted: bpy.types.Object) -> bpy.types.Modifier | None:
    """The modifier that mixes, if painted smoke has it."""
    found = (one for one in painted.modifiers if one.type == "NODES" and one.node_group)
    return next((one for one in found if one.node_group.name.startswith(GROUP)), None)


def adjust(painted: bpy.types.Object, settings: bpy.types.PropertyGroup) -> None:
    """Make painted smoke follow the settings: the modifier mixes if there is one."""
    modifier = modifier_of(painted)
    if modifier is not None:
        _set_strength(modifier, settings.strength)
    material.adjust(painted, settings, 1.0 if modifier is not None else settings.strength)


def _set_strength(modifier: bpy.types.Modifier, strength: float) -> None:
    for item in modifier.node_group.interface.items_tree:
        if item.item_type == "SOCKET" and item.name == _STRENGTH:
            if hasattr(modifier, "properties"):  # Blender 5.2 and later
                getattr(modifier.properties.inputs, item.identifier).value = strength
            else:
                modifier[item.identifier] = strength
    modifier.id_data.update_tag()


class VNCA_OT_mix(bpy.types.Operator):
    """Mix painted and white smoke by geometry nodes, as grids, in the place of the material"""

    bl_idname = "vnca.mix"
    bl_label = "Mix by Geometry Nodes"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Whether there is a painting, and nodes for grids."""
        painted = context.scene.vnca.result
        return is_possible() and painted is not None and modifier_of(painted) is None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add the modifier."""
        settings = context.scene.vnca
        modifier = settings.result.modifiers.new(GROUP, "NODES")
        modifier.node_group = _group()
        adjust(settings.result, settings)
        return {"FINISHED"}


def _group() -> bpy.types.NodeTree:
    if (there := bpy.data.node_groups.get(GROUP)) is not None and there.library is None:
        return there
    tree = bpy.data.node_groups.new(GROUP, "GeometryNodeTree")
    tree.is_modifier = True
    face = tree.interface
    face.new_socket("Volume", in_out="INPUT", socket_type="NodeSocketGeometry")
    strength = face.new_socket(_STRENGTH, in_out="INPUT", socket_type="NodeSocketFloat")
    strength.default_value, strength.min_value, strength.max_value = 1.0, 0.0, 1.0
    face.new_socket("Volume", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    given, taken = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    read, write = (tree.nodes.new(f"GeometryNode{verb}NamedGrid") for verb in ("Get", "Store"))
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "VECTOR"
    for column, node in enumerate((given, read, mix, write, taken)):
        node.location = 220 * column, 0
    # One node goes by the type of a socket, the other by that of an attribute.
    read.data_type, write.data_type = "VECTOR", "VECTOR_FLOAT"
    for node in (read, write):
        node.inputs["Name"].default_value = "Cd"
    sockets = {socket.identifier: socket for socket in (*mix.inputs, *mix.outputs)}
    sockets["A_Vector"].default_value = (1, 1, 1)
    for source, target in (
        (given.outputs[0], read.inputs["Volume"]),
        (given.outputs[1], sockets["Factor_Float"]),
        (read.outputs["Grid"], sockets["B_Vector"]),
        (read.outputs["Volume"], write.inputs["Volume"]),
        (sockets["Result_Vector"], write.inputs["Grid"]),
        (write.outputs["Volume"], taken.inputs[0]),
    ):
        tree.links.new(source, target)
    return tree


register, unregister = bpy.utils.register_classes_factory((VNCA_OT_mix,))
