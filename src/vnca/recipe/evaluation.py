"""Measuring how well a rule paints a sequence."""

import dataclasses
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import vnca
from vnca.bench import run_facts
from vnca.core import AnyArray, FloatArray
from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.core.files import whole_file, writable_folder
from vnca.core.lattice import Region
from vnca.core.volume import Volume
from vnca.direction.values import Constant
from vnca.engine import Compute, compute_of
from vnca.features import load_network
from vnca.io import SmokeFormat, with_fitted_scale
from vnca.io.picture import read_image, style_array
from vnca.io.sequence import FrameSequence, format_frames
from vnca.io.smoke_format import NO_VELOCITY
from vnca.metrics import Survey, survey
from vnca.metrics.measures import Measure, measures
from vnca.metrics.report import report
from vnca.metrics.setup import SIZE, Setup
from vnca.metrics.style import SMALLEST, StyleMetric
from vnca.metrics.style_score import Judge
from vnca.painting import StylizeConfig, stylize
from vnca.painting.frames import VelocityCheck, require_dense
from vnca.recipe import COMPARES_REGIONS, PICTURE_CELLS, SILENT, Watch, applied, tracked
from vnca.recipe.sequence import open_sequence, placed, region_of, sequence_region, volumes
from vnca.rule.model import Model
from vnca.rule.paint import require_refinement
from vnca.rule.styles import alone, style_number

REPORT_NAME = "report.html"
MEASURES_NAME = "report.json"
LARGEST = 4096
"""Pixels along the shorter side of the picture."""
JUDGES = ("edges", "efficientnet")
"""Networks that compare the painting with the picture, whichever the rule was trained with."""


@dataclass(frozen=True, kw_only=True)
class EvaluateRun:
    """How a rule is measured on a sequence."""

    run: Path
    """A model file, or the folder of a training run."""
    sequence: str | None = None
    """A folder, a pattern or a file; the frame of the training unless given."""
    out: Path | None = None
    """Folder for report.html and report.json; nothing is written unless given."""
    frames: str | None = None
    """Frames to paint, such as 30-53 or 1,4,7-9; all unless given."""
    style: Path | None = None
    """The picture; that of the training unless given."""
    style_scale: float | None = None
    """Shorter side of the picture relative to the views; as many cells as in the training unless
    given."""
    refine: int = 1
    """Paint on a grid so many times as fine as that of the smoke, at most 8."""
    density_scale: float | None = None
    """Density that counts as 1; that of the training frame unless given."""
    size: int = SIZE
    """Rows and columns of the views, pixels."""
    backend: str = "auto"
    """What computes the automaton."""
    device: str = "auto"
    """Where the automaton is computed: auto, cpu, cuda, or one of several GPUs, such as cuda:1;
    pictures are compared on the CPU."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: StylizeConfig = field(default_factory=StylizeConfig)
    """How the rule is applied."""

    def __post_init__(self) -> None:
        Compute(self.backend)
        require_refinement(self.refine)
        if self.density_scale is not None and not 0 < self.density_scale < math.inf:
            raise OptionError(f"`density_scale` {self.density_scale}: must be positive")
        if self.size < 64:
            raise OptionError(f"`size` {self.size}: at least 64 pixels are needed")
        if self.style_scale is not None:
            _checked_size(self.size * self.style_scale, "style_scale", self.style_scale)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What was measured; printed, a table.

    Attributes:
        measures: Each with a name, a value, and what it means.
        survey: What they were computed from, with pictures.
        report: The HTML page, if one was written.
    """

    measures: tuple[Measure, ...]
    survey: Survey
    report: Path | None = None

    def __getitem__(self, name: str) -> float | None:
        """The value of a measure, such as `style.score`; None if it could not be measured."""
        return {measure.name: measure.value for measure in self.measures}[name]

    def __str__(self) -> str:
        lines = [f"{'':22}{'painted':>10}{'unstylized':>12}  better"]
        for measure in self.measures:
            value, plain = (
                "-" if number is None else f"{number:.3f}"
                for number in (measure.value, measure.unstylized)
            )
            lines.append(f"{measure.name:22}{value:>10}{plain:>12}  {measure.better or '-'}")
        return "\n".join(lines)

    def as_json(self) -> dict[str, Any]:
        """All measures by name, as JSON values."""
        return {measure.name: measure.as_json() for measure in self.measures}


