# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist chooses, kept in the scene; and where training finds its Python."""

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import thumbnails
from .scene import mixing

# Before 4.5 every path may be relative to the scene, and nothing says so.
_PATH = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()


def is_smoke(_: object, candidate: bpy.types.Object) -> bool:
    """Whether an object can be painted: a domain of gas, or a volume."""
    return candidate.type == "VOLUME" or domain_of(candidate) is not None


def domain_of(candidate: bpy.types.Object) -> "bpy.types.FluidDomainSettings | None":
    """Settings of a domain of gas; None of other objects."""
    for modifier in candidate.modifiers:
        if modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN":
            domain = modifier.domain_settings
            return domain if domain.domain_type == "GAS" else None
    return None


def _shown_at_once(settings: "VncaSettings", _: bpy.types.Context) -> None:
    if settings.result is not None:
        mixing.adjust(settings.result, settings)


class VncaSettings(bpy.types.PropertyGroup):
    """How smoke of this scene is painted."""

    source: PointerProperty(
        type=bpy.types.Object,
        name="Smoke",
        description="A fluid domain of gas, or a volume of OpenVDB files",
        poll=is_smoke,
    )
    result: PointerProperty(type=bpy.types.Object, name="Painted", poll=is_smoke)
    units: EnumProperty(
        name="Velocity",
        description="Units of the velocity in the files",
        items=[
            ("AUTO", "Automatic", "Fluid caches: the solver's; other files: metres a second"),
            ("mantaflow", "Blender's Fluid", "Units of Blender's fluid solver"),
            ("m/s", "Metres a Second", "As Houdini and most programs write them"),
            ("cells/frame", "Cells a Frame", "As vnca writes them"),
        ],
    )
    time_scale: FloatProperty(
        name="Time Scale",
        description="Of the simulation that the files came from",
        default=1.0,
        min=0.001,
        soft_max=10.0,
    )
    way: EnumProperty(
        name="Style From",
        items=[
            ("LIBRARY", "Library", "A style that comes with the extension"),
            ("MODEL", "Model", "A style that was trained before"),
            ("PICTURE", "Picture", "Train a new style on a picture"),
        ],
    )
    style: EnumProperty(name="Style", items=thumbnails.style_items)
    model: StringProperty(
        name="Model",
        description="A model file, or the folder of a training",
        subtype="FILE_PATH",
        options=_PATH,
    )
    picture: StringProperty(
        name="Picture",
        description="The picture to learn from",
        subtype="FILE_PATH",
        options=_PATH,
    )
    preset: EnumProperty(
        name="Training",
        items=[
            ("draft", "Draft", "Minutes"),
            ("standard", "Standard", "About an hour"),
            ("paper", "Paper", "As in the paper; wants a GPU"),
            ("OWN", "Own", "A preset of your own, as vnca train --show-preset writes one"),
        ],
    )
    preset_file: StringProperty(
        name="Preset",
        description="A TOML file of hyperparameters",
        subtype="FILE_PATH",
        options=_PATH,
    )
    strength: FloatProperty(
        name="Strength",
        description="Colour of the painting, from white smoke to all of it; seen at once",
        default=1.0,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=_shown_at_once,
    )
    density_strength: FloatProperty(
        name="Density",
        description="How much the painting changes the density; painted",
        default=1.0,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    )
    glow: FloatProperty(
        name="Glow",
        description="0: lit by the lamps of the scene; 1: glows in its own colours",
        default=0.0,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=_shown_at_once,
    )
    refine: IntProperty(
        name="Refine",
        description="Paint on a grid so many times as fine as the smoke's",
        default=2,
        min=1,
        max=8,
    )
    seed: IntProperty(name="Seed", description="Same seed, same painting", min=0)
    span: EnumProperty(
        name="Frames",
        items=[
            ("SCENE", "Scene", "Frames of the scene that there are files of"),
            ("ALL", "All", "All frames that there are files of"),
            ("SOME", "Some", "From one frame of the scene to another"),
        ],
    )
    first: IntProperty(name="First", default=1)
    last: IntProperty(name="Last", default=24)
    mask: EnumProperty(
        name="Mask",
        description="Where smoke is painted; elsewhere it is white, and as dense as it was. "
        "Colours follow at once, densities from the next painting on",
        items=[
            ("NONE", "Everywhere", "All smoke is painted"),
            ("BOX", "Box of Object", "Inside the cube of an empty, or of any object"),
            ("BALL", "Ball of Object", "Inside the unit ball of an object"),
            ("MESH", "Inside of Mesh", "Inside a closed mesh as it is when Paint is pressed"),
            ("GRID", "Grid", "By a grid of the files, such as flame, from 0 to 1"),
        ],
        update=_shown_at_once,
    )
    mask_object: PointerProperty(type=bpy.types.Object, name="Object", update=_shown_at_once)
    mask_grid: StringProperty(name="Grid", default="flame", update=_shown_at_once)
    folder: StringProperty(
        name="Output",
        description="Folder for the painted files; // is where the scene is saved",
        default="//vnca",
        subtype="DIR_PATH",
        options=_PATH,
    )
    hide_source: BoolProperty(
        name="Hide the Smoke",
        description="Hide the smoke that was painted",
        default=True,
    )


class VncaPreferences(bpy.types.AddonPreferences):
    """Where training finds its Python."""

    bl_idname = __package__

    python: StringProperty(
        name="Python for Training",
        description="Folder of a Python environment with vnca[train]; unless given, that of the "
        "program vnca on the path",
        subtype="DIR_PATH",
    )

    def draw(self, _: bpy.types.Context) -> None:
        """Show them."""
        self.layout.prop(self, "python")
        self.layout.operator("vnca.check_training", icon="CHECKMARK")


def python_for_training(context: bpy.types.Context) -> str:
    """What the preferences say; empty where nothing is said."""
    addon = context.preferences.addons.get(__package__)
    return bpy.path.abspath(addon.preferences.python) if addon and addon.preferences else ""


_register, _unregister = bpy.utils.register_classes_factory((VncaSettings, VncaPreferences))


def register() -> None:
    """Add the settings to scenes."""
    _register()
    bpy.types.Scene.vnca = PointerProperty(type=VncaSettings)


def unregister() -> None:
    """Take them away."""
    del bpy.types.Scene.vnca
    _unregister()
