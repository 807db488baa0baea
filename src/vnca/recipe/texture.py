"""Training of a texture from one picture: for itself, or to begin training on smoke with.

On smoke a rule learns first what the priors offer: a colour for each density and velocity, and
grain. In a block, where nothing tells cells apart, it has to learn patterns; from there it goes
on drawing them on smoke. A training may also start from a rule that was trained before.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.colour import linear_to_srgb
from vnca.core.errors import OptionError
from vnca.core.memory import memory_budget
from vnca.core.records import distributed
from vnca.engine.automaton import FILTERS
from vnca.engine.tensors import choose_device, require_equal_runs
from vnca.features import load_network
from vnca.io.mesh import Mesh, read_mesh
from vnca.io.picture import read_style
from vnca.io.smoke_format import UpAxis
from vnca.painting.block import KIND
from vnca.painting.flat import without_depth
from vnca.recipe import SILENT, PictureGiven, Watch, given_pictures, told_of_styles
from vnca.recipe.session import (
    ResumeOptions,
    Session,
    TrainingOptions,
    fitting,
    interrupted,
    run_folder,
)
from vnca.rule import Rule
from vnca.rule.conditioning import STYLES
from vnca.rule.library import nearest_style, style_or_model
from vnca.rule.mixing import origins
from vnca.rule.model import Model
from vnca.rule.styles import in_style
from vnca.training.checkpoint import Checkpoint, fingerprints
from vnca.training.config import SmokeConfig, TextureConfig
from vnca.training.loop import Trainer
from vnca.training.motion_field import motion_asked, told_of_motion, with_motion
from vnca.training.presets import DEFAULT
from vnca.training.presets import preset as preset_of
from vnca.training.styles import shared_out, told_styles
from vnca.training.trainers import texture_trainer

AUTO = "auto"
"""In the place of the name of a style: the nearest to the picture."""
SHAPE = ("channels", "hidden", "update_probability", "sobel_divisor", "laplacian_divisor")
"""In what a rule must be like the texture that it begins with."""
LARGEST_PICTURE = 128
"""Cells along the shorter side of the picture, at most: its patterns are to fit the block."""
STEADY = 0.2
"""Part of the steadiness of smoke that a texture is taught: with all of it a texture keeps what it
began with, and in few iterations it stays pale; with none, smoke teaches too little of it."""


def pretraining_config(config: SmokeConfig, picture: float) -> TextureConfig | None:
    """How the texture is trained for a training on smoke, or None if it is not to be.

    Args:
        config: The training on smoke. The rule is as large, and the picture in cells too; it is
            compared with by the same terms.
        picture: Cells along its shorter side, as the smoke is shown it.
    """
    iterations = round(config.texture * config.iterations)
    if iterations == 0:
        return None
    plain = preset_of(TextureConfig, DEFAULT)
    picture = min(picture, LARGEST_PICTURE)
    return dataclasses.replace(
        plain,
        rule=dataclasses.replace(
            config.rule, position_prior=False, density_prior=False, velocity_prior=False
        ),
        appearance=dataclasses.replace(
            config.appearance,
            grey=plain.appearance.grey,
            style_scale=picture / plain.slice.cells,
        ),
        decoder=config.decoder,
        graft=config.graft,
        iterations=iterations,
        steadiness=STEADY * config.steadiness,
        features=config.features,
        backend=config.backend,
        seed=config.seed,
    )


def of_own_scale(config: TextureConfig) -> TextureConfig:
    """The same with every picture as wide as its own strokes ask for."""
    appearance = dataclasses.replace(config.appearance, style_scale=None)
    return dataclasses.replace(config, appearance=appearance)


def without_prior_weights(rule: Rule, conditioning: Sequence[str] | None = None) -> Rule:
    """The rule with no weight on any prior: a texture has had none to learn what they mean.

    It keeps what it has learnt of as many styles; a rule of one begins with all of them alike.

    Args:
        rule: A texture.
        conditioning: What the rule is to be conditioned on; as it is unless given.
    """
    config = rule.config
    if conditioning is not None:
        config = dataclasses.replace(config, conditioning=tuple(conditioning))
    if rule.config.style_count != config.style_count:
        rule = in_style(rule)
    perceived = FILTERS * config.channels
    hidden = np.zeros((config.hidden, config.inputs), np.float32)
    hidden[:, :perceived] = rule.hidden[:, :perceived]
    if count := rule.config.style_count:
        hidden[:, -count:] = rule.hidden[:, -count:]
    return dataclasses.replace(rule, hidden=hidden, config=config)


def begin_with_model(trainer: Trainer, name: str) -> None:
    """Let a training on smoke begin with a model.

    A rule of smoke keeps what it has learnt of priors; a texture has had none.

    Args:
        trainer: Before its first iteration.
        name: Of a style of the library, or the path of the model or of the folder of its run.

    Raises:
        VncaError: If it cannot be read, or is a rule of another shape.
    """
    model, wanted = style_or_model(name, "init"), trainer.rule()
    rule, its = model.rule, model.rule.config
    misfit = _misfit(rule, wanted)
    if misfit is not None:
        raise OptionError(f"`init` {name}: {misfit}")
    known = (name for name in its.conditioning if name not in STYLES)
    knows_smoke = any(map(its.is_conditioned_on, known))
    if not (knows_smoke and its.conditioning == wanted.config.conditioning):
        rule = without_prior_weights(rule, wanted.config.conditioning)
    trainer.begin_with(rule, origins(model))


def _misfit(rule: Rule, wanted: Rule) -> str | None:
    """In what a rule is shaped otherwise than another, if it is."""
    for name in SHAPE:
        its, ours = (getattr(r.config, name) for r in (rule, wanted))
        if its != ours:
            return f"was trained with `{name}` {its:g}; add that, in place of {ours:g}"
    its, ours = (r.decoder.units if r.decoder is not None else 0 for r in (rule, wanted))
    if its != ours:
        return f"was trained with `decoder` {its}; add that, in place of {ours}"
    return None


def graft(
    trainer: Trainer, source: str, style: FloatArray, watch: Watch, *, goes_on: bool
) -> str | None:
    """Let a training of a texture start from the rule of another picture.

    Args:
        trainer: Before its first iteration.
        source: As of `TrainingConfig.graft`.
        style: Linear RGB `[r, c, 3]`, to find the nearest style by.
        watch: Is told what it starts from.
        goes_on: Whether it has started already, and only the name is wanted.

    Returns:
        The name of the rule; None if it starts from nothing.

    Raises:
        VncaError: If the rule asked for cannot be read, or is of another shape.
    """
    wanted = trainer.rule()
    if source == "none":
        return None
    is_auto = source == AUTO
    name = nearest_style(linear_to_srgb(style.clip(0, 1))) if is_auto else source
    model = style_or_model(name, "graft")
    misfit = _misfit(model.rule, wanted)
    if misfit is not None:
        if is_auto:
            watch.note("no style of the library has such a rule; training starts from nothing")
            return None
        raise OptionError(f"`graft` {name}: {misfit}")
    name = Path(name).name
    if not goes_on:
        watch.note(f"starting from the rule of {name}")
        rule = without_prior_weights(model.rule, wanted.config.conditioning)
        if trainer.scene.dimensions == 2:
            rule = without_depth(rule)
        trainer.begin_with(rule, origins(model))
    return name


COMMAND = "texture train"


@dataclass(frozen=True, kw_only=True)
class TextureRun(TrainingOptions):
    """A training of a texture from one picture."""

    style: Path
    """The picture: PNG, JPEG, WebP, OpenEXR, … (docs/guide/formats.md lists them)."""
    more_styles: tuple[Path, ...] = ()
    """Further pictures, up to eight in all: the rule learns them all and mixes them as it is told
    when it paints (`style_mix`). For K pictures there are √K times as many iterations."""
    mesh: Path | None = None
    """Look at this mesh too while training: GLB, OBJ, PLY or STL."""
    up_axis: UpAxis | None = None
    """The mesh's up axis; y for OBJ and GLB, z for PLY and STL unless given."""
    motion_field: str | None = None
    """How a flat texture (`dimensions` 2) is to move: circular, hyperbolic, … by name, a file of
    vectors (.npy, .flo, .exr), or a film whose mean motion is taken."""
    preset: str = DEFAULT
    """Values of all hyperparameters that are not given: draft, standard, or a TOML file."""
    config: TextureConfig = field(default_factory=TextureConfig)
    """Hyperparameters."""


