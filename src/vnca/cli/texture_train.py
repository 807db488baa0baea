"""`vnca texture train STYLE --out RUN`, and `vnca texture train --resume RUN`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import torch
import tyro

from vnca.cli.options import chosen, is_given, parse
from vnca.cli.session import (
    ResumeOptions,
    Session,
    TrainingOptions,
    asked,
    choose_device,
    fitting,
    interrupted,
    run_folder,
    shown_and_judged,
)
from vnca.cli.texture_block import KIND
from vnca.core.typing import AnyArray
from vnca.features.load import load_network
from vnca.io.mesh.mesh import Mesh, read_mesh
from vnca.io.orientation import UpAxis
from vnca.io.picture import read_style
from vnca.training.checkpoint import Checkpoint, fingerprints
from vnca.training.memory import memory_budget
from vnca.training.texture_config import PRESETS, TextureConfig
from vnca.training.texture_trainer import texture_trainer

COMMAND = "texture train"


@dataclass(frozen=True)
class TrainTexture(TrainingOptions):
    """Learn a solid texture from one picture.

    `vnca texture train --resume RUN` goes on with a training that was interrupted.
    """

    style: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STYLE")]
    """The picture: PNG, JPEG, WebP, OpenEXR, … (docs/guide/formats.md lists them)."""
    mesh: Path | None = None
    """Look at this mesh too while training: GLB, OBJ, PLY or STL."""
    up_axis: UpAxis | None = None
    """The mesh's up axis; y for OBJ and GLB, z for PLY and STL unless given."""
    preset: Literal["draft", "standard"] = "draft"
    """Values of all hyperparameters that are not given."""
    config: Annotated[TextureConfig, tyro.conf.arg(name="")] = field(default_factory=TextureConfig)
    """Hyperparameters."""


@dataclass(frozen=True)
class ResumeTexture(ResumeOptions):
    """Go on with a training that was interrupted, as if it had not been."""

    style: Path | None = None
    """The picture, if it is no longer where it was."""
    mesh: Path | None = None
    """The mesh, if it is no longer where it was."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and train, or go on with a training."""
    if is_given(arguments, "--resume"):
        resume(parse(COMMAND, ResumeTexture, arguments))
        return
    preset = chosen(arguments, "--preset", "draft")
    missing: Any = tyro.MISSING
    defaults = TrainTexture(missing, out=missing, config=PRESETS.get(preset, TextureConfig()))
    train(parse(COMMAND, TrainTexture, arguments, default=defaults))


def train(options: TrainTexture, checkpoint: Checkpoint | None = None) -> Path:
    """Train as asked, or go on from a checkpoint, and return the path of the run folder.

    Raises:
        VncaError: If an input cannot be used, the run folder cannot be written, training
            diverges, or memory runs out.
    """
    folder = run_folder(options.out, overwrite=options.overwrite, checkpoint=checkpoint)
    style = read_style(options.style)
    device = choose_device(options.device)
    mesh = read_mesh(options.mesh, options.up_axis) if options.mesh else None
    config = options.config
    torch.use_deterministic_algorithms(True)
    network = load_network(config.features, device)
    with fitting(config, "this block"):
        budget = memory_budget(options.memory_budget)
        trainer = texture_trainer(
            style, config, network, mesh=mesh, device=device, memory_budget=budget
        )
    training = {
        "kind": KIND,
        "style": options.style.name,
        "mesh": options.mesh.name if options.mesh else None,
        "preset": options.preset,
        "block": config.block,
        "seed": config.seed,
        "device": str(device),
        **shown_and_judged(trainer, network),
    }
    session = Session(
        command=COMMAND,
        trainer=trainer,
        folder=folder,
        style=style,
        training=training,
        inputs=fingerprints(style, config, network, mesh=_surfaces(mesh)),
        asked=asked(options),
        preview_every=options.preview_every,
    )
    session.run(checkpoint)
    return options.out


def resume(options: ResumeTexture) -> Path:
    """Go on with a training, if there is something left to do, and return the run folder.

    Raises:
        VncaError: If there is no checkpoint, an input changed, or as `train` says.
    """
    left = interrupted(COMMAND, TrainTexture, options)
    if left is not None:
        train(*left)
    return options.resume


def _surfaces(mesh: Mesh | None) -> list[AnyArray]:
    """What training sees of a mesh."""
    surfaces = [] if mesh is None else mesh.surfaces
    return [array for surface in surfaces for array in (surface.points, surface.faces)]