def evaluate(
    model: str | Path | Model,
    sequence: str | Path | Volume | Iterable[Volume] | None = None,
    *,
    style: str | Path | AnyArray | None = None,
    out: str | Path | None = None,
    frames: str | None = None,
    style_scale: float | None = None,
    refine: int = 1,
    density_scale: float | None = None,
    size: int = SIZE,
    backend: str = "auto",
    device: str = "auto",
    watch: Watch = SILENT,
    **options: Any,
) -> Evaluation:
    """Paint a sequence and measure how well, as `vnca evaluate` does.

    Args:
        model: What `train` returned, or the path of a model or of the folder of a run.
        sequence: A folder, a pattern (`smoke_####.vdb`) or a file; or volumes in order. The frame
            of the training unless given.
        style: The picture, a file or an array `[r, c, 3]` of linear RGB; that of the training
            unless given.
        out: Folder for report.html and report.json; nothing is written unless given.
        frames: Which frames of a sequence in files, such as `30-53`; all unless given.
        style_scale: Shorter side of the picture relative to the views; as many cells as in the
            training unless given.
        refine: Paint on a grid so many times as fine as the smoke's.
        density_scale: Density that counts as 1; that of the training frame unless given.
        size: Rows and columns of the views, pixels.
        backend: What computes the automaton.
        device: Where: `auto`, `cpu`, `cuda`, or such as `cuda:1`; pictures are compared on the CPU.
        watch: Is told how far it has come, and may cancel.
        **options: Fields of `SmokeFormat`, in the place of those that the training recorded, and of
            `StylizeConfig`.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    name, model, smoke, config = applied(model, options)
    if sequence is None and isinstance(model.inputs.get("frame"), Volume):
        sequence = model.inputs["frame"]
    if isinstance(sequence, Volume):
        sequence = [sequence]
    asked = EvaluateRun(
        run=name,
        sequence=str(sequence) if isinstance(sequence, (str, Path)) else None,
        out=None if out is None else Path(out),
        frames=frames,
        style=Path(style) if isinstance(style, (str, Path)) else None,
        style_scale=style_scale,
        refine=refine,
        density_scale=density_scale,
        size=size,
        backend=backend,
        device=device,
        smoke=smoke,
        config=config,
    )
    if style is not None and not isinstance(style, (str, Path)):
        model = dataclasses.replace(model, inputs={**model.inputs, "style": style_array(style)})
    if sequence is None or isinstance(sequence, (str, Path)):
        return run(asked, model, watch)
    if frames is not None:
        raise OptionError("`frames`: chooses among files; give the volumes that are wanted")
    given, region = region_of(sequence)

    def read(check: VelocityCheck | None) -> Iterator[Volume]:
        return iter(given) if check is None else check.watched(given, [None] * len(given))

    return run(
        asked,
        model,
        watch,
        _Smoke(region, len(given), read, "volumes in memory", "memory", "`sequence`"),
    )


@dataclass(frozen=True)
class _Smoke:
    """A sequence to be read as often as wanted: where it is, and what a report calls it.

    Its velocity is read only for who paints it, and is told of where it is missing.
    """

    region: Region
    count: int
    read: Callable[[VelocityCheck | None], Iterator[Volume]]
    first: str
    folder: str
    where: str


def run(
    options: EvaluateRun, model: Model, watch: Watch, given: _Smoke | None = None
) -> Evaluation:
    """Paint and measure, and write the report if there is a folder for it.

    Args:
        options: What is asked.
        model: That of the run.
        watch: Is told how far it has come.
        given: The smoke, if it is not in files.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    options, model = _of_one_style(options, model)
    compute = compute_of(options.backend, options.device)
    out = None if options.out is None else writable_folder(options.out)
    picture = _picture(options, model)
    sequence = None
    if given is None:
        sequence = open_sequence(_sequence(options, model), options.frames, watch)
    width = _compared_width(options, model)
    if sequence is not None:
        given = _files(sequence, options, watch)
    assert given is not None, "it was given, or else there is a sequence"
    rule = model.rule.rescaled(density=options.density_scale)
    densities = (smoke.density_field.values for smoke in given.read(None))
    require_dense(densities, rule.scales.density, given.where)
    rule = placed(rule, given.region, watch)
    refine = options.refine
    # Once for where the smoke is, and once to paint: there may be too many frames to keep.
    setup = Setup.around(given.read(None), rule, options.size)
    # A decoder leaves cells, and what is drawn in them, as large as they are.
    cells = 1 if rule.decoder is not None else refine
    pixels = _checked_size(width(setup.refined(cells)), "size", options.size)
    setup, metric = setup.refined(refine), StyleMetric(picture, pixels)
    paintings = stylize(
        given.read(VelocityCheck(rule, options.smoke, watch.note)),
        rule,
        options.config,
        box=given.region.box,
        refine=refine,
        compute=compute,
    )
    paintings = tracked(paintings, watch, "painting and measuring", given.count, "frames")
    judges = _judges(model, metric, options.size)
    found = survey(paintings, given.count, rule.refined(cells), setup, metric, judges)
    listed = measures(found, regions_compared=model.training.get(COMPARES_REGIONS) is True)
    watch.note(f"trained with features '{model.training.get('features', 'unknown')}'")
    if out is None:
        return Evaluation(listed, found)
    evaluation = Evaluation(listed, found, out / REPORT_NAME)
    page = report(found, listed, picture, _facts(options, model, found, given))
    with whole_file(out / REPORT_NAME) as temporary:
        temporary.write_text(page, encoding="utf-8")
    with whole_file(out / MEASURES_NAME) as temporary:
        temporary.write_text(json.dumps(evaluation.as_json(), indent=2) + "\n")
    watch.made("report", out / REPORT_NAME)
    return evaluation


