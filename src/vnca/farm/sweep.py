"""Many trainings: a table of pictures, settings and seeds, as a TOML file."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from vnca.core.errors import FileFormatError, OptionError
from vnca.core.files import existing_file, whole_file, writable_folder
from vnca.core.memory import memory_budget as budget_of
from vnca.core.records import fields_of, require_known, with_values
from vnca.direction.shot import Shot
from vnca.farm.job import Job, Task
from vnca.farm.report import Row, report
from vnca.io import SmokeFormat
from vnca.recipe import Watch, first_difference, recorded, smoke
from vnca.training.config import SmokeConfig
from vnca.training.presets import DEFAULT, preset

ASKED = "asked.json"
"""In the folder of a run: what its table asked of it."""
REPORT = "report.html"
"""In the folder of a table: what came of all its trainings."""
PLAIN = "plain"
"""What the setting is called where a table has none."""
_SETTINGS = "settings"


@dataclass(frozen=True)
class Table:
    """Which trainings there are: each picture with each setting and each seed."""

    frame: Path = Path()
    """The frame of smoke that all are trained on."""
    pictures: tuple[Path, ...] = ()
    """The pictures."""
    seeds: tuple[int, ...] = (0,)
    """The seeds."""
    out: Path = Path()
    """Folder of the runs, and of the report."""
    preset: str = DEFAULT
    """What all settings begin with."""
    device: str = "auto"
    """Where: auto, cpu, cuda, or as cuda:1."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""


@dataclass(frozen=True)
class Training:
    """One of the trainings.

    Attributes:
        name: What it is called, and its folder.
        picture: What it learns from.
        setting: What its hyperparameters are called.
        config: They.
    """

    name: str
    picture: Path
    setting: str
    config: SmokeConfig


@dataclass(frozen=True)
class Sweep:
    """A table that has been read.

    Attributes:
        path: Its file.
        table: What all trainings share.
        trainings: All of them.
    """

    path: Path
    table: Table
    trainings: tuple[Training, ...]

    @classmethod
    def load(cls, path: Path) -> "Sweep":
        """Read a table; paths in it are meant from its folder.

        Raises:
            FileFormatError: If it cannot be read, or a key or a value cannot be.
        """
        values = dict(Shot.load(path).values)
        settings = values.pop(_SETTINGS, {PLAIN: {}})
        try:
            require_known(values, Table.__dataclass_fields__)
            table = with_values(Table(), values)
            if missing := [n for n in ("frame", "pictures", "out") if n not in values]:
                raise OptionError(f"{missing[0]} is missing")
            if not isinstance(settings, Mapping) or not settings:
                raise OptionError(f"{_SETTINGS}: expected a table of each, [{_SETTINGS}.NAME]")
            folder = path.parent
            name = table.preset
            table = replace(
                table,
                frame=folder / table.frame,
                pictures=tuple(folder / picture for picture in table.pictures),
                out=folder / table.out,
                preset=str(folder / name) if name.endswith(".toml") else name,
            )
            trainings = tuple(_trainings(table, settings))
        except OptionError as error:
            raise FileFormatError(f"{path}: {str(error).replace('`', '')}") from error
        return cls(path, table, trainings)

    def folder(self, training: Training) -> Path:
        """Of its run."""
        return self.table.out / training.name

    def named(self, name: str) -> Training:
        """The training of a name.

        Raises:
            OptionError: If there is none.
        """
        for training in self.trainings:
            if training.name == name:
                return training
        names = ", ".join(training.name for training in self.trainings)
        raise OptionError(f"`only` {name}: expected one of {names}")

    def train(self, training: Training, memory_budget: str, watch: Watch) -> None:
        """Do one training, or go on with it, or leave it as it is if it is done.

        Raises:
            OptionError: If something else was asked of it when it was begun.
            VncaError: As `vnca.train` says.
        """
        table, folder = self.table, self.folder(training)
        self._note_down(training, writable_folder(folder))
        smoke.train(
            existing_file(table.frame),
            existing_file(training.picture),
            out=folder,
            preset=table.preset,
            resume=True,
            device=table.device,
            memory_budget=memory_budget,
            watch=watch,
            **fields_of(table.smoke),
            **fields_of(training.config),
        )

    def _note_down(self, training: Training, folder: Path) -> None:
        """Write what is asked of a training, or see that it is what was asked before."""
        asked = {
            "frame": str(self.table.frame.absolute()),
            "picture": str(training.picture.absolute()),
            "smoke": recorded(self.table.smoke),
            **recorded(training.config),
        }
        now, path = json.loads(json.dumps(asked)), folder / ASKED
        if path.exists():
            if other := first_difference(path, now, f"remove {folder}"):
                raise OptionError(
                    f"{folder}: was begun with another {other} than {self.path} has now; "
                    "remove it, or give the setting another name"
                )
            return
        with whole_file(path) as temporary:
            temporary.write_text(json.dumps(now, indent=2) + "\n", encoding="utf-8")

    def report(self) -> Path:
        """Write what came of all trainings so far, as one page."""
        rows = [
            Row(training.name, training.picture, training.setting, training.config.seed, folder)
            for training in self.trainings
            for folder in [self.folder(training)]
        ]
        path = self.table.out / REPORT
        with whole_file(path) as temporary:
            temporary.write_text(report(self.path.stem, self.table.frame, rows), encoding="utf-8")
        return path


