"""`vnca evaluate RUN [SEQUENCE]`."""

import dataclasses
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

import vnca
from vnca.bench.machine import run_facts
from vnca.cli.options import parse, print_json, say
from vnca.cli.progress import made, tracked
from vnca.cli.recorded import PICTURE_CELLS, recorded_smoke
from vnca.cli.sequence import open_sequence, placed, sequence_region, volumes
from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.core.files import whole_file, writable_folder
from vnca.core.typing import FloatArray
from vnca.engine.session import Compute
from vnca.features.load import load_network
from vnca.io.picture import read_image
from vnca.io.sequence import format_frames
from vnca.io.smoke import SmokeFormat, with_fitted_scale
from vnca.io.smoke_format import NO_VELOCITY
from vnca.metrics.judges import Judge
from vnca.metrics.measures import Measure, measures
from vnca.metrics.report import report
from vnca.metrics.setup import SIZE, Setup
from vnca.metrics.style import SMALLEST, StyleMetric
from vnca.metrics.survey import survey
from vnca.painting.config import StylizeConfig
from vnca.painting.roll import stylize
from vnca.rule.model import Model
from vnca.training.run import CONFIG_NAME

REPORT_NAME = "report.html"
MEASURES_NAME = "report.json"
LARGEST = 4096
"""Pixels along the shorter side of the picture."""
JUDGES = ("edges", "efficientnet")
"""Networks that compare the painting with the picture, whichever the rule was trained with."""


@dataclass(frozen=True)
class Evaluate:
    """Measure how well a trained rule paints a sequence, and write a report with pictures."""

    run: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RUN")]
    """A model file, or the folder of a training run."""
    sequence: Annotated[tyro.conf.Positional[str | None], tyro.conf.arg(metavar="SEQUENCE")] = None
    """A folder, a pattern or a file; the frame of the training unless given."""
    out: Path | None = None
    """Folder for report.html and report.json; "evaluation" in that of the run unless given."""
    frames: str | None = None
    """Frames to paint, such as 30-53 or 1,4,7-9; all unless given."""
    style: Path | None = None
    """The picture; that of the training unless given."""
    style_scale: float | None = None
    """Shorter side of the picture relative to the views; as many cells as in the training unless
    given."""
    refine: Literal[1, 2, 3, 4] = 1
    """Paint on a grid so many times as fine as that of the smoke."""
    size: int = SIZE
    """Rows and columns of the views, pixels."""
    json: bool = False
    """Print the measures as JSON, as in report.json, instead of a table."""
    backend: str = "auto"
    """What computes the automaton."""
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: Annotated[StylizeConfig, tyro.conf.arg(name="")] = field(default_factory=StylizeConfig)
    """How the rule is applied."""

    def __post_init__(self) -> None:
        Compute(self.backend)
        if self.size < 64:
            raise OptionError(f"--size {self.size}: at least 64 pixels are needed")
        if self.style_scale is not None:
            _checked_size(self.size * self.style_scale, f"--style-scale {self.style_scale:g}")


def run(arguments: Sequence[str]) -> None:
    """Read the options and measure; smoke is read as for training unless options say otherwise."""
    options = parse("evaluate", Evaluate, arguments)
    model = Model.load(options.run)
    smoke = recorded_smoke(options.run, model)
    if smoke is not None:
        missing: Any = tyro.MISSING
        options = parse("evaluate", Evaluate, arguments, default=Evaluate(missing, smoke=smoke))
    evaluate(options, model)


