"""How painting scales over ranks: what each does and sends, and what that comes to for many.

    python benchmarks/ranks.py measure build/ranks --csv benchmarks/results/ranks.csv
    python benchmarks/ranks.py simulate SMOKE.vdb --csv benchmarks/results/ranks.csv --cells 1e9

`measure` paints a made column of smoke with 1 to 4 ranks, threads of one program: the same smoke
for all (strong), and as much for each (weak). Seconds are those that the processor spent on a rank,
so they hold on a machine that does other things, too; they do not tell what waiting would cost.
Cells times steps, messages and bytes are exact; those of all but the first rank hold the painted
leaves, too, which the first gathers. `simulate` takes the costs of a cell
to 64 to 4096 ranks, on the smoke of a file enlarged to so many cells;
docs/guide/large.md states what it assumes.
"""

import argparse
import csv
import math
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vnca.core import AnyArray
from vnca.core.bricks import EDGE
from vnca.engine import Compute
from vnca.farm.count import active_cells, around
from vnca.farm.exchange import Shares, shared_out
from vnca.io import SmokeFormat
from vnca.io.painted.parts import PaintedParts
from vnca.io.parts import VdbSmoke, open_parts
from vnca.io.sequence import Frame
from vnca.io.smoke_format import CELLS_PER_FRAME
from vnca.io.vdb import open_vdb
from vnca.painting import Roll, StylizeConfig
from vnca.painting.tiles import Tiling
from vnca.painting.tiles.roll import TiledRoll
from vnca.ranks import Ranks
from vnca.ranks.threads import together
from vnca.recipe import SILENT
from vnca.recipe.sequence import open_sequence, placed, sequence_region
from vnca.rule.library import load_style

FIELDS = (
    *("scaling", "ranks", "rank", "tiles", "cells", "own", "computed", "messages", "megabytes"),
    *("begin_s", "steps_s", "paint_s", "write_s", "file_mb"),
)
SMOKE = SmokeFormat(velocity_units=CELLS_PER_FRAME)
STEPS, WARMUP, FRAMES, TILE, HALO = 8, 8, 2, 32, 4
LATENCY, BANDWIDTH = 2e-6, 10e9
"""Seconds until a message arrives, and bytes a second of a rank: what an InfiniBand network has."""
AGREED = 12
"""How often all ranks tell each other small values in a frame."""
SIMULATED = (
    *("ranks", "tiles", "most/mean", "computed", "MB/round", "messages", "wait ms", "busy s"),
    "of ideal",
)


class Timed(TiledRoll):
    """Tells where the processor's time goes, by what is done."""

    seconds: Counter[str]

    def _begin(self, *given: Any) -> Any:
        return self._during("begin", super()._begin, *given)

    def _stepped(self, *given: Any, **named: Any) -> Any:
        return self._during("steps", super()._stepped, *given, **named)

    def painting(self, *given: Any, **named: Any) -> Any:
        """See `TiledRoll.painting`."""
        return self._during("paint", super().painting, *given, **named)

    def _during(self, what: str, work: Callable[..., Any], *given: Any, **named: Any) -> Any:
        begun = time.thread_time()
        result = work(*given, **named)
        self.seconds[what] += time.thread_time() - begun  # type: ignore[assignment]
        return result


class Told(NamedTuple):
    """What a rank did."""

    tiles: int
    cells: int
    worked: Counter[str]
    seconds: Counter[str]
    messages: int
    bytes: int
    written: tuple[float, int]


def painted(folder: Path, size: int) -> list[Told]:
    """What each of some ranks does for the frames of a folder."""
    model = load_style("ink")
    sequence = open_sequence(str(folder / "smoke"), None, SILENT)
    region = sequence_region(sequence, SMOKE, SILENT)
    rule = placed(model.rule, region, SILENT)
    config = StylizeConfig(warmup=WARMUP, steps_per_frame=STEPS)
    roll = Roll(rule, config, region.box, Compute("native", threads=1))

    def work(ranks: Ranks) -> Told:
        tiled = Timed(roll, Tiling(TILE, HALO), folder, lambda _: None, ranks)
        object.__setattr__(tiled, "seconds", Counter())
        state, tiles, written = tiled.start(), 0, (0.0, 0)
        for frame in sequence:
            with closing(open_vdb(frame.path)) as file:
                smoke = open_parts(
                    frame.path, SMOKE, frame=frame.number, lattice=region.lattice, file=file
                )
                assert isinstance(smoke, VdbSmoke)
                state = tiled.advance(smoke, state)
                kept = PaintedParts(smoke, folder)
                boxes = list(kept.boxes(TILE))
                boxes = [boxes[n] for n in tiled.own(smoke, [box for _, box in boxes])]
                tiles = len(boxes)
                near = tiled.around(state, [box for _, box in boxes])
                for own, box in boxes:
                    shown = tiled.painting(smoke, near, box)
                    kept.add(own, shown.density_field, shown.colour_field, shown.emission)
                ranks.gather(kept.pieces(), kept.take)
                if ranks.leads:
                    begun, path = time.thread_time(), folder / f"painted_{frame.number}.vdb"
                    kept.write(path, told())
                    written = (time.thread_time() - begun, path.stat().st_size)
        own = 0 if state.kept is None else len(state.kept)
        return Told(
            *(tiles, own, tiled.worked, tiled.seconds),
            *(ranks.sent.messages, ranks.sent.bytes, written),
        )

    return together(size, work)


