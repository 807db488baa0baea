"""The whole way from a picture to painted smoke on a device, held to itself and to the CPU.

Run `python benchmarks/device/whole.py PART --out FOLDER`; PART is train, paint or evaluate, in this
order. What differs ends it with one line. Training: a texture, then smoke with motion, twice, once
of it interrupted and gone on with; all bits are to be the same, motion is to be taught, and the
losses are to be those of the CPU. Painting: twice on the device to the same files, and once on the
CPU to nearly the same. Evaluating: of the measures all are found.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import vnca
from vnca.core.errors import Cancelled, VncaError
from vnca.io.picture import read_style
from vnca.io.sequence import find_frames
from vnca.recipe import Silent
from vnca.training.config import PoolConfig

NEAR = 2e-2
"""How far painted colours and densities may be from the CPU's: norm of the difference over the
norm. Rounding is multiplied by tens of steps of a rule that was hardly trained."""
LOSS_NEAR = 1e-2
"""How far losses may be; networks compute in half precision where that is quick."""


class Interrupting(Silent):
    """Ends training on smoke after some iterations."""

    def __init__(self, after: int) -> None:
        self.after = after

    def progress(self, what: str, done: int, total: int, unit: str, note: str = "") -> None:
        """See `Watch`."""
        if total != self.after and done == self.after:
            raise Cancelled


def require(holds: bool, line: str) -> None:
    """End with a line unless something holds."""
    if not holds:
        sys.exit(line)


def smoke(options: argparse.Namespace) -> Path:
    """The folder of a simulated plume, whose last frames are painted."""
    folder = options.out / "smoke"
    if not folder.exists():
        frames = vnca.simulate("plume", out=folder, resolution=options.resolution, frames=12)
        for _ in frames:
            pass
    return folder


def train(options: argparse.Namespace) -> None:
    frame, picture = smoke(options) / "plume_0012.vdb", options.picture
    asked: dict[str, Any] = {
        "preset": options.preset,
        "texture": 0.5,
        "iterations": options.iterations,
        "preview_every": 10_000,
        "overwrite": True,
    }
    there = {**asked, "device": options.device}
    model = vnca.train(frame, picture, out=options.out / "run", **there)
    try:
        watch = Interrupting(options.iterations // 2)
        vnca.train(frame, picture, out=options.out / "again", watch=watch, **there)
        sys.exit("the training was not interrupted")
    except Cancelled:
        pass
    again = vnca.train(frame, picture, out=options.out / "again", **{**there, "resume": True})
    for name in ("hidden", "bias", "output"):
        same = np.array_equal(getattr(model.rule, name), getattr(again.rule, name))
        require(same, f"two trainings, one interrupted, differ in the weights '{name}'")
    compare_losses(options, frame)


def compare_losses(options: argparse.Namespace, frame: Path) -> None:
    """Three iterations on the device and on the CPU; the last has a state whose motion is seen.

    The presets' rules are carried by the smoke: this one is taught to move, as in the paper.
    """
    volume, style = vnca.read_smoke(frame), read_style(options.picture)
    config = vnca.preset(vnca.SmokeConfig, options.preset)
    config = replace(
        config,
        iterations=3,
        pool=PoolConfig(size=1, reseed_every=1000),
        rule=replace(config.rule, transport=False),
        motion=replace(config.motion, weight=0.3),
    )
    losses: list[dict[str, float]] = []
    for device in (options.device, "cpu"):
        network = vnca.load_network(config.features, device)
        trainer = vnca.smoke_trainer(volume, style, config, network, device=device)
        for progress in trainer.run():
            print(f"{device}: iteration {progress.iteration}, {progress.terms}")
        losses.append(progress.terms)
    there, here = losses
    require("motion" in there, "motion was not taught")
    for name, loss in here.items():
        error = abs(there[name] - loss)
        require(error <= LOSS_NEAR * max(1.0, abs(loss)), f"the loss {name} is off by {error:.1e}")


def paint(options: argparse.Namespace) -> None:
    run, sequence = options.out / "run", smoke(options) / "plume_####.vdb"
    asked: dict[str, Any] = {"frames": "10-12", "overwrite": True}
    for folder, device in [("one", options.device), ("two", options.device), ("cpu", "cpu")]:
        out = options.out / f"painted_{folder}"
        for _ in vnca.stylize(run, sequence, out=out, device=device, **asked):
            pass
    one, two, cpu = (find_frames(options.out / f"painted_{n}") for n in ("one", "two", "cpu"))
    for first, second in zip(one, two, strict=True):
        same = first.path.read_bytes() == second.path.read_bytes()
        require(same, f"painted twice, {first.path.name} differs")
    for there, here in zip(one, cpu, strict=True):
        for grid in ("density", "Cd"):
            x, y = (values(frame.path, grid) for frame in (there, here))
            error = float(np.linalg.norm(x - y) / np.linalg.norm(y))
            print(f"{there.path.name} {grid}: off by {error:.1e} from the CPU's")
            require(error <= NEAR, f"{there.path.name}: {grid} is off by {error:.1e}")


def values(path: Path, name: str) -> np.ndarray:
    """Those of a grid, dense."""
    with vnca.open_vdb(path) as file:
        grid = file.grids[name].read()
    return grid.to_dense(grid.active_box())[0].astype(np.float64)


def evaluate(options: argparse.Namespace) -> None:
    sequence = smoke(options) / "plume_####.vdb"
    asked = {"frames": "11-12", "size": options.size, "device": options.device}
    found = vnca.evaluate(options.out / "run", sequence, **asked)
    print(found)
    require(bool(found.measures), "nothing was measured")


PARTS = {"train": train, "paint": paint, "evaluate": evaluate}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--picture", type=Path, default=Path("src/vnca/data/rust.webp"))
    parser.add_argument("--preset", default="draft")
    parser.add_argument("--resolution", type=int, default=48)
    parser.add_argument("--iterations", type=int, default=20)
    parser.add_argument("--size", type=int, default=224)
    options = parser.parse_args()
    try:
        PARTS[options.part](options)
    except VncaError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
