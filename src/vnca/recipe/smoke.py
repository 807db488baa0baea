"""Training on smoke as it gives good pictures: first a solid texture, then a frame of smoke."""

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import OptionError
from vnca.core.files import remove_file
from vnca.core.memory import memory_budget
from vnca.core.records import distributed
from vnca.core.volume import Volume
from vnca.engine.tensors import choose_device, require_equal_runs
from vnca.features import FeatureNetwork, load_network
from vnca.io import SmokeFormat, missing_velocity
from vnca.io.picture import read_style
from vnca.io.smoke_format import NO_VELOCITY
from vnca.recipe import (
    IN_MEMORY,
    SILENT,
    PictureGiven,
    Watch,
    given_pictures,
    load,
    texture,
    told_of_styles,
)
from vnca.recipe.sequence import beside, frames_alone
from vnca.recipe.session import (
    ResumeOptions,
    Session,
    TrainingOptions,
    fitting,
    interrupted,
    run_folder,
)
from vnca.recipe.texture import (
    begin_with_model,
    of_own_scale,
    pretraining_config,
    without_prior_weights,
)
from vnca.rule.mixing import origins
from vnca.rule.model import MODEL_NAME, STYLES_TOLD, Model
from vnca.training.checkpoint import CHECKPOINT_NAME, Checkpoint, fingerprints
from vnca.training.config import SmokeConfig, TextureConfig
from vnca.training.presets import DEFAULT
from vnca.training.presets import preset as preset_of
from vnca.training.styles import shared_out, told_styles
from vnca.training.terms import Term
from vnca.training.trainers import smoke_trainer

COMMAND = "train"
TERMS = "further terms of the loss"
"""Among the inputs of a training that has some."""
TEXTURE_FOLDER = "texture"
"""Folder, in that of a run, of the texture that it begins with."""
TEXTURE_OR_INIT = "`texture`, `init`: one of them, not both"


