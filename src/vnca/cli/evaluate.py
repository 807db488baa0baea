"""`vnca evaluate RUN [SEQUENCE]`, and `vnca ablate FRAME STYLE --out DIR`."""

import dataclasses
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import tyro

import vnca
from vnca.cli.options import STDOUT, chosen, parse, print_json
from vnca.cli.terminal import Terminal, say
from vnca.core.errors import GridError, OptionError
from vnca.core.files import existing_file, whole_file, writable_file
from vnca.core.volume import Volume
from vnca.engine.tensors import choose_device
from vnca.features import load_network
from vnca.io import SmokeFormat, missing_velocity
from vnca.io.picture import read_image
from vnca.metrics.motion import (
    Estimator,
    MotionMeasures,
    estimators,
    measure_carried_noise,
    measure_drift,
    measure_motion,
)
from vnca.painting import StylizeConfig
from vnca.recipe import evaluation, load, recorded_smoke
from vnca.recipe.sequence import beside, read_alone
from vnca.recipe.session import FINGERPRINTS
from vnca.recipe.smoke import SmokeRun, training_inputs
from vnca.recipe.smoke import run as train
from vnca.rule import Rule
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME
from vnca.training.config import SmokeConfig
from vnca.training.presets import DEFAULT, preset
from vnca.training.run import CONFIG_NAME


@dataclass(frozen=True, kw_only=True)
class Evaluate(evaluation.EvaluateRun):
    """Measure how well a trained rule paints a sequence, and write a report with pictures."""

    run: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RUN")]
    """A model file, or the folder of a training run."""
    sequence: Annotated[tyro.conf.Positional[str | None], tyro.conf.arg(metavar="SEQUENCE")] = None
    """A folder, a pattern or a file; the frame of the training unless given."""
    out: Path | None = None
    """Folder for report.html and report.json; "evaluation" in that of the run unless given."""
    json: bool = False
    """Print the measures as JSON, as in report.json, instead of a table."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: StylizeConfig = field(default_factory=StylizeConfig)
    """How the rule is applied."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and measure; smoke is read as for training unless options say otherwise."""
    options = parse("evaluate", Evaluate, arguments)
    model = load(options.run)
    smoke = recorded_smoke(options.run, model)
    if smoke is not None:
        missing: Any = tyro.MISSING
        options = parse("evaluate", Evaluate, arguments, default=Evaluate(run=missing, smoke=smoke))
    out = options.out or evaluation.run_folder_of(options.run) / "evaluation"
    found = evaluation.run(dataclasses.replace(options, out=out), model, Terminal())
    if options.json:
        print_json(found.as_json())
    else:
        print(found)


@dataclass(frozen=True)
class Ablate:
    """Train with and without the motion loss and the velocity, and measure what these do.

    For each seed a rule is trained without the motion loss, one that is not conditioned on the
    velocity, and one with both.
    """

    frame: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FRAME")]
    """A frame of smoke with velocity."""
    style: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STYLE")]
    """The picture: PNG, JPEG, WebP, OpenEXR, … (docs/guide/formats.md lists them)."""
    out: Path
    """Folder for a run of each kind; runs that are there already are not trained again, and runs
    of another frame, picture or options are refused."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """A run of each kind for each seed."""
    preset: str = DEFAULT
    """Values of all hyperparameters that are not given: draft, standard, paper, or a TOML file."""
    json: Path | None = None
    """File for the measures of all runs; - prints them instead of the table."""
    size: int = 128
    """Rows and columns of the views that are measured, pixels."""
    device: str = "auto"
    """Where: auto, cpu, cuda, or as cuda:1."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: SmokeConfig = field(default_factory=SmokeConfig)
    """Hyperparameters."""

    def __post_init__(self) -> None:
        if self.size < 32:
            raise OptionError(f"--size {self.size}: at least 32 pixels are needed")
        if not self.config.motion.weight:
            raise OptionError(f"--motion.weight {self.config.motion.weight}: must be positive here")


def run_ablate(arguments: Sequence[str]) -> None:
    """Read the options, train and measure."""
    missing: Any = tyro.MISSING
    name = chosen(arguments, "--preset", DEFAULT)
    config = preset(SmokeConfig, name)
    # As in the paper: no texture first, and the rule has to move its pattern by itself.
    config = dataclasses.replace(
        config,
        texture=0.0,
        steadiness=0.0,
        consistency=0.0,
        rule=dataclasses.replace(config.rule, transport=False),
        motion=dataclasses.replace(config.motion, weight=config.motion.weight or 1.0),
    )
    defaults = Ablate(missing, missing, missing, config=config)
    ablate(parse("ablate", Ablate, arguments, default=defaults))


_VERSION = "version of vnca"
VARIANTS = {
    "no motion loss": (False, True),
    "no velocity encoding": (True, False),
    "both": (True, True),
}
"""Whether there is a motion loss, and whether the rule is conditioned on the velocity."""


