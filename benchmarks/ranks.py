"""How painting scales over ranks: what each does and sends, and what that comes to for many.

    python benchmarks/ranks.py measure build/ranks --csv benchmarks/results/ranks.csv
    python benchmarks/ranks.py simulate build/ranks SMOKE.vdb --cells 1e9

`measure` paints a made column of smoke with 1 to 4 ranks, threads of one program: the same smoke for
all (strong), and as much for each (weak). Seconds are those that the processor spent on a rank, so
they hold on a machine that does other things, too; they do not tell what waiting would cost. What
is counted is exact: cells times steps, messages and bytes. The costs of a cell are kept in the
folder, and `simulate` takes them to 64 to 4096 ranks, on the smoke of a file enlarged to so many
cells. docs/guide/large.md states what it assumes.
"""

import argparse
import csv
import json
import math
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vnca.core import AnyArray
from vnca.core.bricks import EDGE
from vnca.engine import Compute
from vnca.engine.automaton import OFFSETS
from vnca.farm.count import active_cells, around, shared_part
from vnca.io import SmokeFormat
from vnca.io.painted.parts import PaintedParts
from vnca.io.parts import VdbSmoke, open_parts
from vnca.io.sequence import Frame
from vnca.io.smoke_format import CELLS_PER_FRAME
from vnca.io.vdb import open_vdb
from vnca.painting import Roll, StylizeConfig
from vnca.painting.tiles import Tiling
from vnca.painting.tiles.deal import dealt
from vnca.painting.tiles.roll import TiledRoll
from vnca.ranks import Ranks
from vnca.ranks.threads import together
from vnca.recipe import SILENT
from vnca.recipe.sequence import open_sequence, placed, sequence_region
from vnca.rule.library import load_style

FIELDS = (
    *("scaling", "ranks", "rank", "tiles", "cells", "own", "computed", "messages", "megabytes"),
    *("begin_s", "steps_s", "paint_s"),
)
SMOKE = SmokeFormat(velocity_units=CELLS_PER_FRAME)
STEPS, WARMUP, FRAMES, TILE, HALO = 8, 8, 2, 32, 4
LATENCY, BANDWIDTH = 2e-6, 10e9
"""Seconds until a message arrives, and bytes a second of a rank: what an InfiniBand network has."""
COSTS = "costs.json"


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
    rows, alone = [], None
    for scaling in ("strong", "weak"):
        for size in (1, 2, 3, 4):
            high = 192 if scaling == "strong" else 96 * size
            folder = make(options.folder / f"high_{high}", f"96x96x{high}")
            every = painted(folder, size)
            alone = alone or (every[0] if size == 1 else None)
            for rank, each in enumerate(every):
                rows.append(
                    (
                        *(scaling, size, rank, each.tiles, each.cells, each.worked["own"]),
                        *(each.worked["all"], each.messages, round(each.bytes / 1e6, 3)),
                        *(round(each.seconds[what], 3) for what in ("begin", "steps", "paint")),
                    )
                )
                print(*rows[-1], flush=True)
    with options.csv.open("w", newline="") as file:
        csv.writer(file).writerows([FIELDS, *rows])
    assert alone is not None
    seconds, (writing, size) = alone.seconds, alone.written
    cost = {
        "begin": seconds["begin"] / (FRAMES * alone.cells),
        "step": seconds["steps"] / alone.worked["all"],
        "paint": seconds["paint"] / (FRAMES * alone.cells),
        "write": writing / alone.cells,
        "file": size / alone.cells,
    }
    (options.folder / COSTS).write_text(json.dumps(cost))
    print({name: f"{value:.3g}" for name, value in cost.items()})


