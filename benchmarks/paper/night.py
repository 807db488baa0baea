"""The paper's studies, one after the other, and its tables: on two cores within a night.

Run `python benchmarks/paper/night.py --out DIR`, or `make paper`. A study that is done is not done
again, and one that was interrupted goes on with the rules that it has trained: so the same command
goes on after an end of any kind. What fails is told, and the others are made. `--smallest` makes
each study as small as it can be, to see that it works: its figures mean nothing, and are kept apart
in `DIR/smallest`; of the methods two that need no training are run. Findings are in `DIR/findings`,
a table a study, and `DIR/tables.md` has the paper's tables, filled from them.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from tables import read, tables

from vnca.core.files import whole_file, writable_folder
from vnca.recipe.simulation import simulate

HERE = Path(__file__).parent
SMALLEST = ("--iterations", "2", "--size", "32", "--seeds", "0")
SMALLEST_METHODS = ("--resolution", "16", "--count", "2", "--methods", "aurand", "lnst")
PLUME, LAST = "plume", 12
"""What the smallest studies are made on, a few hundred cells: a folder, and its last frame."""


@dataclass(frozen=True)
class Piece:
    """A study, as it is called.

    Attributes:
        name: Of its findings.
        script: Without `.py`.
        options: Beside those of all.
        seeds: Those that it is made with.
    """

    name: str
    script: str
    options: tuple[str, ...] = ()
    seeds: int = 3


_THEIRS = ("--scaling", "authors")
PIECES = (
    Piece("density", "density"),
    Piece("velocity", "velocity"),
    Piece("velocity_jets", "velocity", ("--scene", "jets")),
    Piece("density_authors", "density", _THEIRS),
    Piece("velocity_authors", "velocity", _THEIRS),
    Piece("velocity_jets_authors", "velocity", ("--scene", "jets", *_THEIRS)),
    Piece("methods", "methods", seeds=1),
    Piece("generalisation", "generalisation", seeds=1),
    Piece("views", "views", seeds=1),
    Piece("brightness", "brightness", seeds=1),
    Piece("motion_weight", "motion_weight", ("--weights", "0", "1", "16"), seeds=1),
    Piece("cost", "cost", seeds=1),
)
"""In the order of what the tables need most."""


def command(piece: Piece, out: Path, *, full: bool, smallest: bool) -> list[str]:
    """How a piece is called, but for the table it writes."""
    call = [str(HERE / f"{piece.script}.py"), "--out", str(out), *piece.options]
    if smallest:
        call += ["--frame", str(out / PLUME / f"plume_{LAST:04d}.vdb"), *SMALLEST]
        if piece.script == "methods":
            return [*call, *SMALLEST_METHODS]
        if piece.script == "generalisation":
            return [*call, "--sequence", str(out / PLUME), "--frames", f"{LAST - 1}-{LAST}"]
        return [*call, "--repeats", "2"] if piece.script == "cost" else call
    seeds = map(str, range(piece.seeds))
    return [*call, "--seeds", *seeds, *(["--full"] if full else [])]


def make(piece: Piece, call: list[str], findings: Path) -> bool:
    """Make a piece unless it is made already; whether its findings are there now.

    They appear whole: what an interrupted study left is not taken for findings.
    """
    table, record = (findings / f"{piece.name}{suffix}" for suffix in (".csv", ".json"))
    if table.exists() and record.exists() and json.loads(record.read_text())["call"] == call:
        print(f"{piece.name}: done already", flush=True)
        return True
    unfinished = findings / f".{piece.name}.csv"
    unfinished.unlink(missing_ok=True)
    print(f"{piece.name}: begun", flush=True)
    begun = time.monotonic()
    done = subprocess.run([sys.executable, *call, "--csv", str(unfinished)], check=False)
    took = time.monotonic() - begun
    if done.returncode != 0:
        print(f"{piece.name}: failed with code {done.returncode} after {took:.0f} s", flush=True)
        unfinished.unlink(missing_ok=True)
        return False
    unfinished.replace(table)
    with whole_file(record) as temporary:
        temporary.write_text(json.dumps({"call": call, "seconds": round(took)}) + "\n")
    print(f"{piece.name}: done in {took:.0f} s", flush=True)
    return True


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names = [piece.name for piece in PIECES]
    parser.add_argument("--out", type=Path, default=Path("build/paper"))
    parser.add_argument("--only", nargs="+", choices=names, metavar="STUDY", default=names)
    parser.add_argument("--full", action="store_true", help="the paper's sizes, on a GPU")
    parser.add_argument("--smallest", action="store_true", help="to see that all of it works")
    options = parser.parse_args()
    out = options.out / "smallest" if options.smallest else options.out
    if options.smallest:
        for _ in simulate("plume", out=out / PLUME, resolution=16, frames=LAST):
            pass
    findings = writable_folder(out) / "findings"
    findings.mkdir(parents=True, exist_ok=True)
    failed = []
    for piece in PIECES:
        if piece.name in options.only:
            call = command(piece, out, full=options.full, smallest=options.smallest)
            if not make(piece, call, findings):
                failed.append(piece.name)
        found = [findings / f"{one.name}.csv" for one in PIECES]
        text = tables(read([path for path in found if path.exists()]))
        with whole_file(out / "tables.md") as temporary:
            temporary.write_text(text, encoding="utf-8")
    print(text)
    if failed:
        parser.exit(1, f"failed: {', '.join(failed)}; the same command tries them again\n")


if __name__ == "__main__":
    main()
