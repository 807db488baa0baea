"""A sequence in the style of a picture in one go: training, painting and a film."""

import dataclasses
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal, TypeAlias

import vnca
from vnca.core.errors import OptionError, OutputError
from vnca.core.files import whole_file, writable_folder
from vnca.core.records import changed, changed_fields, distributed, fields_of
from vnca.direction import Direction
from vnca.direction.shot import SUFFIX as SHOT
from vnca.direction.shot import Shot
from vnca.io import SmokeFormat, read_smoke
from vnca.io.film import usual_suffix
from vnca.io.sequence import Frame, FrameSequence
from vnca.painting import StylizeConfig
from vnca.painting.chunk import Chunking
from vnca.ranks import Alone, Ranks
from vnca.recipe import SILENT, Watch, first_difference, painting, recorded, recorded_smoke
from vnca.recipe.film import FilmConfig, require_velocity
from vnca.recipe.rendering import CELL_OPACITY
from vnca.recipe.sequence import fullest_frame, open_sequence
from vnca.rule.library import load_style, require_style
from vnca.rule.model import MODEL_NAME, Model

COMMAND = "paint"
RUN, PAINTED, FILM = "run", "painted", "film"
"""In the folder: the run of the training, the painted frames and their film, without its suffix."""
ASKED_NAME = "paint.json"
"""In the folder: what was asked for, to go on with nothing else."""
MODEL_SUFFIX = ".safetensors"
_OF_TRAINING = ("preset", "training_frame", "memory_budget")
_ANY_TIME = ("out", "resume", "overwrite", "device", "memory_budget", "without_film", "only")
Part: TypeAlias = Literal["train", "paint", "film"]