def _trainings(table: Table, settings: Mapping[str, Any]) -> Iterator[Training]:
    """All trainings of a table.

    Raises:
        OptionError: If a setting is none, or two trainings have one name.
    """
    names: set[str] = set()
    for name, given in settings.items():
        if not isinstance(given, Mapping) or "seed" in given:
            raise OptionError(f"{_SETTINGS}.{name}: expected hyperparameters, without the seed")
        config = with_values(preset(SmokeConfig, table.preset), given, f"{_SETTINGS}.{name}.")
        for picture in table.pictures:
            for seed in table.seeds:
                label = f"{picture.stem}_{name}_{seed}"
                if label in names:
                    raise OptionError(f"two trainings are called {label}; rename a picture")
                names.add(label)
                yield Training(label, picture, name, replace(config, seed=seed))


def sweep_job(path: Path, program: Sequence[str]) -> Job:
    """The job that does all trainings of a table side by side, and then the report.

    Raises:
        FileFormatError: If the table cannot be read.
    """
    sweep = Sweep.load(path)
    call = (*program, "sweep", str(path.absolute()))
    names = tuple(training.name for training in sweep.trainings)
    tasks = [Task(name, (*call, "--only", name)) for name in names]
    return Job(path.stem, (*tasks, Task("report", (*call, "--report"), names)))


def shared_budget(memory_budget: str, processes: int) -> str:
    """What each of some processes has of a memory budget.

    Raises:
        OptionError: If it is none, or what is free is not to be shared by several.
    """
    whole = budget_of(memory_budget)
    if whole is not None:
        return f"{whole / processes / 1e6:.0f}MB"
    if processes > 1:
        raise OptionError("`memory_budget` auto: name a size, which the `processes` share")
    return memory_budget


def train_all(sweep: Sweep, processes: int, memory_budget: str, watch: Watch) -> list[str]:
    """Do all trainings here, some at a time, each in a process of its own.

    What a process says goes to a file beside its folder. If this is ended, so are they, as with
    Ctrl-C: each can be gone on with.

    Args:
        sweep: The table.
        processes: How many at a time.
        memory_budget: Memory of each, such as 4GB, or auto.
        watch: Is told how many are done.

    Returns:
        The names of those that failed.
    """
    waiting, failed = list(sweep.trainings), []
    running: dict[int, tuple[str, subprocess.Popen[bytes]]] = {}
    total = len(waiting)
    threads = str(max(1, (os.cpu_count() or 1) // processes))
    environment = {"OMP_NUM_THREADS": threads} | os.environ
    sweep.table.out.mkdir(parents=True, exist_ok=True)
    watch.progress("training", 0, total, "trainings")
    try:
        while waiting or running:
            while waiting and len(running) < processes:
                name = waiting.pop(0).name
                words = [sys.executable, "-m", "vnca", "sweep", str(sweep.path), "--only", name]
                words += ["--memory-budget", memory_budget]
                with (sweep.table.out / f"{name}.log").open("wb") as log:
                    process = subprocess.Popen(words, stderr=log, stdout=log, env=environment)
                running[process.pid] = name, process
            name, process = _first_done(running)
            if process.returncode:
                failed.append(name)
                watch.note(f"{name}: failed; {sweep.table.out / name}.log says why")
            watch.progress("training", total - len(waiting) - len(running), total, "trainings")
    finally:
        for _, process in running.values():
            process.terminate()
        for _, process in running.values():
            process.wait()
    return failed


def _first_done(
    running: dict[int, tuple[str, subprocess.Popen[bytes]]],
) -> tuple[str, subprocess.Popen[bytes]]:
    """Wait for one of the processes, which is no longer among them then."""
    while True:
        for pid, (name, process) in running.items():
            try:
                process.wait(_LOOK_EVERY / len(running))
            except subprocess.TimeoutExpired:
                continue
            del running[pid]
            return name, process


_LOOK_EVERY = 0.5
"""Seconds until all processes have been looked at."""
