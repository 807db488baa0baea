"""Other methods from files to files: they write the same painted sequences as vnca does."""

import dataclasses
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

import vnca
from vnca.bench import peak_mb
from vnca.core import Box
from vnca.core.errors import FileFormatError, GridError, OptionError, OutputError
from vnca.core.field import Field
from vnca.core.files import existing_file, remove_leftovers, whole_file, writable_folder
from vnca.core.lattice import Region
from vnca.features import load_network
from vnca.io import SmokeFormat, with_fitted_scale, write_painted
from vnca.io.picture import read_style
from vnca.io.provenance import Provenance, velocity_of
from vnca.io.sequence import Frame, FrameSequence
from vnca.io.smoke_format import up_axis_of
from vnca.peers import Clip, Look, Settings
from vnca.peers.gram import grey_picture
from vnca.peers.methods import method_named
from vnca.recipe import Watch, recorded
from vnca.recipe.sequence import open_sequence, sequence_region, volumes
from vnca.rule import density_scale

RECORD = "peers.json"
"""In the folder of the frames: what was asked for, and what it cost."""
SPREAD = 4
"""Cells beyond the smoke into which a method may move it."""


@dataclass(frozen=True, kw_only=True)
class PeersRun:
    """Stylise a sequence with another method, in grey.

    Each method has settings of its own.
    """

    sequence: str
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    picture: Path
    """The picture; it is made grey, as all of them change density only."""
    out: Path
    """Folder for the painted frames and `peers.json`."""
    frames: str | None = None
    """Frames to paint, such as 30-53 or 1,4,7-9; all unless given."""
    features: str = "vgg16"
    """Network that compares, in the place of the originals' GoogLeNet: vgg16 (ImageNet's where it
    was fetched before, else edges), edges, imagenet, efficientnet, or the path of a VGG's weights,
    such as of the VGG19 that Aurand 2022 has."""
    overwrite: bool = False
    """Replace painted frames that the folder holds."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""


def run(options: PeersRun, settings: Settings, watch: Watch) -> Iterator[Path]:
    """Stylise all frames, then write them one after the other: an end before leaves none behind.

    Args:
        options: What is asked.
        settings: Of the method, which tell its name.
        watch: Is told how far it has come; what it raises ends the work.

    Yields:
        The file of each frame.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    stylise = method_named(settings.name).stylise
    sequence = open_sequence(options.sequence, options.frames, watch)
    out = _ready(options, sequence)
    look = Look(grey_picture(read_style(options.picture)), load_network(options.features))
    smoke = with_fitted_scale(options.smoke, sequence)
    region = sequence_region(sequence, smoke, watch)
    box = region.box.grown(SPREAD)
    clip, scale = clip_of(sequence, smoke, region)
    watch.note(f"{settings.name}: compares by '{look.network.name}'")
    what, densities = f"stylising ({settings.name})", []

    def tell(done: int, total: int, loss: float | None) -> None:
        watch.progress(what, done, total, "steps", "" if loss is None else f"loss {loss:.3g}")

    def work() -> None:
        densities.append(stylise(clip, look, settings, tell))

    watch.progress(what, 0, 1, "steps")
    start = time.monotonic()
    memory = peak_mb(work, "cpu")
    seconds = time.monotonic() - start
    provenance = _provenance(options, settings, clip, scale, region)
    for frame, density in zip(sequence, densities[0], strict=True):
        yield _written(options, smoke, frame, density * scale, box, region, provenance)
    cost = {"seconds_per_frame": seconds / len(sequence), "peak_mb": memory}
    record = {
        "method": settings.name,
        "vnca": vnca.__version__,
        "features": look.network.name,
        "asked": recorded(options),
        "settings": recorded(settings),
        "cells": clip.shape,
        **cost,
    }
    with whole_file(out / RECORD) as temporary:
        temporary.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    watch.note(
        f"{seconds / len(sequence):.1f} s a frame"
        + (f", at most {memory:.0f} MB" if memory is not None else "")
    )
    watch.made("painted", out)


def _ready(options: PeersRun, sequence: FrameSequence) -> Path:
    """The folder, if nothing in it would be lost."""
    out = writable_folder(options.out)
    if any(frame.path.resolve().parent == out.resolve() for frame in sequence):
        raise OptionError(f"`out` {out}: is the folder of the input; choose another")
    targets = [_target(out, frame) for frame in sequence]
    there = [target for target in targets if target.exists()]
    if there and not options.overwrite:
        raise OutputError(
            f"{out}: holds painted frames already, such as {there[0].name}; choose another `out` "
            "or `overwrite`"
        )
    remove_leftovers(out, {target.name for target in targets} | {RECORD})
    return out


def clip_of(sequence: FrameSequence, smoke: SmokeFormat, region: Region) -> tuple[Clip, float]:
    """All frames as arrays over their box, `SPREAD` cells larger, and the density that counts as 1.

    Raises:
        GridError: If a frame has no velocity, or the box is far larger than the smoke in it.
        FileFormatError: If a frame cannot be read.
    """
    box = region.box.grown(SPREAD)
    density, velocity = [], []
    for frame, volume in zip(sequence, volumes(sequence, smoke, region.lattice), strict=True):
        flow = volume.velocity_field
        if flow is None:
            raise GridError(
                f"{frame.path}: has no velocity, along which this method carries what it changes; "
                "name its grid with `velocity_grid`"
            )
        density.append(volume.density_field.dense(box, what=str(frame.path)))
        velocity.append(flow.dense(box, what=str(frame.path)))
    densities = np.stack(density)
    scale = density_scale(densities)
    return Clip(torch.from_numpy(densities / scale), torch.from_numpy(np.stack(velocity))), scale


def _target(out: Path, frame: Frame) -> Path:
    return out / f"{frame.path.stem}.vdb"


def _provenance(
    options: PeersRun, settings: Settings, clip: Clip, scale: float, region: Region
) -> Provenance:
    gamma = settings.gamma_on(clip)
    facts: dict[str, Any] = {
        "version": vnca.__version__,
        "model": settings.name,
        "style": options.picture.name,
        "refine": 1,
        "seed": settings.seed,
    }
    extinction = gamma / scale / region.lattice.spacing
    return Provenance(extinction, gamma, "z", facts, velocity_of(options.smoke))


def _written(
    options: PeersRun,
    smoke: SmokeFormat,
    frame: Frame,
    density: Tensor,
    box: Box,
    region: Region,
    told: Provenance,
) -> Path:
    path = _target(options.out, frame)
    values = Field.from_dense(density.numpy(), box.lower)
    white = Field.from_dense(np.ones((*box.shape, 3), np.float32), box.lower)
    write_painted(
        path,
        frame.path,
        smoke,
        density=values,
        colour=white,
        box=box,
        lattice=region.lattice,
        beyond=SPREAD,
        provenance=dataclasses.replace(told, up_axis=up_axis_of(frame.path, smoke)),
    )
    return path


def read_record(folder: Path) -> dict[str, Any]:
    """What a run of another method recorded in its folder.

    Raises:
        FileFormatError: If there is none, or it is damaged.
    """
    path = existing_file(folder / RECORD)
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        return {**record, "method": str(record["method"])}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileFormatError(f"{path}: damaged ({error})") from error