@dataclass(frozen=True, kw_only=True)
class ResumeTextureRun(ResumeOptions):
    """What may be asked when a training of a texture is resumed."""

    style: Path | None = None
    """The picture, if it is no longer where it was."""
    more_styles: tuple[Path, ...] | None = None
    """The further pictures, if they are no longer where they were."""
    mesh: Path | None = None
    """The mesh, if it is no longer where it was."""
    motion_field: str | None = None
    """The file of the motion field, if it is no longer where it was."""


def texture(
    style: PictureGiven | Sequence[PictureGiven],
    *,
    out: str | Path | None = None,
    mesh: str | Path | None = None,
    up_axis: UpAxis | None = None,
    motion_field: str | None = None,
    preset: str | Path = DEFAULT,
    overwrite: bool = False,
    preview_every: int = 50,
    device: str = "auto",
    memory_budget: str = "auto",
    watch: Watch = SILENT,
    **options: Any,
) -> Model:
    """Learn a texture from one picture, solid or flat, as `vnca texture train` does.

    Args:
        style: A picture file, or an array `[r, c, 3]` of linear RGB from 0 to 1; or a list of up to
            eight, which the rule learns all.
        out: Folder for the model, checkpoints, previews and loss curves; nothing is written unless
            given.
        mesh: A mesh file to look at, too, while training.
        up_axis: The mesh's; y for OBJ and GLB, z for PLY and STL unless given.
        motion_field: How a flat texture (`dimensions=2`) is to move: a name, such as circular, a
            file of vectors, or a film.
        preset: `draft` takes minutes, `standard` hours; or the path of a TOML file.
        overwrite: Replace the run that `out` holds.
        preview_every: Iterations between preview pictures.
        device: `auto`, `cpu`, `cuda`, or such as `cuda:1`.
        memory_budget: Memory for the program, such as `12GB`.
        watch: Is told how far it has come, and may cancel.
        **options: Fields of `TextureConfig`, in the place of the preset's.

    Raises:
        VncaError: If an input cannot be used, the folder cannot be written, training diverges, or
            memory runs out.
    """
    (config,) = distributed(options, preset_of(TextureConfig, preset))
    (first, *others), pictures = given_pictures(style)
    asked = TextureRun(
        style=first,
        more_styles=tuple(others),
        out=None if out is None else Path(out),
        mesh=None if mesh is None else Path(mesh),
        up_axis=up_axis,
        motion_field=motion_field,
        preset=str(preset),
        overwrite=overwrite,
        preview_every=preview_every,
        device=device,
        memory_budget=memory_budget,
        config=config,
    )
    return run(asked, watch, pictures=pictures)