@dataclass(frozen=True, kw_only=True)
class PaintRun:
    """A sequence painted in the style of a picture, and filmed."""

    sequence: str
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    picture: Path | None = None
    """The picture to learn from: PNG, JPEG, WebP, OpenEXR, …; or a model that has learned already,
    a file or the folder of a run."""
    style: str | None = None
    """A style of the library in the place of a picture: it paints at once, without training."""
    out: Path
    """Folder for all of it: run, painted and film.mp4; film.webp where PyAV is not installed."""
    preset: str = "draft"
    """How the rule is trained: draft, standard, paper, or a TOML file."""
    training_frame: int | None = None
    """Number of the frame that is trained on; one with much smoke unless given."""
    frames: str | None = None
    """Frames to paint, such as 30-53 or 1,4,7-9; all unless given."""
    refine: int = 2
    """Paint on a grid so many times as fine as that of the smoke, at most 8."""
    seed: int = 0
    """Same seed, same machine, same painting."""
    device: str = "auto"
    """Where: auto, cpu, cuda, or as cuda:1."""
    memory_budget: str = "auto"
    """Memory for the training, such as 12GB; auto takes what is free."""
    resume: bool = False
    """Go on where an earlier call was interrupted, with the same options."""
    overwrite: bool = False
    """Replace what an earlier call left in the folder."""
    without_film: bool = False
    """Paint only, without a film of it."""
    only: Part | None = None
    """Do only this part of it: train, paint, or film what is painted. A farm does each on a machine
    of its own."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    direction: Direction = field(default_factory=Direction)
    """What is asked of the painting."""
    film: FilmConfig = field(default_factory=FilmConfig)
    """How the painting is filmed."""
    chunking: Chunking = field(default_factory=Chunking)
    """Which of the frames are painted, apart from the others."""

    def __post_init__(self) -> None:
        if self.without_film and (shaped := changed_fields(self.film, FilmConfig())):
            raise OptionError(f"`film.{shaped[0]}`, `without_film`: one of them, not both")
        part = changed_fields(self.chunking, Chunking())
        if part and self.only != "paint":
            raise OptionError(f"`{part[0]}`: needs `only` paint, as a chunk is no whole film")
        if self.only == "film" and self.without_film:
            raise OptionError("`only` film, `without_film`: one of them, not both")
        if self.style is not None:
            require_style(self.style)
        if self.resume and self.overwrite:
            raise OptionError("`resume`, `overwrite`: one of them, not both")
        idle = [n for n in _OF_TRAINING if getattr(self, n) != getattr(PaintRun, n)]
        if idle and self.is_trained:
            raise OptionError(f"`{idle[0]}`: {self.name} is a model, which is trained already")
        if self.only == "train" and self.is_trained:
            raise OptionError(f"`only` train: {self.name} is a model, which is trained already")

    def require_one_style(self) -> None:
        """Refuse two pictures to paint by, and none.

        Raises:
            OptionError: If there is not one.
        """
        if (self.picture is None) == (self.style is None):
            raise OptionError("`picture`, `style`: expected one of them")

    @property
    def is_trained(self) -> bool:
        """Whether a model is given rather than a picture."""
        path = self.picture
        if path is None:
            return self.style is not None
        return path.suffix.lower() == MODEL_SUFFIX or path.is_dir()

    @property
    def name(self) -> str:
        """What it is painted in the style of."""
        return str(self.style or self.picture)


def paint(
    sequence: str | Path | Shot,
    picture: str | Path | None = None,
    out: str | Path | None = None,
    *,
    style: str | None = None,
    preset: str | Path = "draft",
    training_frame: int | None = None,
    frames: str | None = None,
    refine: int = 2,
    seed: int = 0,
    device: str = "auto",
    memory_budget: str = "auto",
    resume: bool = False,
    overwrite: bool = False,
    without_film: bool = False,
    only: Part | None = None,
    film: FilmConfig | Mapping[str, Any] | None = None,
    chunking: Chunking | Mapping[str, Any] | None = None,
    watch: Watch = SILENT,
    **options: Any,
) -> list[Path]:
    """Paint a sequence of smoke in the style of a picture, as `vnca paint` does.

    Args:
        sequence: A folder, a pattern (`smoke_####.vdb`) or a file; or a shot, or its file
            (`shot.toml`), whose options hold where nothing else is given here.
        picture: A picture to learn from; or a model, or the folder of a run.
        out: Folder for the run of the training, the painted frames and the film.
        style: A style of the library, in the place of a picture.
        preset: How the rule is trained: `draft`, `standard`, `paper`, or the path of a TOML file.
        training_frame: Number of the frame that is trained on; one with much smoke unless given.
        frames: Which frames to paint, such as `30-53`; all unless given.
        refine: Paint on a grid so many times as fine as the smoke's.
        seed: Same seed, same machine, same painting.
        device: Where to compute: `auto`, `cpu`, `cuda`, or such as `cuda:1`.
        memory_budget: Memory for the training, such as `12GB`.
        resume: Go on where an earlier call was interrupted, or else begin.
        overwrite: Replace what an earlier call left in the folder.
        without_film: Paint only.
        only: Do this part of it: `train`, `paint`, or `film` what is painted.
        film: How it is filmed: a `FilmConfig`, or some of its fields.
        chunking: Which of the frames are painted: a `Chunking`, or some of its fields.
        watch: Is told how far it has come, and may cancel.
        **options: Fields of `Direction` (`strength="@mask"`); and of `SmokeFormat`
            (`velocity_units="mantaflow"`), in the place of those that were recorded where `picture`
            is a model.

    Returns:
        The painted files.

    Raises:
        VncaError: If an input cannot be used, the folder cannot be written, training diverges, or
            memory runs out.
        KeyboardInterrupt: If it is cancelled; the folder holds what it takes to resume.
    """
    shot = sequence if isinstance(sequence, Shot) else None
    if shot is None and Path(sequence).suffix == SHOT:  # type: ignore[arg-type]
        shot = Shot.load(sequence)  # type: ignore[arg-type]
    if out is None and (shot is None or "out" not in shot.values):
        raise OptionError("`out`: a folder is needed")
    asked = PaintRun(
        sequence="" if shot else str(sequence),
        picture=None if picture is None else Path(picture),
        style=style,
        out=Path(out or ""),
        preset=str(preset),
        training_frame=training_frame,
        frames=frames,
        refine=refine,
        seed=seed,
        device=device,
        memory_budget=memory_budget,
        resume=resume,
        overwrite=overwrite,
        without_film=without_film,
        film=changed("film", FilmConfig(), film),
        only=only,
        chunking=changed("chunking", Chunking(), chunking),
    )
    if shot is not None:
        asked = over_shot(asked, shot.applied(PaintRun(sequence="", out=Path())))
    smoke, direction = distributed(options, recorded_format(asked), asked.direction)
    asked = dataclasses.replace(asked, smoke=smoke, direction=direction)
    return [path for path in run(asked, watch) if path]


def over_shot(given: PaintRun, shot: PaintRun) -> PaintRun:
    """Options of a shot, in the place of which stand those that are given and not the default."""
    changes = {
        name: getattr(given, name)
        for name in changed_fields(given, PaintRun(sequence="", out=Path()))
    }
    for name, other, none in (
        ("style", "picture", None),
        ("picture", "style", None),
        ("without_film", "film", FilmConfig()),
    ):
        if name in changes:
            changes.setdefault(other, none)
    return dataclasses.replace(shot, **changes)


def recorded_format(options: PaintRun) -> SmokeFormat:
    """How the model of the options says that smoke is read; as asked if there is none yet."""
    if options.picture is None or not options.is_trained:
        return options.smoke
    return recorded_smoke(options.picture, Model.load(options.picture)) or options.smoke


def run(options: PaintRun, watch: Watch, ranks: Ranks | None = None) -> Iterator[Path | None]:
    """Train, and paint frame by frame.

    Args:
        options: What to do.
        watch: Is told how far it has come, and may cancel.
        ranks: Who shares the painting, with a model that is there.

    Yields:
        The file of each frame as it is finished.

    Raises:
        VncaError: As `paint` does.
    """
    options.require_one_style()
    ranks = ranks or Alone()
    paints = options.only == "paint" or (options.only is None and options.is_trained)
    if ranks.size > 1 and not paints:
        raise OptionError("mpirun: ranks share the painting alone; do it with `only` paint")
    sequence = open_sequence(options.sequence, options.frames, watch)
    frame = cache(partial(_training_frame, options, sequence))  # Found by reading some of them.
    is_filmed = not options.without_film and options.only != "paint"
    if is_filmed and options.film.shutter and not options.is_trained:
        # Said before minutes of training, not after them.
        require_velocity(read_smoke(frame().path, options.smoke))
    goes_on = _begin(options)
    model, smoke, scales = options.picture or Path(options.name), options.smoke, painting.Scales()
    style = None
    if options.style is not None:
        style = load_style(options.style)
        scales = painting.Scales.fitted(frame().path, smoke, CELL_OPACITY["painted"])
    elif not options.is_trained:
        try:
            model = _trained(options, frame, watch, goes_on=goes_on)
            if options.only == "train":
                return
        except KeyboardInterrupt:
            watch.note(f"to go on with all of it: the same vnca {COMMAND} with `resume`")
            raise
        # With the velocity's scale as it was fitted for the training.
        smoke = recorded_smoke(model, Model.load(model)) or smoke
    asked = painting.StylizeRun(
        model=model,
        sequence=options.sequence,
        out=options.out / PAINTED,
        frames=options.frames,
        preview=options.out / (FILM + usual_suffix()) if is_filmed else None,
        refine=options.refine,
        resume=goes_on,
        overwrite=options.overwrite,
        gamma=scales.gamma,
        density_scale=scales.density,
        device=options.device,
        smoke=smoke,
        config=StylizeConfig(**fields_of(options.direction), seed=options.seed),
        film=options.film if is_filmed else FilmConfig(),
        chunking=options.chunking,
    )
    if options.only == "film":
        painting.film_painted(asked, watch, style)
        return
    with closing(painting.run(asked, watch, style, ranks)) as paths:  # type: ignore[type-var]
        yield from paths


def _begin(options: PaintRun) -> bool:
    """Whether an earlier call is gone on with; what is asked is written down if not.

    Raises:
        OutputError: If the folder cannot be written, or holds an earlier call's work.
        OptionError: If something else was asked for then.
        FileFormatError: If what was asked for then cannot be read.
    """
    path = writable_folder(options.out) / ASKED_NAME
    now = json.loads(json.dumps(_asked(options)))
    has_begun = any((options.out / name).exists() for name in (RUN, PAINTED))
    if path.exists() and has_begun and not options.overwrite:
        if not options.resume and options.only is None:
            raise OutputError(
                f"{options.out}: holds a painting already; go on with `resume`, or choose another "
                "`out` or `overwrite`"
            )
        if other := first_difference(path, now, "begin anew"):
            raise OptionError(
                f"{options.out}: cannot go on, since `{other}` is another than when it was "
                "begun; make it the same, or begin anew with `overwrite`"
            )
        return options.resume
    options.out.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(now, indent=2) + "\n", encoding="utf-8")
    return False


def _asked(options: PaintRun) -> dict[str, Any]:
    """What has to be the same to go on, as JSON values."""
    asked = recorded(options)
    for name in (*_ANY_TIME, "film", "chunking"):
        asked.pop(name)
    path = options.picture and str(options.picture.absolute())
    asked |= asked.pop("direction")  # one by one, to be named if one is another
    asked |= {"picture": path, "vnca": vnca.__version__}
    if not options.is_trained:
        # A file of a user may have been changed.
        from vnca.training.config import SmokeConfig
        from vnca.training.presets import preset

        asked["preset"] = recorded(preset(SmokeConfig, options.preset))
    return asked


def _trained(options: PaintRun, frame: Callable[[], Frame], watch: Watch, *, goes_on: bool) -> Path:
    """The folder of a run that has come to its end."""
    # Painting with a model needs no torch.
    from vnca.recipe import smoke
    from vnca.training.checkpoint import CHECKPOINT_NAME
    from vnca.training.config import SmokeConfig
    from vnca.training.presets import preset

    folder = options.out / RUN
    if options.only in ("paint", "film"):
        if not (folder / MODEL_NAME).exists():
            raise OptionError(f"{folder}: no model to {options.only} with yet; `only` train first")
    elif goes_on and (folder / CHECKPOINT_NAME).exists():
        again = smoke.ResumeSmokeRun(resume=folder, memory_budget=options.memory_budget)
        smoke.resume_run(again, watch)
    elif not (goes_on and (folder / MODEL_NAME).exists()):
        watch.note(f"training on {frame().path}")
        config = dataclasses.replace(preset(SmokeConfig, options.preset), seed=options.seed)
        asked = smoke.SmokeRun(
            frame=frame().path,
            style=options.picture or Path(),
            out=folder,
            preset=options.preset,
            overwrite=options.overwrite,
            device=options.device,
            memory_budget=options.memory_budget,
            smoke=options.smoke,
            config=config,
        )
        smoke.run(asked, watch)
    return folder


def _training_frame(options: PaintRun, sequence: FrameSequence) -> Frame:
    """The frame that is trained on: the one asked for, or of some the one with the most smoke.

    Raises:
        OptionError: If there is no such frame.
        FileFormatError: If a frame cannot be read.
    """
    if options.training_frame is not None:
        for frame in sequence:
            if frame.number == options.training_frame:
                return frame
        raise OptionError(
            f"`training_frame` {options.training_frame}: is not among the frames of "
            f"{options.sequence}"
        )
    return fullest_frame(sequence, options.smoke)
