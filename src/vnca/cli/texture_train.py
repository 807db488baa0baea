"""`vnca texture train STYLE --out RUN`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import torch
import tyro

from vnca.automaton.model import Model
from vnca.cli.options import chosen, parse, say
from vnca.cli.progress import Progress
from vnca.cli.texture_block import KIND
from vnca.cli.train import THUMBNAIL, choose_device
from vnca.errors import OptionError
from vnca.features.vgg import VGG16
from vnca.io.image import fit, read_image, to_srgb8
from vnca.io.mesh import read_mesh
from vnca.io.orientation import UpAxis
from vnca.texturing.config import PRESETS, TextureConfig
from vnca.texturing.loop import TextureTrainer
from vnca.texturing.preview import preview_sheet
from vnca.texturing.scene import BlockScene
from vnca.training.run import RunFolder
from vnca.typing import FloatArray


@dataclass(frozen=True)
class TrainTexture:
    """Learn a solid texture from one picture."""

    style: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STYLE")]
    """The picture: PNG, JPEG or WebP."""
    out: Path
    """Folder of the run: model, configuration, previews and loss curves."""
    mesh: Path | None = None
    """Look at this mesh too while training: GLB, OBJ, PLY or STL."""
    up_axis: UpAxis | None = None
    """The mesh's up axis; y for OBJ and GLB, z for PLY and STL unless given."""
    preset: Literal["draft", "standard"] = "draft"
    """Values of all options below that are not given."""
    overwrite: bool = False
    """Replace the model of an earlier run in the same folder."""
    preview_every: int = 50
    """Iterations between preview pictures, at which the model is saved too."""
    device: str = "auto"
    """Where to compute: auto, cpu or cuda."""
    config: Annotated[TextureConfig, tyro.conf.arg(name="")] = field(default_factory=TextureConfig)
    """Hyperparameters."""

    def __post_init__(self) -> None:
        if self.preview_every < 1:
            raise OptionError(f"--preview-every {self.preview_every}: at least 1 is needed")


def run(arguments: Sequence[str]) -> None:
    """Read the options and train."""
    preset = chosen(arguments, "--preset", "draft")
    missing: Any = tyro.MISSING
    defaults = TrainTexture(missing, missing, config=PRESETS.get(preset, TextureConfig()))
    train(parse("texture train", TrainTexture, arguments, default=defaults))


def train(options: TrainTexture) -> Path:
    """Train as asked and return the folder of the run.

    Raises:
        VncaError: If an input cannot be used or the run folder cannot be written.
    """
    run_folder = RunFolder(options.out, overwrite=options.overwrite)
    style = read_image(options.style)
    device = choose_device(options.device)
    mesh = read_mesh(options.mesh, options.up_axis) if options.mesh else None
    config = options.config
    torch.use_deterministic_algorithms(True)
    vgg = VGG16.load(config.features, device)
    scene = BlockScene(config.block, config.slices, mesh=mesh, device=device)
    trainer = TextureTrainer(scene, style, config, vgg)
    training = {
        "kind": KIND,
        "style": options.style.name,
        "mesh": options.mesh.name if options.mesh else None,
        "preset": options.preset,
        "block": config.block,
        "seed": config.seed,
        "device": str(device),
        "features": vgg.name,
        "features_origin": vgg.origin,
        "features_dtype": str(vgg.dtype).removeprefix("torch."),
    }
    with run_folder as folder:
        asked: Any = config  # the folder only asks for its fields
        folder.start(asked, training)
        say(
            f"{len(scene.domain)} cells, {trainer.rule().weight_count} weights, "
            f"features '{vgg.name}', {device}"
        )
        _improve(trainer, options, folder, style, training)
    return options.out


def _improve(
    trainer: TextureTrainer,
    options: TrainTexture,
    folder: RunFolder,
    style: FloatArray,
    training: dict[str, Any],
) -> None:
    """Iterate to the end or to Ctrl-C; either way the folder holds a usable model."""
    thumbnail = to_srgb8(fit(style, THUMBNAIL, THUMBNAIL))

    def keep() -> None:
        provenance = {**training, "iterations": trainer.iteration}
        folder.save(Model(trainer.rule(), provenance, thumbnail))
        folder.preview(preview_sheet(trainer, style), trainer.iteration)

    total = options.config.iterations
    with Progress("training", total, "iterations") as progress:
        try:
            for step in trainer.run():
                logged: Any = step  # the folder only asks for its fields
                folder.log(logged, trainer.learning_rate)
                progress.show(step.iteration, f"loss {step.loss:.2f}")
                if step.iteration % options.preview_every == 0 or step.iteration == total:
                    keep()
        except KeyboardInterrupt:
            keep()
            say(f"stopped at iteration {trainer.iteration}; the model so far is in {folder.path}")
            raise
    say(f"model: {folder.path}")