def run(
    options: TextureRun,
    watch: Watch,
    *,
    checkpoint: Checkpoint | None = None,
    pictures: Sequence[FloatArray] | None = None,
) -> Model:
    """Train as asked, or go on from a checkpoint.

    Args:
        options: What is asked.
        watch: Is told how far it has come.
        checkpoint: Where the training was left.
        pictures: The style pictures, linear RGB `[r, c, 3]`, if they need not be read.

    Raises:
        VncaError: If an input cannot be used, the run folder cannot be written, training
            diverges, or memory runs out.
    """
    folder = run_folder(options.out, overwrite=options.overwrite, checkpoint=checkpoint)
    styles = pictures or [read_style(path) for path in (options.style, *options.more_styles)]
    device = choose_device(options.device)
    mesh = read_mesh(options.mesh, options.up_axis) if options.mesh else None
    config = shared_out(told_styles(options.config, styles), len(styles))
    motion = motion_asked(config, options.motion_field)
    config = with_motion(config, motion)
    if mesh is not None and config.dimensions == 2:
        raise OptionError(f"`mesh` {options.mesh}: a flat texture is not seen on meshes")
    if len(styles) > 1:
        watch.note(f"{len(styles)} styles: {config.iterations} iterations")
    require_equal_runs(device)
    network = load_network(config.features, device)
    with fitting(config, "this block"):
        budget = memory_budget(options.memory_budget)
        trainer = texture_trainer(
            styles,
            config,
            network,
            mesh=mesh,
            motion_field=motion,
            device=device,
            memory_budget=budget,
        )
    has_begun = checkpoint is not None and bool(checkpoint.training)
    started_from = graft(trainer, config.graft, styles[0], watch, goes_on=has_begun)
    training = {
        "kind": KIND,
        **told_of_styles((options.style, *options.more_styles), trainer.picture_cells),
        "mesh": options.mesh.name if options.mesh else None,
        "graft": started_from,
        "preset": Path(options.preset).name,
        "block": config.block,
        **told_of_motion(config, motion),
        "seed": config.seed,
        "device": str(device),
    }
    session = Session.begun(
        options,
        TextureRun,
        COMMAND,
        trainer,
        network,
        folder=folder,
        styles=styles,
        training=training,
        inputs=fingerprints(
            styles,
            config,
            network,
            mesh=_surfaces(mesh),
            **({} if motion is None else {"motion field": [motion.velocity(32, 32, 1.0)]}),
        ),
        watch=watch,
    )
    return session.run(checkpoint)


def resume_run(
    options: ResumeTextureRun, watch: Watch, *, pictures: Sequence[FloatArray] | None = None
) -> Model:
    """Go on with a training, if there is something left to do; see `run` for the arguments.

    Raises:
        VncaError: If there is no checkpoint, an input changed, or as `run` says.
    """
    left = interrupted(COMMAND, TextureRun, options, watch)
    if left is None:
        return Model.load(options.resume)
    begun, checkpoint = left
    return run(begun, watch, checkpoint=checkpoint, pictures=pictures)


def _surfaces(mesh: Mesh | None) -> list[AnyArray]:
    """What training sees of a mesh."""
    surfaces = [] if mesh is None else mesh.surfaces
    return [array for surface in surfaces for array in (surface.points, surface.faces)]
