"""Training of a solid texture from one picture."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from vnca.core.typing import AnyArray, FloatArray
from vnca.core.watch import SILENT, Watch
from vnca.features.load import load_network
from vnca.io.mesh import Mesh, read_mesh
from vnca.io.picture import read_style, style_array
from vnca.io.smoke_format import UpAxis
from vnca.painting.block import KIND
from vnca.recipe.grafting import graft
from vnca.recipe.options import distributed
from vnca.recipe.recorded import IN_MEMORY
from vnca.recipe.session import (
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
from vnca.rule.model import Model
from vnca.training.checkpoint import Checkpoint, fingerprints
from vnca.training.memory import memory_budget
from vnca.training.presets import DEFAULT
from vnca.training.presets import preset as preset_of
from vnca.training.texture_config import TextureConfig
from vnca.training.texture_trainer import texture_trainer

COMMAND = "texture train"


@dataclass(frozen=True, kw_only=True)
class TextureRun(TrainingOptions):
    """A training of a solid texture from one picture."""

    style: Path
    """The picture: PNG, JPEG, WebP, OpenEXR, … (docs/guide/formats.md lists them)."""
    mesh: Path | None = None
    """Look at this mesh too while training: GLB, OBJ, PLY or STL."""
    up_axis: UpAxis | None = None
    """The mesh's up axis; y for OBJ and GLB, z for PLY and STL unless given."""
    preset: str = DEFAULT
    """Values of all hyperparameters that are not given: draft, standard, or a TOML file."""
    config: TextureConfig = field(default_factory=TextureConfig)
    """Hyperparameters."""


@dataclass(frozen=True, kw_only=True)
class ResumeTextureRun(ResumeOptions):
    """What may be asked when a training of a texture is resumed."""

    style: Path | None = None
    """The picture, if it is no longer where it was."""
    mesh: Path | None = None
    """The mesh, if it is no longer where it was."""


def texture(
    style: str | Path | AnyArray,
    *,
    out: str | Path | None = None,
    mesh: str | Path | None = None,
    up_axis: UpAxis | None = None,
    preset: str | Path = DEFAULT,
    overwrite: bool = False,
    preview_every: int = 50,
    device: str = "auto",
    memory_budget: str = "auto",
    watch: Watch = SILENT,
    **options: Any,
) -> Model:
    """Learn a solid texture from one picture, as `vnca texture train` does.

    Args:
        style: A picture file, or an array `[r, c, 3]` of linear RGB from 0 to 1.
        out: Folder for the model, checkpoints, previews and loss curves; nothing is written unless
            given.
        mesh: A mesh file to look at, too, while training.
        up_axis: The mesh's; y for OBJ and GLB, z for PLY and STL unless given.
        preset: `draft` takes minutes, `standard` hours; or the path of a TOML file.
        overwrite: Replace the run that `out` holds.
        preview_every: Iterations between preview pictures.
        device: `auto`, `cpu` or `cuda`.
        memory_budget: Memory for the program, such as `12GB`.
        watch: Is told how far it has come, and may cancel.
        **options: Fields of `TextureConfig`, in the place of the preset's.

    Raises:
        VncaError: If an input cannot be used, the folder cannot be written, training diverges, or
            memory runs out.
    """
    (config,) = distributed(options, preset_of(TextureConfig, preset))
    is_file = isinstance(style, (str, Path))
    asked = TextureRun(
        style=Path(style) if is_file else IN_MEMORY,
        out=None if out is None else Path(out),
        mesh=None if mesh is None else Path(mesh),
        up_axis=up_axis,
        preset=str(preset),
        overwrite=overwrite,
        preview_every=preview_every,
        device=device,
        memory_budget=memory_budget,
        config=config,
    )
    return run(asked, watch, picture=None if is_file else style_array(style))


def run(
    options: TextureRun,
    watch: Watch,
    *,
    checkpoint: Checkpoint | None = None,
    picture: FloatArray | None = None,
) -> Model:
    """Train as asked, or go on from a checkpoint.

    Args:
        options: What is asked.
        watch: Is told how far it has come.
        checkpoint: Where the training was left.
        picture: The style picture, linear RGB `[r, c, 3]`, if it need not be read.

    Raises:
        VncaError: If an input cannot be used, the run folder cannot be written, training
            diverges, or memory runs out.
    """
    folder = run_folder(options.out, overwrite=options.overwrite, checkpoint=checkpoint)
    style = read_style(options.style) if picture is None else picture
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
    has_begun = checkpoint is not None and bool(checkpoint.training)
    started_from = graft(trainer, config.graft, style, watch, goes_on=has_begun)
    training = {
        "kind": KIND,
        "style": options.style.name,
        "mesh": options.mesh.name if options.mesh else None,
        "graft": started_from,
        "preset": Path(options.preset).name,
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
        asked=asked(TextureRun, options),
        preview_every=options.preview_every,
        watch=watch,
    )
    return session.run(checkpoint)


def resume_run(
    options: ResumeTextureRun, watch: Watch, *, picture: FloatArray | None = None
) -> Model:
    """Go on with a training, if there is something left to do; see `run` for the arguments.

    Raises:
        VncaError: If there is no checkpoint, an input changed, or as `run` says.
    """
    left = interrupted(COMMAND, TextureRun, options, watch)
    if left is None:
        return Model.load(options.resume)
    begun, checkpoint = left
    return run(begun, watch, checkpoint=checkpoint, picture=picture)


def _surfaces(mesh: Mesh | None) -> list[AnyArray]:
    """What training sees of a mesh."""
    surfaces = [] if mesh is None else mesh.surfaces
    return [array for surface in surfaces for array in (surface.points, surface.faces)]