def _files(sequence: FrameSequence, options: EvaluateRun, watch: Watch) -> _Smoke:
    smoke = with_fitted_scale(options.smoke, sequence)
    at_rest = dataclasses.replace(smoke, velocity_grid=NO_VELOCITY)
    region = sequence_region(sequence, smoke, watch)
    first = sequence[0].path

    def read(check: VelocityCheck | None) -> Iterator[Volume]:
        return volumes(sequence, at_rest if check is None else smoke, region.lattice, check)

    folder = first.resolve().parent.name
    return _Smoke(region, len(sequence), read, first.name, folder, str(first.parent))


def _facts(options: EvaluateRun, model: Model, found: Survey, smoke: _Smoke) -> Mapping[str, str]:
    """What a report tells of what was measured."""
    folder = run_folder_of(options.run).resolve().name
    return {
        "title": f"{folder} on {smoke.folder}",
        "picture": str(model.training.get("style", options.style)),
        "frames": f"{format_frames(found.frames)} of {smoke.first} …",
        "training": ", ".join(
            f"{name} {model.training[name]}"
            for name in ("preset", "iterations", "seed", "features")
            if name in model.training
        ),
        "measured": f"by vnca {vnca.__version__}, {run_facts('cpu', 1)['date']} UTC, "
        f"at {options.size}×{options.size} pixels"
        + (f", painted on a grid {options.refine} times as fine" if options.refine > 1 else "")
        + (
            f", with a density scale of {options.density_scale:g}"
            if options.density_scale is not None
            else ""
        ),
    }


def run_folder_of(run: Path) -> Path:
    """The folder of a run that is named by it, or by its model file."""
    return run if run.is_dir() else run.parent


def _judges(model: Model, metric: StyleMetric, size: int) -> list[Judge]:
    """The networks, each with whether the rule was trained with it; those not installed say so."""
    found = []
    for name in JUDGES:
        origin = model.training.get("features_origin")
        try:
            network = load_network(name)
        except BackendUnavailableError as error:
            found.append(Judge(name, model.training.get("features") == name, str(error)))
            continue
        trained_with = None if origin is None else origin == network.origin
        found.append(Judge.of(network, trained_with, metric, size))
    return found


def _of_one_style(options: EvaluateRun, model: Model) -> tuple[EvaluateRun, Model]:
    """What is measured by one picture: a style of a model of several as a model of its own."""
    config = options.config
    for name in ("layers", "blend"):
        if getattr(config, name):
            raise OptionError(f"`{name}`: what is measured is one rule; leave it out")
    names, asked = config.mixed_names("style_mix"), config.mixes["style_mix"]
    if asked not in ((), (Constant(1.0),)):
        raise OptionError("`style_mix`: what is measured is one style; name it alone")
    number = style_number(model, names[0], "style_mix") if names else 0
    config = dataclasses.replace(config, style_mix=())
    return dataclasses.replace(options, config=config), alone(model, number)


def _picture(options: EvaluateRun, model: Model) -> FloatArray:
    """The style picture: the one given, that of the training, or ours of the same name."""
    known = options.style or model.inputs.get("style")
    if isinstance(known, Path):
        return read_image(known)
    if known is not None:
        return known
    name = str(model.training.get("style"))
    ours = files("vnca.data").joinpath(Path(name).name)
    if not ours.is_file():
        raise OptionError(
            f"{options.run}: does not tell where its picture '{name}' is; name it with `style`"
        )
    with as_file(ours) as path:
        return read_image(path)


def _compared_width(options: EvaluateRun, model: Model) -> Callable[[Setup], float]:
    """Pixels along the picture's shorter side on a setup: as many cells as the rule was shown."""
    if options.style_scale is not None:
        pixels = options.size * options.style_scale
        return lambda _: pixels
    cells = model.training.get(PICTURE_CELLS)
    if not isinstance(cells, (int, float)):
        raise OptionError(
            f"{options.run}: does not tell how many cells wide its picture was; set `style_scale`"
        )
    return lambda setup: cells * setup.scale


def _checked_size(pixels: float, name: str, value: float) -> int:
    """The picture's shorter side where it is compared, which an option is in proportion to."""
    if not SMALLEST <= pixels <= LARGEST:
        least = math.ceil(100 * value * SMALLEST / pixels) / 100
        most = math.floor(100 * value * LARGEST / pixels) / 100
        raise OptionError(
            f"`{name}` {value:g}: makes the picture {pixels:.0f} pixels wide, of {SMALLEST} to "
            f"{LARGEST}; {least:g} to {most:g} would do"
        )
    return round(pixels)


def _sequence(options: EvaluateRun, model: Model) -> str:
    """The sequence named, or the frame of the training."""
    path = options.sequence or model.inputs.get("frame")
    if path is None:
        raise OptionError(
            f"{options.run}: does not tell where the smoke is that it was trained on; "
            "name a sequence"
        )
    return str(path)
