"""Times for reading and writing VDB files: a smoke-like grid of 200×300×200 cells, 15 % active.

Run `python benchmarks/vdb.py`. Times are the best of several runs; memory is the most that was
allocated at once on top of the arrays handed over, in units of the dense array.
"""

import argparse
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

from vnca.bench.contenders import smoke
from vnca.core import Box
from vnca.io.vdb import Grid, Transform, open_vdb, write_vdb


def best_of(runs: int, work: Callable[[], object]) -> float:
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def peak_of(work: Callable[[], object]) -> int:
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shape", type=int, nargs=3, default=(200, 300, 200))
    parser.add_argument("--share", type=float, default=0.15)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    values, active = smoke(tuple(options.shape), options.share)
    box = Box((0, 0, 0), values.shape)
    transform = Transform.uniform(0.01)

    def build(half: bool) -> Grid:
        return Grid.from_dense("density", values, active, box.lower, transform=transform, half=half)

    def read(path: Path) -> None:
        with open_vdb(path) as file:
            file.read("density").to_dense(box)

    leaves = len(build(False).tree.leaf_origins)
    print(f"{values.shape} cells, {active.mean():.1%} active, {leaves} leaves")
    with tempfile.TemporaryDirectory() as folder:
        for compression, half in (
            ("blosc", False),
            ("blosc", True),
            ("zip", False),
            ("none", False),
        ):
            path = Path(folder) / "smoke.vdb"

            def write(path: Path = path, compression: str = compression, half: bool = half) -> None:
                write_vdb(path, [build(half)], compression=compression)

            written = best_of(options.runs, write)
            loaded = best_of(options.runs, lambda path=path: read(path))
            peaks = peak_of(write), peak_of(lambda path=path: read(path))
            print(
                f"{compression:>6}{' half' if half else '     '}: "
                f"write {written:.2f} s, peak {peaks[0] / values.nbytes:.2f}×; "
                f"read {loaded:.2f} s, peak {peaks[1] / values.nbytes:.2f}×; "
                f"{path.stat().st_size / 1e6:.1f} MB"
            )


if __name__ == "__main__":
    main()