@dataclass(frozen=True, kw_only=True)
class SmokeRun(TrainingOptions):
    """A training of a rule on one frame of smoke and one picture."""

    frame: Path
    """A frame of smoke: OpenVDB, or npz as Mantaflow writes it."""
    more_frames: tuple[Path, ...] = ()
    """Further frames, of its sequence or of other smoke, that the rule is trained on by turns with
    it: so it paints smoke that it never saw as it paints these."""
    style: Path
    """The picture: PNG, JPEG, WebP, OpenEXR, … (docs/guide/formats.md lists them)."""
    more_styles: tuple[Path, ...] = ()
    """Further pictures, up to eight in all: the rule learns them all and mixes them as it is told
    when it paints (`style_mix`). For K pictures there are √K times as many iterations."""
    preset: str = DEFAULT
    """Values of all hyperparameters that are not given: draft, standard, paper, authors, or a TOML
    file."""
    init: str | None = None
    """A model that is trained already, to begin with instead of training a texture as `texture`
    says: a solid texture of the picture, or a model of smoke, which goes on learning; or the name
    of a style of the library (`vnca styles` lists them)."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: SmokeConfig = field(default_factory=SmokeConfig)
    """Hyperparameters."""


@dataclass(frozen=True, kw_only=True)
class ResumeSmokeRun(ResumeOptions):
    """What may be asked when a training on smoke is resumed."""

    frame: Path | None = None
    """The frame, if it is no longer where it was."""
    more_frames: tuple[Path, ...] | None = None
    """The further frames, if they are no longer where they were."""
    style: Path | None = None
    """The picture, if it is no longer where it was."""
    more_styles: tuple[Path, ...] | None = None
    """The further pictures, if they are no longer where they were."""


def train(
    frame: str | Path | Volume | Sequence[str | Path] | Sequence[Volume],
    style: PictureGiven | Sequence[PictureGiven],
    *,
    out: str | Path | None = None,
    preset: str | Path = DEFAULT,
    init: str | Path | None = None,
    overwrite: bool = False,
    resume: bool = False,
    preview_every: int = 50,
    device: str = "auto",
    memory_budget: str = "auto",
    terms: Sequence[Term] = (),
    watch: Watch = SILENT,
    **options: Any,
) -> Model:
    """Learn from one frame of smoke and one picture how to paint, as `vnca train` does.

    Args:
        frame: A file of smoke, or a volume with velocity in cells a frame; or a list of either, of
            one sequence or of several, which the rule is trained on by turns.
        style: A picture file, or an array `[r, c, 3]` of linear RGB from 0 to 1; or a list of up to
            eight, which the rule learns all.
        out: Folder for the model, checkpoints, previews and loss curves. Unless given, nothing is
            written, and a training that is cancelled is lost.
        preset: `draft` takes minutes, `standard` a night on a laptop; `paper` is the paper's. Or
            the path of a TOML file.
        init: A texture model of the picture to begin with, instead of training one first; or a
            model of smoke, or a style of the library by its name, which goes on learning.
        overwrite: Replace the run that `out` holds.
        resume: Go on with the training that was interrupted in `out`, with the options that it
            began with, or else begin it.
        preview_every: Iterations between preview pictures.
        device: `auto`, `cpu`, `cuda`, or such as `cuda:1`.
        memory_budget: Memory for the program, such as `12GB`.
        terms: Further terms of the loss on smoke, such as one of your own; they are not written
            down, and have to be given again to resume.
        watch: Is told how far it has come, and may cancel.
        **options: Fields of `SmokeFormat` (`velocity_units="mantaflow"`) and of `SmokeConfig`
            (`iterations=400`, `texture=0`, `view={"size": 96}`), in the place of the preset's.

    Raises:
        VncaError: If an input cannot be used, the folder cannot be written, training diverges, or
            memory runs out.
        KeyboardInterrupt: If it is cancelled; the folder holds what it takes to resume.
    """
    if "texture" in options and init is not None:
        raise OptionError(TEXTURE_OR_INIT)
    smoke, config = distributed(options, SmokeFormat(), preset_of(SmokeConfig, preset))
    (at, *more), volumes = _given_frames(frame)
    (first, *others), pictures = given_pictures(style)
    asked = SmokeRun(
        frame=at,
        more_frames=tuple(more),
        style=first,
        more_styles=tuple(others),
        out=None if out is None else Path(out),
        preset=str(preset),
        init=None if init is None else str(init),
        overwrite=overwrite,
        preview_every=preview_every,
        device=device,
        memory_budget=memory_budget,
        smoke=smoke,
        config=config,
    )
    if resume:
        if asked.out is None:
            raise OptionError("`resume`: needs the folder of the training as `out`")
        if (asked.out / CHECKPOINT_NAME).exists() or (asked.out / MODEL_NAME).exists():
            again = ResumeSmokeRun(
                resume=asked.out,
                frame=asked.frame,
                more_frames=asked.more_frames,
                style=asked.style,
                more_styles=asked.more_styles,
                memory_budget=memory_budget,
            )
            return resume_run(again, watch, volumes=volumes, pictures=pictures, terms=terms)
    return run(asked, watch, volumes=volumes, pictures=pictures, terms=terms)


def run(
    options: SmokeRun,
    watch: Watch,
    *,
    checkpoint: Checkpoint | None = None,
    volumes: Sequence[Volume] | None = None,
    pictures: Sequence[FloatArray] | None = None,
    terms: Sequence[Term] = (),
) -> Model:
    """Train as asked, or go on from a checkpoint.

    Args:
        options: What is asked.
        watch: Is told how far it has come.
        checkpoint: Where the training was left.
        volumes: The frames, if they need not be read.
        pictures: The style pictures, linear RGB `[r, c, 3]`, if they need not be read.
        terms: Further terms of the loss on smoke.

    Raises:
        VncaError: If an input cannot be used, the run folder cannot be written, training
            diverges, or memory runs out.
    """
    folder = run_folder(options.out, overwrite=options.overwrite, checkpoint=checkpoint)
    styles = pictures or [read_style(path) for path in (options.style, *options.more_styles)]
    device = choose_device(options.device)
    paths = (options.frame, *options.more_frames)
    smoke_format = options.smoke if volumes is not None else beside(options.frame, options.smoke)
    smoke = frames_alone(paths, smoke_format, watch, volumes)
    config = shared_out(told_styles(options.config, styles), len(styles))
    if len(styles) > 1:
        watch.note(f"{len(styles)} styles: {config.iterations} iterations")
    has_velocity = smoke[0].velocity is not None
    if not has_velocity:
        if smoke_format.velocity_grid != NO_VELOCITY:
            watch.note(f"{missing_velocity(options.frame)}; the rule learns nothing of motion")
        # Or painting would condition it on what training gave no meaning to.
        config = dataclasses.replace(
            config, rule=dataclasses.replace(config.rule, velocity_prior=False)
        )
    require_equal_runs(device)
    network = load_network(config.features, device)
    with fitting(config, "this frame"):
        budget = memory_budget(options.memory_budget)
        trainer = smoke_trainer(
            smoke, styles, config, network, device=device, memory_budget=budget, terms=terms
        )
    training = {
        "frame": ", ".join(path.name for path in paths),
        **told_of_styles((options.style, *options.more_styles), trainer.picture_cells),
        "preset": Path(options.preset).name,
        "seed": config.seed,
        "device": str(device),
        "smoke": dataclasses.asdict(smoke_format),
    }
    session = Session.begun(
        dataclasses.replace(options, smoke=smoke_format),
        SmokeRun,
        COMMAND,
        trainer,
        network,
        folder=folder,
        styles=styles,
        training=training,
        inputs=training_inputs(smoke, styles, config, network, terms),
        watch=watch,
    )
    if checkpoint is None or not checkpoint.training:
        if checkpoint is not None:
            checkpoint.require(session.inputs, folder.checkpoint_path)
        texture_config = pretraining_config(options.config, trainer.picture_cells[0])
        if options.init is not None:
            begin_with_model(trainer, options.init)
        elif texture_config is not None:
            if checkpoint is None and options.overwrite and options.out is not None:
                # Resuming must not take the texture of the run that was there for this one's.
                remove_file(options.out / TEXTURE_FOLDER / MODEL_NAME)
            folder.reserve(Checkpoint({}, session.inputs, COMMAND, session.asked))
            if len(styles) > 1 and config.appearance.style_scale is None:
                texture_config = of_own_scale(texture_config)
            model = _texture(options, texture_config, styles, watch, goes_on=checkpoint is not None)
            trainer.begin_with(without_prior_weights(model.rule), origins(model))
        checkpoint = None
    notes = []
    if config.motion.weight and has_velocity and not trainer.teaches_motion:
        notes.append(f"{options.frame}: nothing moves in it; its texture is not taught to move")
    model = session.run(checkpoint, *notes)
    inputs = {
        "frame": options.frame if volumes is None else volumes[0],
        "style": options.style if pictures is None else pictures[0],
    }
    if options.more_styles:
        inputs[STYLES_TOLD] = pictures or (options.style, *options.more_styles)
    return dataclasses.replace(model, inputs=inputs)


def _given_frames(
    frame: str | Path | Volume | Sequence[str | Path] | Sequence[Volume],
) -> tuple[list[Path], list[Volume] | None]:
    """The paths of frames, and the frames themselves if they come from no files.

    Raises:
        OptionError: If there is none, or if just some come from files.
    """
    several = [frame] if isinstance(frame, (str, Path, Volume)) else [*frame]
    volumes = [each for each in several if isinstance(each, Volume)]
    if not several or len(volumes) not in (0, len(several)):
        raise OptionError("`frame`: expected files or volumes, not both")
    if volumes:
        return [IN_MEMORY] * len(volumes), volumes
    return [Path(each) for each in several if not isinstance(each, Volume)], None


def training_inputs(
    smoke: Sequence[Volume],
    style: FloatArray | Sequence[FloatArray],
    config: SmokeConfig,
    network: FeatureNetwork,
    terms: Sequence[Term] = (),
) -> dict[str, str]:
    """What tells a training on smoke from others: the `fingerprints` of what goes into it."""
    first, *others = ([*_told(frame)] for frame in smoke)
    further = {"further frames": [array for told in others for array in told]} if others else {}
    inputs = fingerprints(style, config, network, frame=first, **further)
    return inputs | ({TERMS: ", ".join(term.name for term in terms)} if terms else {})


def _told(frame: Volume) -> Iterator[AnyArray | tuple[int, ...]]:
    """What a rule may be told of a frame."""
    yield from (frame.density, frame.origin)
    if frame.velocity is not None:
        yield frame.velocity


def _texture(
    options: SmokeRun,
    config: TextureConfig,
    styles: Sequence[FloatArray],
    watch: Watch,
    *,
    goes_on: bool,
) -> Model:
    """The texture to begin with, from the folder in the run's where it is, or may be already."""
    pictures = styles if IN_MEMORY in (options.style, *options.more_styles) else None
    out = None if options.out is None else options.out / TEXTURE_FOLDER
    asked = texture.TextureRun(
        style=options.style,
        more_styles=options.more_styles,
        config=config,
        out=out,
        overwrite=options.overwrite or goes_on,
        preview_every=options.preview_every,
        device=options.device,
        memory_budget=options.memory_budget,
    )
    if out is None:
        watch.note("first, a solid texture")
        return texture.run(asked, watch, pictures=pictures)
    watch.note(f"first, a solid texture: {out}")
    try:
        if goes_on and (out / CHECKPOINT_NAME).exists():
            again = texture.ResumeTextureRun(
                resume=out,
                style=options.style,
                more_styles=options.more_styles,
                memory_budget=options.memory_budget,
            )
            texture.resume_run(again, watch, pictures=pictures)
        elif not (goes_on and (out / MODEL_NAME).exists()):
            texture.run(asked, watch, pictures=pictures)
    except KeyboardInterrupt:
        watch.note(f"to go on with all of it: vnca {COMMAND} `resume` {options.out}")
        raise
    return Model.load(out)


def resume_run(
    options: ResumeSmokeRun,
    watch: Watch,
    *,
    volumes: Sequence[Volume] | None = None,
    pictures: Sequence[FloatArray] | None = None,
    terms: Sequence[Term] = (),
) -> Model:
    """Go on with a training, if there is something left to do; see `run` for the arguments.

    Raises:
        VncaError: If there is no checkpoint, an input changed, or as `run` says.
    """
    left = interrupted(COMMAND, SmokeRun, options, watch)
    if left is None:
        return load(options.resume)
    begun, checkpoint = left
    return run(begun, watch, checkpoint=checkpoint, volumes=volumes, pictures=pictures, terms=terms)
