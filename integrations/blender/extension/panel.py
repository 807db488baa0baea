# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel, in the sidebar of the 3D view and in the data of volumes."""

import textwrap

import bpy

from . import interpreter, thumbnails, work
from .job import Job, clock
from .problem import ProblemError
from .scene import mixing
from .settings import domain_of, is_smoke, python_for_training
from .versions import can_go_on_painting, can_go_on_training

LETTER = 7.0
"""Width of a letter, pixels of an interface of scale 1."""


class _Panel:
    bl_label = "Smoke Painting"

    def draw(self, context: bpy.types.Context) -> None:
        """Show what is chosen, and how far the work has come."""
        layout, settings = self.layout, context.scene.vnca
        layout.use_property_split = True
        layout.use_property_decorate = False
        job = work.current
        is_at_work = job is not None and job.is_running
        choices = layout.column()
        choices.enabled = not is_at_work
        _draw_smoke(choices, context, settings)
        _draw_style(choices, context, settings)
        _draw_painting(choices, settings)
        _draw_buttons(layout, context, settings, is_at_work=is_at_work)
        if job is not None:
            width = context.region.width / context.preferences.system.ui_scale
            _draw_job(layout, job, max(int(width / LETTER) - 8, 20))


class VNCA_PT_view(_Panel, bpy.types.Panel):
    """In the sidebar of the 3D view."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "vnca"


class VNCA_PT_volume(_Panel, bpy.types.Panel):
    """In the data of volumes."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only volumes."""
        return context.object is not None and context.object.type == "VOLUME"


class VNCA_PT_domain(_Panel, bpy.types.Panel):
    """In the physics of domains."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "physics"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only domains of gas."""
        return context.object is not None and domain_of(context.object) is not None


def _draw_smoke(
    layout: bpy.types.UILayout, context: bpy.types.Context, settings: bpy.types.PropertyGroup
) -> None:
    row = layout.row(align=True)
    row.prop(settings, "source")
    row.operator("vnca.use_active", text="", icon="EYEDROPPER")
    source = settings.source
    if source is None or not is_smoke(None, source):
        return
    domain = domain_of(source)
    render = context.scene.render
    fps = f"{render.fps / render.fps_base:g} fps"
    if domain is not None:
        layout.label(text=f"{fps}, time scale {domain.time_scale:g}", icon="TIME")
        return
    layout.prop(settings, "units")
    if settings.units != "cells/frame":
        layout.prop(settings, "time_scale")
    layout.label(text=fps, icon="TIME")


def _draw_style(
    layout: bpy.types.UILayout, context: bpy.types.Context, settings: bpy.types.PropertyGroup
) -> None:
    layout.separator()
    layout.row().prop(settings, "way", expand=True)
    if settings.way == "LIBRARY":
        layout.template_icon_view(settings, "style", show_labels=True, scale_popup=6.0)
        layout.prop(settings, "style", text="")
    elif settings.way == "MODEL":
        layout.prop(settings, "model")
    else:
        layout.prop(settings, "picture")
        layout.prop(settings, "preset")
        if settings.preset == "OWN":
            layout.prop(settings, "preset_file")
        _draw_training(layout, context)


def _draw_training(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    try:
        words = interpreter.trainer(python_for_training(context), work.WORKER).words
    except ProblemError:
        box = layout.box()
        for line in interpreter.NO_TRAINING:
            box.label(text=line)
        box.operator("preferences.addon_show", text="Preferences").module = __package__
        return
    row = layout.row(align=True)
    row.operator("vnca.train", icon="OUTLINER_OB_LIGHTPROBE")
    if can_go_on_training(context.scene):
        row.operator("vnca.train", text="Go On", icon="PLAY").goes_on = True
    layout.label(text=f"with {words[0]}", icon="CONSOLE")


def _draw_painting(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout.separator()
    for name in ("strength", "glow", "density_strength", "refine", "seed"):
        layout.prop(settings, name)
    layout.prop(settings, "mask")
    if settings.mask in ("BOX", "BALL", "MESH"):
        layout.prop(settings, "mask_object")
    elif settings.mask == "GRID":
        layout.prop(settings, "mask_grid")
    layout.prop(settings, "span")
    if settings.span == "SOME":
        row = layout.row(align=True)
        row.prop(settings, "first")
        row.prop(settings, "last", text="")
    layout.prop(settings, "folder")
    layout.prop(settings, "hide_source")


def _draw_buttons(
    layout: bpy.types.UILayout,
    context: bpy.types.Context,
    settings: bpy.types.PropertyGroup,
    *,
    is_at_work: bool,
) -> None:
    layout.separator()
    if is_at_work:
        layout.operator("vnca.cancel", icon="X")
        return
    layout.operator("vnca.preview", icon="HIDE_OFF")
    row = layout.row(align=True)
    row.scale_y = 1.5
    row.operator("vnca.paint", icon="BRUSH_DATA")
    if can_go_on_painting(context.scene):
        row.operator("vnca.paint", text="Go On", icon="PLAY").goes_on = True
    if settings.result is not None and mixing.is_possible():
        layout.operator("vnca.mix", icon="GEOMETRY_NODES")


def _draw_lines(layout: bpy.types.UILayout, text: str, icon: str, letters: int) -> None:
    """A text as long as it is: a label has one line, and leaves out what does not fit."""
    for line in textwrap.wrap(text, letters):
        layout.label(text=line, icon=icon)
        icon = "BLANK1"


def _draw_job(layout: bpy.types.UILayout, job: Job, letters: int) -> None:
    box = layout.box()
    if job.is_running:
        text = f"{job.what.capitalize()} {job.done}/{job.total}" if job.total else job.what
        if job.seconds_left is not None:
            text += f", {clock(job.seconds_left)} left"
        if hasattr(box, "progress"):
            box.progress(factor=job.fraction, text=text)
        else:
            box.label(text=f"{text} ({job.fraction:.0%})", icon="TIME")
        box.label(text="Esc cancels")
    elif job.state == "failed":
        column = box.column(align=True)
        column.alert = True
        _draw_lines(column, job.message, "ERROR", letters)
        box.operator("vnca.log", icon="TEXT")
    elif job.state == "cancelled":
        box.label(text="Cancelled; what was finished is kept", icon="CANCEL")
    for note in job.notes[-2:]:
        _draw_lines(box.column(align=True), note, "INFO", letters)
    if icon := thumbnails.icon_of_work(job.picture):
        box.template_icon(icon, scale=9.0)


_CLASSES = (VNCA_PT_view, VNCA_PT_volume, VNCA_PT_domain)

register, unregister = bpy.utils.register_classes_factory(_CLASSES)
