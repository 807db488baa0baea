"""What the studies of the paper's evidence share: the scene, trained rules, and findings."""

import hashlib
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
import torch
import tyro

from vnca.bench import append_csv, run_facts
from vnca.core import FloatArray
from vnca.core.errors import OptionError, VncaError
from vnca.core.files import existing_file, writable_folder
from vnca.core.volume import Volume
from vnca.engine.tensors import choose_device
from vnca.io import SmokeFormat, read_smoke
from vnca.io.picture import write_image
from vnca.losses.appearance import AppearanceConfig
from vnca.recipe import Silent
from vnca.recipe.smoke import SmokeRun
from vnca.recipe.smoke import run as train
from vnca.rule import Rule, RuleConfig
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME
from vnca.training.config import PoolConfig, SmokeConfig, ViewConfig
from vnca.training.presets import preset

ROOT = Path(__file__).parents[2]
AUTHORS = " + authors' scaling"
"""What a table says of a preset with it."""
REFERENCE = "reference"
"""The rule that nothing was taken from; all studies share it."""
DRAFT = SmokeConfig(
    iterations=250,
    rule=RuleConfig(position_prior=False),
    view=ViewConfig(size=96),
    pool=PoolConfig(size=16),
    appearance=AppearanceConfig(style_scale=1.0),
)
"""A training from nothing, small enough for many on two cores."""


@dataclass(frozen=True)
class Study:
    """On what a study is made, and how large."""

    out: Path = Path("runs/paper")
    """Folder of runs and pictures; studies that are given the same one share their runs."""
    frame: Path = ROOT / "tests" / "data" / "plume_sphere_0030.vdb"
    """The frame of smoke to train on."""
    style: Path = ROOT / "src" / "vnca" / "data" / "vangogh_cafe_terrace.webp"
    """The picture."""
    full: bool = False
    """The preset `paper` on a GPU; else a small training."""
    scaling: Literal["ours", "authors"] = "ours"
    """How strongly cells perceive, and how weights begin: as the presets have it, or as the preset
    `authors`, after the authors' later code."""
    iterations: int | None = None
    """Iterations of training, if not 250, or those of the preset."""
    size: int | None = None
    """Rows and columns of a view in training and judging; 96, or those of the preset if --full."""
    seeds: tuple[int, ...] = (0, 1)
    """A rule of each kind for each seed."""
    features: str = "edges"
    """Network for training and judging, as `vnca train --features` has it."""
    device: str | None = None
    """Where to train and judge: cpu, cuda or auto; cuda if --full, else cpu."""
    csv: Path | None = None
    """A table to add the findings to."""
    smoke: Annotated[SmokeFormat, tyro.conf.arg(name="")] = field(
        default_factory=lambda: SmokeFormat(velocity_units="mantaflow", time_scale=0.4)
    )
    """How smoke is read from files."""

    def __post_init__(self) -> None:
        if not self.seeds:
            raise OptionError("--seeds: at least one is needed")

    @property
    def preset(self) -> Literal["paper", "draft"]:
        """Where all hyperparameters come from that no option sets."""
        return "paper" if self.full else "draft"

    @property
    def config(self) -> SmokeConfig:
        """That of the reference."""
        plan = preset(SmokeConfig, "paper") if self.full else DRAFT
        if self.scaling == "authors":
            theirs = preset(SmokeConfig, "authors")
            rule = replace(
                plan.rule,
                sobel_divisor=theirs.rule.sobel_divisor,
                laplacian_divisor=theirs.rule.laplacian_divisor,
            )
            plan = replace(plan, rule=rule, xavier_gain=theirs.xavier_gain)
        return replace(
            plan,
            iterations=plan.iterations if self.iterations is None else self.iterations,
            features=self.features,
            view=replace(plan.view, size=plan.view.size if self.size is None else self.size),
        )

    @cached_property
    def place(self) -> torch.device:
        """The device.

        Raises:
            OptionError: If it is not there.
        """
        return choose_device(self.device or ("cuda" if self.full else "cpu"))

    @cached_property
    def volume(self) -> Volume:
        """The frame, read.

        Raises:
            VncaError: If it cannot be read.
        """
        return read_smoke(self.frame, self.smoke)

    def rules(self, name: str, config: SmokeConfig) -> Iterator[tuple[int, Rule]]:
        """A seed and the rule trained with it, for each seed; see `trained`."""
        for seed in self.seeds:
            yield seed, self.trained(name, config, seed)

    def trained(self, name: str, config: SmokeConfig, seed: int, *, anew: bool = False) -> Rule:
        """A rule that is trained now, unless it was before.

        Args:
            name: What it is called in the folder of runs; the reference is always called so.
            config: How it is trained.
            seed: In the place of that of `config`.
            anew: Train it even so.

        Raises:
            VncaError: If an input cannot be used, or training fails.
        """
        if config == self.config:
            name = REFERENCE
        config = replace(config, seed=seed)
        folder = self.out / "runs" / f"{name}-{seed}-{self._key(config)}"
        if anew or not is_finished(folder):
            print(f"{name}, seed {seed}: {folder}", file=sys.stderr, flush=True)
            train(
                SmokeRun(
                    frame=self.frame,
                    style=self.style,
                    out=folder,
                    overwrite=True,
                    preview_every=config.iterations,
                    device=str(self.place),
                    preset=self.preset,
                    smoke=self.smoke,
                    config=config,
                ),
                Lines(),
            )
        return Model.load(folder).rule

    def _key(self, config: SmokeConfig) -> str:
        """Another for all that a run depends on: what is trained on, and how."""
        found = hashlib.sha256(json.dumps([asdict(config), asdict(self.smoke)]).encode())
        for path in (self.frame, self.style):
            found.update(existing_file(path).read_bytes())
        return found.hexdigest()[:8]

    def picture(self, name: str, sheet: FloatArray) -> None:
        """Write a sheet of pictures, linear RGB, and tell where."""
        path = writable_folder(self.out) / f"{name}.png"
        write_image(path, sheet)
        print(f"pictures: {path}")


