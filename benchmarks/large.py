"""What it takes to paint frames that are larger than memory: a made sequence, painted by tiles.

A column of smoke turns and rises in a box of which it fills a share, written leaf by leaf:

    python benchmarks/large.py make build/large --box 512x768x512 --share 0.05 --frames 3
    python benchmarks/large.py paint build/large --memory-budget 4GB
    python benchmarks/large.py paint build/large --whole

`paint` tells the greatest memory of the program after each frame, and how long each took; with
`--whole` frames are painted as wholes, and compared with those of tiles if they are there.
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vnca.core import AnyArray, Index
from vnca.core.bricks import CELLS, EDGE, cells_at
from vnca.io.smoke_format import CELLS_PER_FRAME, UNITS_METADATA
from vnca.io.vdb import Grid, Tiles, Transform, Tree, write_vdb
from vnca.io.vdb.layout import VALUE_TYPES

SPEED, TURN, FEATHER = 1.5, 0.01, 6.0
BRICKS_AT_ONCE = 4096


def box_of(text: str) -> Index:
    x, y, z = map(int, text.split("x"))
    return x, y, z


def depth(cells: AnyArray, box: Index, radius: float, frame: int) -> AnyArray:
    """How far cells lie below the surface of the column, about, in cells."""
    x, y, z = (cells[..., axis].astype(np.float32) for axis in range(3))
    height = z / box[2]
    angle = 5 * height - TURN * frame
    reach = 0.2 * min(box[:2])
    x = x - (box[0] / 2 + reach * height * np.cos(angle))
    y = y - (box[1] / 2 + reach * height * np.sin(angle))
    billows = np.sin(0.11 * x + frame * 0.1) + np.sin(0.13 * y) + np.sin(0.09 * z - 0.15 * frame)
    return radius * (0.6 + 0.6 * height) + 4 * billows - np.hypot(x, y)


def radius_of(box: Index, share: float) -> float:
    """The radius at which the column fills a share of its box, within a hundredth of that."""
    sample = np.random.default_rng(0).uniform(0, 1, (200_000, 3)) * np.array(box)
    low, high = 1.0, float(max(box))
    for _ in range(40):
        radius = (low + high) / 2
        filled = (depth(sample, box, radius, 0) > 0).mean()
        low, high = (radius, high) if filled < share else (low, radius)
    return radius


def bricks_of(box: Index) -> Iterator[AnyArray]:
    """All bricks of a box, some at a time."""
    shape = tuple(-(-cells // EDGE) for cells in box)
    for start in range(0, int(np.prod(shape)), BRICKS_AT_ONCE):
        numbers = np.arange(start, min(start + BRICKS_AT_ONCE, int(np.prod(shape))))
        yield np.stack(np.unravel_index(numbers, shape), axis=-1).astype(np.int32)


def make(options: argparse.Namespace) -> None:
    box, radius = options.box, radius_of(options.box, options.share)
    for frame in range(1, options.frames + 1):
        kept: list[tuple[AnyArray, ...]] = []
        for bricks in bricks_of(box):
            every = np.ones((len(bricks), EDGE, EDGE, EDGE), bool)
            cells = cells_at(bricks, every).reshape(-1, CELLS, 3)
            below = depth(cells, box, radius, frame)
            active = (below > 0) & (cells < np.array(box)).all(axis=-1)
            held = active.any(axis=1)
            density = np.clip(below[held] / FEATHER, 0, 1).astype(np.float16)
            moved = cells[held].astype(np.float32) - np.array(box, np.float32) / 2
            turning = np.stack([-moved[..., 1], moved[..., 0]], axis=-1) * TURN
            rising = np.full((*turning.shape[:2], 1), SPEED, np.float32)
            velocity = np.concatenate([turning, rising], axis=-1).astype(np.float16)
            kept.append((bricks[held], active[held], density, velocity))
        bricks, active, density, velocity = map(np.concatenate, zip(*kept, strict=True))
        grids = []
        for name, kind, values in (("density", "float", density), ("velocity", "vec3s", velocity)):
            values[~active] = 0
            background = np.zeros(values.shape[2:], np.float32)
            tiles = Tiles.none(VALUE_TYPES[kind])
            tree = Tree(background, bricks * EDGE, active, values.astype(np.float32), tiles)
            transform = Transform.from_matrix(np.diag([0.01, 0.01, 0.01, 1.0]))
            told = {UNITS_METADATA: CELLS_PER_FRAME} if name == "velocity" else {}
            grids.append(
                Grid.from_leaves(name, tree, transform=transform, metadata=told, half=True)
            )
        path = options.folder / "smoke" / f"column_{frame:04d}.vdb"
        write_vdb(path, grids)
        print(f"{path}: {int(active.sum())} of {np.prod(box)} cells", flush=True)


def paint(options: argparse.Namespace) -> None:
    out = options.folder / ("whole" if options.whole else "painted")
    cut = ["--memory-budget", "1TB" if options.whole else options.memory_budget]
    cut += [] if options.tile is None else ["--tile", str(options.tile)]
    command = [sys.executable, "-m", "vnca", "stylize", options.model, options.folder / "smoke"]
    command += ["--out", out, "--overwrite", "--json-progress", *cut, *options.others]
    begun = time.monotonic()
    with subprocess.Popen([str(word) for word in command], stderr=subprocess.PIPE) as program:
        assert program.stderr is not None
        done = 0
        for line in program.stderr:
            told = json.loads(line)
            if told.get("event") == "progress" and told.get("done", 0) > done:
                done = told["done"]
                taken = time.monotonic() - begun
                print(f"frame {done}: {taken:.0f} s, {peak(program.pid):.2f} GB", flush=True)
            elif told.get("event") != "progress":
                print(told, flush=True)
    assert program.returncode == 0, program.returncode
    other = options.folder / ("painted" if options.whole else "whole")
    for path in sorted(out.glob("*.vdb")):
        if (other / path.name).exists():
            same = path.read_bytes() == (other / path.name).read_bytes()
            print(f"{path.name}: {'the same' if same else 'OTHER'} as {other / path.name}")


def peak(process: int) -> float:
    """The most memory that a process has had so far, GB."""
    text = Path(f"/proc/{process}/status").read_text()
    line = next(line for line in text.splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) * 1024 / 1e9


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    making = commands.add_parser("make", help="write the smoke")
    making.add_argument("folder", type=Path)
    making.add_argument("--box", type=box_of, default=(512, 768, 512), metavar="XxYxZ")
    making.add_argument("--share", type=float, default=0.05)
    making.add_argument("--frames", type=int, default=3)
    making.set_defaults(run=make)
    painting = commands.add_parser("paint", help="paint it")
    painting.add_argument("folder", type=Path)
    styles = Path(__file__).parents[1] / "src" / "vnca" / "data" / "styles"
    painting.add_argument("--model", type=Path, default=styles / "ink.safetensors")
    painting.add_argument("--memory-budget", default="4GB")
    painting.add_argument("--tile", type=int)
    painting.add_argument("--whole", action="store_true")
    painting.set_defaults(run=paint)
    options, options.others = parser.parse_known_args()
    options.run(options)


if __name__ == "__main__":
    main()
