# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads from the scene what is to be painted: files, frames, units, places."""

import re
from pathlib import Path

import bpy

from .. import cache
from ..problem import ProblemError
from ..request import STAGED, Look, Smoke, Staged
from ..settings import domain_of
from . import mask

_NUMBER = re.compile(r"(\d+)(?=\D*$)")
NOTHING_CHOSEN = "Choose the smoke: a fluid domain of gas, or a volume"


def smoke_of(scene: bpy.types.Scene, folder: Path, *, masked: bool = True) -> Smoke:
    """The smoke that is chosen in the scene, with all frames that there are.

    Args:
        scene: The scene.
        folder: Of the painting; in its folder `staged` frames are copied where they have to be.
        masked: Whether they get what the mask of the scene needs.

    Raises:
        ProblemError: If nothing is chosen, or its files cannot be used.
    """
    source = scene.vnca.source
    if source is None:
        raise ProblemError(NOTHING_CHOSEN)
    domain, staged = domain_of(source), str(folder / "staged")
    if domain is not None:
        smoke = _of_domain(scene, source, domain, staged)
    elif source.type == "VOLUME":
        smoke = _of_volume(scene, source)
    else:
        raise ProblemError(f"{source.name}: neither a fluid domain of gas nor a volume")
    return smoke.masked(staged) if masked and mask.is_wanted(scene.vnca) else smoke


def look_of(settings: bpy.types.PropertyGroup) -> Look:
    """How it is to be painted.

    Raises:
        ProblemError: If no style is chosen.
    """
    style, model = None, None
    if settings.way == "LIBRARY":
        style = settings.style
        if style in ("", "NONE"):
            raise ProblemError("vnca is missing in the extension; install the zip of your platform")
    else:
        model = absolute(settings.model, "the model")
        if not model:
            raise ProblemError(
                "Train first: a picture is no style yet"
                if settings.way == "PICTURE"
                else "Choose a model, or a style of the library"
            )
        if not Path(model).exists():
            raise ProblemError(f"{model}: there is no such model")
    return Look(style, model, settings.density_strength, settings.refine, settings.seed)


def frames_of(scene: bpy.types.Scene, smoke: Smoke, shift: int) -> tuple[int, ...]:
    """Numbers of the frames that are to be painted.

    Args:
        scene: The scene.
        smoke: What there is.
        shift: What is added to a frame of the scene for the number of its file.

    Raises:
        ProblemError: If there is none of them.
    """
    settings = scene.vnca
    if settings.span == "ALL" or not smoke.is_sequence:
        return smoke.numbers
    first, last = settings.first, settings.last
    if settings.span == "SCENE":
        first, last = scene.frame_start, scene.frame_end
    chosen = tuple(n for n in smoke.numbers if first + shift <= n <= last + shift)
    if not chosen:
        there = f"{smoke.numbers[0]} to {smoke.numbers[-1]}"
        raise ProblemError(
            f"{smoke.name}: no files for the frames {first} to {last}; there are {there}"
        )
    return chosen


def shift_of(source: bpy.types.Object) -> int:
    """What is added to a frame of the scene for the number of the file that it shows."""
    if (domain := domain_of(source)) is not None:
        return -domain.cache_frame_offset
    if source.type != "VOLUME" or not source.data.is_sequence:
        return 0
    return source.data.frame_offset - source.data.frame_start + 1


def absolute(path: str, what: str) -> str:
    """A path as the system knows it; empty if it is.

    Raises:
        ProblemError: If it is relative to a scene that is not saved.
    """
    if path.startswith("//") and not bpy.data.filepath:
        raise ProblemError(
            f"Save the scene first, since {what} is relative to it ({path}); or choose a full path"
        )
    return str(Path(bpy.path.abspath(path)).absolute()) if path else ""


def _fps(scene: bpy.types.Scene) -> float:
    return scene.render.fps / scene.render.fps_base


def _units(settings: bpy.types.PropertyGroup, *, is_fluid: bool) -> str:
    if settings.units != "AUTO":
        return settings.units
    return "mantaflow" if is_fluid else "m/s"


