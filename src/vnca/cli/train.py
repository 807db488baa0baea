"""`vnca train FRAME STYLE --out RUN`."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import torch
import tyro

from vnca.automaton.model import Model
from vnca.cli.options import chosen, parse, say
from vnca.cli.progress import Progress
from vnca.cli.sequence import beside
from vnca.errors import GridError, OptionError
from vnca.features.vgg import VGG16
from vnca.io.image import read_image, resize, to_srgb8
from vnca.io.smoke import SmokeFormat, read_smoke
from vnca.training.config import PRESETS, TrainConfig
from vnca.training.loop import Trainer
from vnca.training.preview import preview_sheet
from vnca.training.run import RunFolder
from vnca.typing import FloatArray

THUMBNAIL = 96
"""Rows and columns of the style picture kept in a model file."""


@dataclass(frozen=True)
class Train:
    """Learn a rule from one frame of smoke and one picture."""

    frame: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FRAME")]
    """A frame of smoke: OpenVDB, or npz as Mantaflow writes it."""
    style: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STYLE")]
    """The picture: PNG, JPEG or WebP."""
    out: Path
    """Folder of the run: model, configuration, previews and loss curves."""
    preset: Literal["draft", "standard", "paper"] = "draft"
    """Values of all options below that are not given."""
    overwrite: bool = False
    """Replace the model of an earlier run in the same folder."""
    preview_every: int = 50
    """Iterations between preview pictures, at which the model is saved too."""
    device: str = "auto"
    """Where to compute: auto, cpu or cuda."""
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: Annotated[TrainConfig, tyro.conf.arg(name="")] = field(default_factory=TrainConfig)
    """Hyperparameters."""

    def __post_init__(self) -> None:
        if self.preview_every < 1:
            raise OptionError(f"--preview-every {self.preview_every}: at least 1 is needed")


def run(arguments: Sequence[str]) -> None:
    """Read the options and train."""
    preset = chosen(arguments, "--preset", "draft")
    missing: Any = tyro.MISSING
    defaults = Train(
        frame=missing, style=missing, out=missing, config=PRESETS.get(preset, TrainConfig())
    )
    train(parse("train", Train, arguments, default=defaults))


def train(options: Train) -> Path:
    """Train as asked and return the path of the model.

    Raises:
        VncaError: If an input cannot be used or the run folder cannot be written.
    """
    run_folder = RunFolder(options.out, overwrite=options.overwrite)
    style = read_image(options.style)
    device = choose_device(options.device)
    smoke_format = beside(options.frame, options.smoke)
    smoke = read_smoke(options.frame, smoke_format)
    if not smoke.density.any():
        raise GridError(
            f"{options.frame}: there is no smoke in this frame to train on; choose a later one"
        )
    torch.use_deterministic_algorithms(True)
    vgg = VGG16.load(options.config.features, device)
    trainer = Trainer(smoke, style, options.config, vgg, device=device)
    training = {
        "frame": options.frame.name,
        "style": options.style.name,
        "preset": options.preset,
        "seed": options.config.seed,
        "device": str(device),
        "smoke": dataclasses.asdict(smoke_format),
        "features": vgg.name,
        "features_origin": vgg.origin,
        "features_dtype": str(vgg.dtype).removeprefix("torch."),
    }
    with run_folder as folder:
        folder.start(options.config, training)
        say(
            f"{len(trainer.scene.domain)} cells, {trainer.rule().weight_count} weights, "
            f"features '{vgg.name}', {device}"
        )
        _improve(trainer, options, folder, style, training)
    return options.out


def _improve(
    trainer: Trainer, options: Train, folder: RunFolder, style: FloatArray, training: dict[str, Any]
) -> None:
    """Iterate to the end or to Ctrl-C; either way the folder holds a usable model."""

    def keep() -> None:
        provenance = {**training, "iterations": trainer.iteration}
        folder.save(Model(trainer.rule(), provenance, _small(style)))
        folder.preview(preview_sheet(trainer, style), trainer.iteration)

    total = options.config.iterations
    with Progress("training", total, "iterations") as progress:
        try:
            for step in trainer.run():
                folder.log(step, trainer.learning_rate)
                progress.show(step.iteration, f"loss {step.loss:.2f}")
                if step.iteration % options.preview_every == 0 or step.iteration == total:
                    keep()
        except KeyboardInterrupt:
            keep()
            say(f"\nstopped at iteration {trainer.iteration}; the model so far is in {folder.path}")
            raise
    say(f"model: {folder.path}")


def _small(style: FloatArray) -> Any:
    rows, columns = style.shape[:2]
    factor = min(1.0, THUMBNAIL / max(rows, columns))
    size = max(1, round(rows * factor)), max(1, round(columns * factor))
    return to_srgb8(resize(style, *size))


def choose_device(name: str) -> torch.device:
    """The device of a name; `auto` takes a GPU where there is one.

    Raises:
        OptionError: If there is no such device.
    """
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    try:
        device = torch.device(name)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        raise OptionError(f"--device {name}: not available here; use auto or cpu") from error
    if device.type not in ("cpu", "cuda"):
        raise OptionError(f"--device {name}: expected auto, cpu or cuda")
    return device