class Lines(Silent):
    """Tells what a training has to say, and not how far it is."""

    def note(self, line: str) -> None:
        """Print the line."""
        print(line, file=sys.stderr, flush=True)


def is_finished(folder: Path) -> bool:
    """Whether a folder holds a rule that was trained to the end."""
    return (folder / MODEL_NAME).exists() and not (folder / CHECKPOINT_NAME).exists()


class Findings:
    """What a study measures, row by row: a table to read, and one to keep."""

    def __init__(self, study: Study, name: str) -> None:
        """Begin; `name` is the study's."""
        config = study.config
        self._study = study
        self._common = {
            "study": name,
            "frame": study.frame.name,
            "style": study.style.name,
            "preset": study.preset + (AUTHORS if study.scaling == "authors" else ""),
            "iterations": config.iterations,
            "size": config.view.size,
            "features": study.features,
        }
        self.rows: list[dict[str, Any]] = []

    def add(
        self, variant: str, measures: Mapping[str, float], *, seed: int | str = "", on: str = ""
    ) -> None:
        """Add the measures of a variant.

        Args:
            variant: What was measured.
            measures: The values by name.
            seed: Of its training.
            on: What it was measured on, where there are several.
        """
        self.rows += [
            {"variant": variant, "on": on, "seed": seed, "measure": name, "value": f"{value:.6g}"}
            for name, value in measures.items()
        ]

    def tell(self) -> None:
        """Print the table, and add the rows to the one that was asked for.

        Raises:
            FileFormatError: If the table there has other columns.
            OutputError: If it cannot be written.
        """
        print("\n".join(table(self.rows)))
        if self._study.csv is not None:
            facts = run_facts(self._study.place.type, torch.get_num_threads())
            append_csv(self._study.csv, facts, [{**self._common, **row} for row in self.rows])


def table(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line of Markdown for each variant, with mean and standard deviation over the seeds."""
    found: dict[tuple[str, str], dict[str, list[float]]] = {}
    for row in rows:
        cells = found.setdefault((row["variant"], row["on"]), {})
        cells.setdefault(row["measure"], []).append(float(row["value"]))
    measures = list(dict.fromkeys(row["measure"] for row in rows))
    lines = [f"| | {' | '.join(measures)} |", f"|---|{'---|' * len(measures)}"]
    for (variant, on), cells in found.items():
        title = ", ".join(filter(None, (variant, on)))
        values = (spread(cells[name]) if name in cells else "" for name in measures)
        lines.append(f"| {title} | {' | '.join(values)} |")
    return lines


def spread(values: Sequence[float]) -> str:
    """Mean, and standard deviation if there are several."""
    mean = f"{np.mean(values):.4g}"
    return mean if len(values) == 1 else f"{mean} ± {np.std(values):.2g}"


S = TypeVar("S", bound=Study)


def run(kind: type[S], study: Callable[[S], None], description: str | None) -> None:
    """Read the options and make a study; what a user can mend ends it with code 2."""
    try:
        study(tyro.cli(kind, description=description))
    except VncaError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