def _of_domain(
    scene: bpy.types.Scene,
    source: bpy.types.Object,
    domain: "bpy.types.FluidDomainSettings",
    copies: str,
) -> Smoke:
    if domain.cache_data_format != "OPENVDB":
        raise ProblemError(
            f"{source.name}: its cache is not OpenVDB; choose that in Physics > Cache > Format "
            "Volumes and bake again"
        )
    path = bpy.path.abspath(domain.cache_directory, library=source.library)
    if path.startswith("//") or (domain.cache_directory.startswith("//") and not _is_saved(source)):
        raise ProblemError(
            f"{source.name}: save the scene first, since its cache is relative to it "
            f"({domain.cache_directory})"
        )
    folder = Path(path).absolute()
    there = cache.frames(folder, cache.DATA)
    if not there:
        raise ProblemError(f"{source.name}: nothing is baked in {folder}; bake the domain first")
    noise = cache.frames(folder, cache.NOISE) if domain.use_noise else {}
    numbers = tuple(sorted(noise if noise else there))
    if absent := [number for number in numbers if number not in there]:
        raise ProblemError(
            f"{folder}: frame {absent[0]} has noise without the data; bake the domain again"
        )
    configs = {n: cache.read_config(cache.config_path(folder, n)) for n in numbers}
    config = configs[numbers[0]]
    sides = [
        abs(scale) * (upper - lower)
        for scale, lower, upper in zip(source.scale, config.lower, config.upper)
    ]
    voxel = max(sides) / max(config.cells)
    sequence, staged = str(folder / "data" / "fluid_data_####.vdb"), ()
    if noise or not all(one.is_whole for one in configs.values()):
        sequence = f"{copies}/{STAGED}"
        finer = domain.noise_scale if noise else 1
        staged = tuple(
            Staged(
                number,
                str(there[number]),
                str(noise[number]) if noise else None,
                configs[number].first,
                voxel,
                finer,
            )
            for number in numbers
        )
    return Smoke(
        name=source.name,
        sequence=sequence,
        numbers=numbers,
        units=_units(scene.vnca, is_fluid=True),
        fps=_fps(scene),
        time_scale=domain.time_scale,
        placement=cache.placement(config, voxel),
        staged=staged,
    )


def _is_saved(source: bpy.types.Object) -> bool:
    return bool(bpy.data.filepath or source.library)


def _of_volume(scene: bpy.types.Scene, source: bpy.types.Object) -> Smoke:
    volume = source.data
    if not volume.filepath:
        raise ProblemError(f"{source.name}: has no file; import OpenVDB files")
    text = bpy.path.abspath(volume.filepath, library=volume.library)
    if text.startswith("//"):
        raise ProblemError(
            f"{source.name}: save the scene first, since its files are relative to it "
            f"({volume.filepath})"
        )
    path = Path(text).absolute()
    number = _NUMBER.search(path.stem)
    numbers, sequence = (1,), str(path)
    if number is not None:
        numbers = (int(number[1]),)
    is_sequence = volume.is_sequence and number is not None
    if is_sequence:
        before, after = path.stem[: number.start()], path.stem[number.end() :]
        digits = len(number[1])
        form = re.compile(re.escape(before) + r"(\d+)" + re.escape(after) + r"\.vdb", re.I)
        found = (form.fullmatch(other.name) for other in path.parent.glob("*"))
        numbers = tuple(sorted(int(match[1]) for match in found if match))
        sequence = str(path.parent / f"{before}{'#' * digits}{after}{path.suffix}")
    if not (numbers if is_sequence else path.is_file()):
        raise ProblemError(f"{path}: there is no such file")
    return Smoke(
        name=source.name,
        sequence=sequence,
        numbers=numbers,
        units=_units(scene.vnca, is_fluid=path.name.startswith("fluid_")),
        fps=_fps(scene),
        time_scale=scene.vnca.time_scale,
        up_axis=_up_axis(source),
        is_sequence=is_sequence,
    )


def _up_axis(source: bpy.types.Object) -> str:
    """Which axis of the files points up in the scene, most nearly."""
    _, y, z = (abs(source.matrix_world[2][axis]) for axis in range(3))
    return "y" if y > z else "z"
