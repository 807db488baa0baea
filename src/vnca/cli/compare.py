"""`vnca compare`: methods side by side, and a blind study of them."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from vnca.cli.options import is_given, parse
from vnca.cli.terminal import Terminal
from vnca.comparison import CompareRun, compare, name_of, study
from vnca.comparison.report import table
from vnca.core.files import whole_file
from vnca.io import SmokeFormat


@dataclass(frozen=True, kw_only=True)
class Compare(CompareRun):
    """Paint the same smoke with several methods, and judge them alike: a report and films."""

    sequence: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SMOKE")]
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    picture: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PICTURE")]
    """The picture; it is made grey for all, as the other methods know no colour."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""


@dataclass(frozen=True, kw_only=True)
class StudyReport:
    """Evaluate the answers to a study."""

    study_report: tuple[Path, ...]
    """The files that people saved, answers.json each."""
    methods: tuple[str, ...] = CompareRun.methods
    """The methods, as they were compared."""
    seed: int = 0
    """As they were compared with."""
    out: Path | None = None
    """Write the shares and intervals here, as JSON."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and compare; or evaluate the answers to a study."""
    if is_given(arguments, "--study-report"):
        _report(parse("compare", StudyReport, arguments))
        return
    print(table(compare.run(parse("compare", Compare, arguments), Terminal())))


def _report(options: StudyReport) -> None:
    names = [name_of(method) for method in options.methods]
    people, found = study.evaluate(options.study_report, names, options.seed)
    print(study.told(people, found))
    if options.out is not None:
        with whole_file(options.out) as temporary:
            rows = {"people": people, "preferences": [asdict(one) for one in found]}
            temporary.write_text(json.dumps(rows, indent=2) + "\n")