def told() -> Any:
    from vnca.io.provenance import Provenance

    return Provenance(1.0, 1.0, "z", {})


def make(folder: Path, box: str) -> Path:
    """Smoke in a box, a third of it."""
    if not (folder / "smoke").exists():
        script = Path(__file__).with_name("large.py")
        words = ["make", folder, "--box", box, "--share", "0.3", "--frames", FRAMES]
        subprocess.run([sys.executable, script, *map(str, words)], check=True)
    return folder


def measure(options: argparse.Namespace) -> None:
    with options.csv.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(FIELDS)
        for scaling, size in product(("strong", "weak"), (1, 2, 3, 4)):
            high = 192 if scaling == "strong" else 96 * size
            folder = make(options.folder / f"high_{high}", f"96x96x{high}")
            for rank, each in enumerate(painted(folder, size)):
                row = (
                    *(scaling, size, rank, each.tiles, each.cells, each.worked["own"]),
                    *(each.worked["all"], each.messages, round(each.bytes / 1e6, 3)),
                    *(round(each.seconds[what], 3) for what in ("begin", "steps", "paint")),
                    *(round(each.written[0], 3), round(each.written[1] / 1e6, 3)),
                )
                table.writerow(row)
                print(*row, flush=True)
            file.flush()


def costs(path: Path) -> dict[str, float]:
    """What a cell takes of one rank by itself: seconds, and bytes of the painted file."""
    with path.open(newline="") as file:
        row = next(csv.DictReader(file))
    assert (row["scaling"], row["ranks"]) == ("strong", "1")
    told = {name: float(value or "nan") for name, value in row.items() if name != "scaling"}
    painted = FRAMES * told["cells"]
    return {
        "begin": told["begin_s"] / painted,
        "step": told["steps_s"] / told["computed"],
        "paint": told["paint_s"] / painted,
        "write": told["write_s"] / told["cells"],
        "file": told["file_mb"] * 1e6 / told["cells"],
    }


def simulate(options: argparse.Namespace) -> None:
    cost = costs(options.csv)
    print({name: f"{value:.3g}" for name, value in cost.items()})
    rule = load_style("ink").rule.config
    active, _, _ = active_cells(Frame(1, options.smoke), SmokeFormat())
    alive = around(active, rule.dilation)
    count, cell = int(alive.values.sum()), 4 * rule.channels
    volume = options.cells / count
    steps, rounds = rule.steps_per_frame, -(-rule.steps_per_frame // options.halo)
    halo = options.halo / volume ** (1 / 3)
    writing = options.cells * (cost["write"] + cost["file"] / BANDWIDTH)
    print(f"{options.cells:.3g} cells, {steps} steps a frame, {options.halo} cells around a tile")
    print(f"the first rank gathers and writes {options.cells * cost['file'] / 1e9:.0f} GB a frame")
    if not math.isnan(writing):
        print(f"in {writing:.0f} s")
    print(" ".join(f"{word:>9}" for word in SIMULATED))
    for size in (64, 256, 1024, 4096):
        edge = max(EDGE, int((count / size / options.tiles) ** (1 / 3)) // EDGE * EDGE)
        shares = shared_out(alive, edge, halo, size)

        def of_ranks(values: AnyArray, shares: Shares = shares) -> AnyArray:
            return shares.of_ranks(values) * volume

        own, again = of_ranks(shares.cells), of_ranks(shares.around)
        foreign = of_ranks(shares.foreign)
        inner = of_ranks(shares.cells * (shares.foreign == 0))
        messages = np.bincount(shares.pairs[:, 0], minlength=len(own))
        stepping = cost["step"] * steps * (own + again)
        sending = rounds * (foreign * cell / BANDWIDTH + messages * LATENCY)
        waiting = np.maximum(0, sending - cost["step"] * steps * inner)
        telling = AGREED * (np.log2(size) * LATENCY + 24 * len(shares.cells) / BANDWIDTH)
        busy = (cost["begin"] + cost["paint"]) * own + stepping + waiting + telling
        ideal = (cost["begin"] + cost["paint"] + cost["step"] * steps) * options.cells / size
        row = (
            *(f"{size}", f"{len(shares.cells)}", f"{own.max() / own.mean():.2f}"),
            *(f"{1 + again.sum() / own.sum():.2f}", f"{foreign.max() * cell / 1e6:.1f}"),
            *(f"{messages.max()}", f"{waiting.max() * 1e3:.2f}"),
            *(f"{busy.max():.2f}", f"{ideal / busy.max():.0%}"),
        )
        print(" ".join(f"{word:>9}" for word in row))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    measuring = commands.add_parser("measure", help="paint with 1 to 4 ranks")
    measuring.add_argument("folder", type=Path)
    measuring.add_argument("--csv", type=Path, required=True)
    measuring.set_defaults(run=measure)
    simulating = commands.add_parser("simulate", help="64 to 4096 ranks")
    simulating.add_argument("--csv", type=Path, required=True)
    simulating.add_argument("smoke", type=Path)
    simulating.add_argument("--cells", type=float, default=1e9)
    simulating.add_argument("--halo", type=int, default=4)
    simulating.add_argument("--tiles", type=int, default=4, help="tiles of a rank")
    simulating.set_defaults(run=simulate)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