def evaluate(options: Evaluate, model: Model) -> None:
    """Paint, measure, write the report and print what was found.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    folder = options.run if options.run.is_dir() else options.run.parent
    out = writable_folder(options.out or folder / "evaluation")
    picture = _picture(options, model, folder)
    sequence = open_sequence(_sequence(options, folder), options.frames)
    width = _compared_width(options, model)
    smoke = with_fitted_scale(options.smoke, sequence)
    lattice, box = region = sequence_region(sequence, smoke)
    rule = placed(model.rule, region)
    # Once for where the smoke is, and once to paint: there may be too many frames to keep.
    still = dataclasses.replace(smoke, velocity_grid=NO_VELOCITY)
    shapes = volumes(sequence, still, lattice)
    refine = options.refine
    setup = Setup.around(shapes, rule, options.size).refined(refine)
    metric = StyleMetric(picture, _checked_size(width(setup), f"--size {options.size}"))
    paintings = stylize(
        volumes(sequence, smoke, lattice),
        rule,
        options.config,
        box=box,
        refine=refine,
        compute=Compute(options.backend),
    )
    tracking = tracked(paintings, "painting and measuring", len(sequence), "frames")
    judges = _judges(model, metric, options.size)
    found = survey(tracking, len(sequence), rule.refined(refine), setup, metric, judges)
    facts = {
        "title": f"{folder.resolve().name} on {sequence[0].path.resolve().parent.name}",
        "picture": str(model.training.get("style", options.style)),
        "frames": f"{format_frames(found.frames)} of {sequence[0].path.name} …",
        "training": ", ".join(
            f"{name} {model.training[name]}"
            for name in ("preset", "iterations", "seed", "features")
            if name in model.training
        ),
        "measured": f"by vnca {vnca.__version__}, {run_facts('cpu', 1)['date']} UTC, "
        f"at {options.size}×{options.size} pixels"
        + (f", painted on a grid {refine} times as fine" if refine > 1 else ""),
    }
    listed = measures(found)
    described = {measure.name: measure.as_json() for measure in listed}
    with whole_file(out / REPORT_NAME) as temporary:
        temporary.write_text(report(found, listed, picture, facts), encoding="utf-8")
    with whole_file(out / MEASURES_NAME) as temporary:
        temporary.write_text(json.dumps(described, indent=2) + "\n")
    say(f"trained with features '{model.training.get('features', 'unknown')}'")
    if options.json:
        print_json(described)
    else:
        _print(listed)
    made("report", out / REPORT_NAME)


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


def _print(listed: Sequence[Measure]) -> None:
    print(f"{'':22}{'painted':>10}{'unstylized':>12}  better")
    for measure in listed:
        value, plain = (
            "-" if number is None else f"{number:.3f}"
            for number in (measure.value, measure.unstylized)
        )
        print(f"{measure.name:22}{value:>10}{plain:>12}  {measure.better or '-'}")


def _picture(options: Evaluate, model: Model, folder: Path) -> FloatArray:
    """The style picture: the one named, that of the training, or ours of the same name."""
    path = options.style or _input(folder, "style")
    if path is not None:
        return read_image(path)
    name = str(model.training.get("style"))
    ours = files("vnca.data").joinpath(Path(name).name)
    if not ours.is_file():
        raise OptionError(
            f"{options.run}: does not tell where its picture '{name}' is; name it with --style"
        )
    with as_file(ours) as path:
        return read_image(path)


def _compared_width(options: Evaluate, model: Model) -> Callable[[Setup], float]:
    """Pixels along the picture's shorter side on a setup: as many cells as the rule was shown."""
    if options.style_scale is not None:
        pixels = options.size * options.style_scale
        return lambda _: pixels
    cells = model.training.get(PICTURE_CELLS)
    if not isinstance(cells, (int, float)):
        raise OptionError(
            f"{options.run}: does not tell how many cells wide its picture was; set --style-scale"
        )
    return lambda setup: cells * setup.scale


def _checked_size(pixels: float, option: str) -> int:
    """The picture's shorter side where it is compared."""
    if not SMALLEST <= pixels <= LARGEST:
        raise OptionError(
            f"{option}: makes the picture {pixels:.0f} pixels wide, of {SMALLEST} to {LARGEST}"
        )
    return round(pixels)


def _sequence(options: Evaluate, folder: Path) -> str:
    """The sequence named, or the frame of the training."""
    path = options.sequence or _input(folder, "frame")
    if path is None:
        raise OptionError(
            f"{options.run}: does not tell where the smoke is that it was trained on; "
            f"name a sequence: vnca evaluate {options.run} SEQUENCE"
        )
    return str(path)


def _input(folder: Path, name: str) -> Path | None:
    """Where a run says that an input of its training is."""
    try:
        path = json.loads((folder / CONFIG_NAME).read_text())["inputs"][name]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return Path(path) if isinstance(path, str) else None
