"""How a flat texture is to move: a field by name, from a file of vectors, or seen in a film."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch

from vnca.core import FloatArray
from vnca.core.errors import FileFormatError, OptionError
from vnca.features.flow import SMALLEST, FlowNetwork
from vnca.io import film_frames, vectors
from vnca.painting.flat import FIELDS, MotionField
from vnca.training.config import TextureConfig

FILM_SIDE = 128
"""Pixels along the shorter side of a film in which motion is looked for."""
MOST_PICTURES = 240
"""Of a film, from its beginning."""
_STILL = 0.02
"""Pixels a picture; a film whose mean motion is slower everywhere does not say where to go."""


def motion_field(source: str) -> MotionField:
    """The motion field that is asked for.

    Args:
        source: One of `FIELDS`; a file of vectors (.npy, .flo, .exr); or a film, whose mean motion
            at each place is taken.

    Raises:
        OptionError: If there is no field of that name.
        FileFormatError: If the file cannot be read, or its film does not move.
        BackendUnavailableError: If what reads the file is not installed.
    """
    path, suffix = Path(source), Path(source).suffix.lower()
    if source in FIELDS:
        return MotionField.named(source)
    if suffix in vectors.SUFFIXES:
        return MotionField(path.name, vectors.read_vectors(path))
    if suffix in film_frames.SUFFIXES:
        return MotionField(path.name, motion_of_film(path))
    raise OptionError(
        f"`motion_field` {source}: expected one of {', '.join(FIELDS)}, a file of vectors "
        f"({', '.join(vectors.SUFFIXES)}), or a film ({', '.join(film_frames.SUFFIXES)})"
    )


@torch.no_grad()
def motion_of_film(path: Path) -> FloatArray:
    """The mean motion at each place of a film, `[r, c, 2]`, right and up, pixels a picture.

    Raises:
        FileFormatError: If it cannot be read, is too small or short, or does not move.
        BackendUnavailableError: If what reads it is not installed.
    """
    network = FlowNetwork.load()
    pictures = film_frames.brightness_of_film(path, shorter=FILM_SIDE, most=MOST_PICTURES)
    total, count = np.zeros(2, np.float64), 0
    for before, after in pairwise(map(torch.from_numpy, pictures)):
        if min(before.shape) < SMALLEST:
            raise FileFormatError(f"{path}: at least {SMALLEST} pixels a side are needed")
        total = total + network(before[None], after[None])[0].permute(1, 2, 0).numpy()
        count += 1
    if count == 0:
        raise FileFormatError(f"{path}: at least two pictures are needed to see motion")
    mean = total * [1, -1] / count
    if np.linalg.norm(mean, axis=-1).max() < _STILL:
        raise FileFormatError(f"{path}: nothing in this film moves the same way for long")
    return mean.astype(np.float32)


def motion_asked(config: TextureConfig, source: str | None) -> MotionField | None:
    """The motion field that a texture is to be trained with, if any.

    Raises:
        VncaError: If it cannot be read, or the texture can have none.
    """
    if source is None:
        if config.rule.velocity_prior:
            raise OptionError("`velocity_prior`: needs a `motion_field`, which tells the velocity")
        return None
    if config.dimensions == 3:
        raise OptionError(f"`motion_field` {source}: a solid texture has none; add `dimensions` 2")
    if config.rule.transport:
        raise OptionError(
            f"`motion_field` {source}: the rule learns to move by itself; leave out `transport`"
        )
    return motion_field(source)


def with_motion(config: TextureConfig, motion: MotionField | None) -> TextureConfig:
    """The hyperparameters with a rule that is told the velocity where there is a motion field."""
    return replace(config, rule=replace(config.rule, velocity_prior=motion is not None))


def told_of_motion(config: TextureConfig, motion: MotionField | None) -> dict[str, Any]:
    """What the model of a flat texture tells of itself; nothing of a solid one."""
    if config.dimensions == 3:
        return {}
    told: dict[str, Any] = {"dimensions": 2}
    if motion is not None:
        told |= {"motion_field": motion.name, "motion_speed": config.motion_speed}
    return told