def simulate(options: argparse.Namespace) -> None:
    cost = json.loads((options.folder / COSTS).read_text())
    rule = load_style("ink").rule.config
    active, _, _ = active_cells(Frame(1, options.smoke), SmokeFormat())
    alive = around(active, rule.dilation)
    counts = alive.values.reshape(len(alive.values), -1).sum(axis=1).astype(float)
    scale = (options.cells / counts.sum()) ** (1 / 3)
    steps, halo = rule.steps_per_frame, options.halo
    rounds = -(-steps // halo)
    cell = 4 * rule.channels
    print(f"{options.cells:.3g} cells, {steps} steps a frame, {halo} cells around a tile")
    print("ranks  tiles  busiest/mean  ghosts/own  computed/own  MB/round  messages  s/frame  eff.")
    first = None
    for size in (64, 256, 1024, 4096):
        edge = fair_edge(counts.sum() / size, options.tiles)
        own = alive.bricks.astype(np.int64) * EDGE // edge
        tiles, row = np.unique(own, axis=0, return_inverse=True)
        row = row.reshape(-1)
        inside = np.bincount(row, counts)
        boxes = [replace_box(at, edge) for at in tiles.tolist()]
        ranks = np.array(dealt(boxes, inside.tolist(), size))
        ghosts, foreign, pairs = ghosts_of(alive.bricks, counts, tiles, ranks, edge, halo / scale)
        volume = scale**3
        mine = np.bincount(ranks, inside, size) * volume
        again = np.bincount(ranks, ghosts, size) * volume
        coming = np.bincount(ranks, foreign, size) * volume
        beside = np.bincount(pairs[:, 0], minlength=size) if len(pairs) else np.zeros(size)
        # As many cells around are computed in each of a round's steps: those not needed any more
        # are not left out.
        compute = cost["step"] * steps * (mine + again)
        sending = rounds * (coming * cell / BANDWIDTH + 2 * beside * LATENCY)
        inner = np.bincount(ranks, inside * (foreign == 0), size) * volume
        waiting = np.maximum(0, sending - cost["step"] * steps * inner)
        agreeing = 12 * (math.log2(size) * LATENCY + len(tiles) * 24 / BANDWIDTH)
        busy = mine * (cost["begin"] + cost["paint"]) + compute + waiting + agreeing
        writing = options.cells * (cost["write"] + cost["file"] / BANDWIDTH)
        seconds = max(busy.max(), writing)
        first = first or (size * seconds)
        print(
            f"{size:5}  {len(tiles):5}  {mine.max() / mine.mean():12.2f}  "
            f"{coming.sum() / mine.sum():10.1%}  {1 + again.sum() / mine.sum():12.2f}  "
            f"{coming.max() * cell / 1e6:8.1f}  {beside.max():8.0f}  {busy.max():7.2f}  "
            f"{first / (size * busy.max()):4.0%}"
        )
    print(f"the first rank writes a frame in {writing:.0f} s")


def fair_edge(cells: float, tiles: int) -> int:
    """The edge of tiles of which a rank gets about so many, as they are in the file."""
    return max(EDGE, int((cells / tiles) ** (1 / 3)) // EDGE * EDGE)


def replace_box(at: list[int], edge: int) -> Any:
    from vnca.core import Box

    x, y, z = at
    return Box((x, y, z), (x + 1, y + 1, z + 1)).refined(edge)


def ghosts_of(
    bricks: AnyArray, counts: AnyArray, tiles: AnyArray, ranks: AnyArray, edge: int, halo: float
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Cells around tiles, those of them that other ranks keep, and who sends to whom."""
    known = {tuple(at): number for number, at in enumerate(tiles.tolist())}
    lowest = bricks.astype(np.int64) * EDGE
    ghosts, foreign = np.zeros(len(tiles)), np.zeros(len(tiles))
    pairs: set[tuple[int, int]] = set()
    for step in OFFSETS[OFFSETS.any(axis=1)]:
        reached = lowest // edge + step
        share = shared_part(lowest, reached * edge, edge, halo)
        for brick in np.flatnonzero((share > 0) & (counts > 0)):
            to = known.get(tuple(reached[brick].tolist()))
            if to is None:
                continue
            ghosts[to] += counts[brick] * share[brick]
            of = known[tuple((lowest[brick] // edge).tolist())]
            if ranks[of] != ranks[to]:
                foreign[to] += counts[brick] * share[brick]
                pairs.add((int(ranks[to]), int(ranks[of])))
    return ghosts, foreign, np.array(sorted(pairs), int).reshape(-1, 2)


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
    simulating.add_argument("folder", type=Path)
    simulating.add_argument("smoke", type=Path)
    simulating.add_argument("--cells", type=float, default=1e9)
    simulating.add_argument("--halo", type=int, default=4)
    simulating.add_argument("--tiles", type=int, default=4, help="tiles of a rank")
    simulating.set_defaults(run=simulate)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