def ablate(options: Ablate) -> None:
    """Train the variants and print how their textures move, mean and spread over the seeds.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    if options.json and options.json != STDOUT:
        writable_file(options.json)
    seen_by = estimators()
    smoke = _read(options.frame, options.smoke)
    if smoke.velocity_field is None:
        raise GridError(f"{missing_velocity(options.frame)}; without one there is nothing to find")
    rules: list[Rule] = []
    found: dict[str, list[MotionMeasures]] = {}
    for variant, config, folder, is_trained in _runs(options, smoke):
        if not is_trained:
            say(f"{variant}, seed {config.seed}: {folder}")
            train(
                SmokeRun(
                    frame=options.frame,
                    style=options.style,
                    out=folder,
                    preset=options.preset,
                    overwrite=True,
                    device=options.device,
                    smoke=options.smoke,
                    config=config,
                ),
                Terminal(),
            )
        rules.append(Model.load(folder).rule)
        measures = measure_motion(rules[-1], smoke, seen_by, size=options.size)
        found.setdefault(variant, []).append(measures)
    described = {name: [*map(as_json, runs)] for name, runs in found.items()}
    if options.json == STDOUT:
        print_json(described)
        return
    print(_heading())
    for variant, runs in found.items():
        print(_row(variant, runs))
    _print_baselines(rules[-1], smoke, seen_by, options.size)
    if options.json:
        _write(options.json, described)


def _configurations(options: Ablate) -> Iterator[tuple[str, SmokeConfig]]:
    for variant, (motion, velocity) in VARIANTS.items():
        config = options.config
        if not motion:
            config = dataclasses.replace(
                config, motion=dataclasses.replace(config.motion, weight=0.0)
            )
        rule = dataclasses.replace(config.rule, velocity_prior=velocity)
        for seed in options.seeds:
            yield variant, dataclasses.replace(config, rule=rule, seed=seed)


class _Run(NamedTuple):
    """A training of the ablation: of which variant, where, and whether it is there already."""

    variant: str
    config: SmokeConfig
    folder: Path
    is_trained: bool


def _runs(options: Ablate, smoke: Volume) -> list[_Run]:
    """All trainings, looked up before the first is begun.

    Raises:
        VncaError: If the picture cannot be read, or a folder holds a run of something else.
    """
    style = read_image(options.style)
    network = load_network(options.config.features, choose_device(options.device))
    runs = []
    for variant, config in _configurations(options):
        folder = options.out / f"{variant.replace(' ', '_')}-{config.seed}"
        wanted = training_inputs([smoke], style, config, network)
        runs.append(_Run(variant, config, folder, _is_trained(folder, wanted, config.iterations)))
    return runs


def _is_trained(folder: Path, wanted: Mapping[str, str], iterations: int) -> bool:
    """Whether the folder holds a finished run of the wanted inputs.

    Raises:
        OptionError: If it holds a run of others.
        ModelError: If it holds a model that cannot be read.
    """
    if not (folder / MODEL_NAME).exists() and not (folder / CONFIG_NAME).exists():
        return False
    try:
        told = json.loads((folder / CONFIG_NAME).read_text())
        inputs = {**told[FINGERPRINTS], _VERSION: told["vnca"]}
    except (OSError, ValueError, KeyError, TypeError):
        raise OptionError(
            f"{folder}: holds a run that does not tell what it was trained on; choose another --out"
        ) from None
    wanted = {**wanted, _VERSION: vnca.__version__}
    others = [name for name, print_ in wanted.items() if inputs.get(name) != print_]
    if others:
        raise OptionError(
            f"{folder}: holds a run that differs in its {' and '.join(others)}; choose another "
            "--out, or move it away"
        )
    if (folder / CHECKPOINT_NAME).exists() or not (folder / MODEL_NAME).exists():
        return False  # It was interrupted, and what model there is may be of the run before it.
    return Model.load(folder).training.get("iterations") == iterations


def as_json(measures: MotionMeasures) -> dict[str, Any]:
    """An object for each measure."""
    return {
        "motion.direction": {**measures.direction, "unit": "cosine distance"},
        "motion.magnitude": {**measures.magnitude, "unit": "pixels per frame"},
        "motion.transport": {"value": measures.transport, "unit": "share of the change"},
        "motion.speed": {"value": measures.speed, "unit": "pixels per frame"},
    }


def _print_baselines(
    rule: Rule, smoke: Volume, seen_by: Mapping[str, Estimator], size: int
) -> None:
    """What the measures say of noise that the smoke advects, and of a texture that only drifts."""
    drift = "".join(f"{value:>12.3f}" for value in measure_drift(rule, smoke, size=size))
    print(f"{'rigid drift':22}{drift}{drift}{'-':>12}")
    print(_row("advected noise", [measure_carried_noise(rule, smoke, seen_by, size=size)]))


def _heading() -> str:
    return (
        f"{'':22}{'network':^24}{'dis':^24}\n"
        f"{'':22}{'L_dir':>12}{'L_mag':>12}{'L_dir':>12}{'L_mag':>12}{'transport':>12}"
    )


def _row(name: str, runs: Sequence[MotionMeasures]) -> str:
    columns = [
        [getattr(measures, what)[estimator] for measures in runs]
        for estimator in ("network", "dis")
        for what in ("direction", "magnitude")
    ]
    columns.append([measures.transport for measures in runs])
    return f"{name:22}" + "".join(f"{_spread(column):>12}" for column in columns)


def _spread(values: Sequence[float]) -> str:
    mean = f"{np.mean(values):.3f}"
    return mean if len(values) == 1 else f"{mean}±{np.std(values):.2f}"


def _read(frame: Path, smoke: SmokeFormat) -> Volume:
    return read_alone(existing_file(frame), beside(frame, smoke), Terminal())


def _write(path: Path, measures: dict[str, Any]) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(measures, indent=2) + "\n")
