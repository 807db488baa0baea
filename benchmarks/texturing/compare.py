"""Solid textures from a trained rule and by other methods, compared on the same pictures.

Run `python benchmarks/texturing/compare.py --styles picture.jpg …`. For each picture a rule is
trained and grown into blocks of all sizes, and so is the network of Gutierrez et al. 2020; a block
of each size of `--sizes` is optimised, by gradient descent and as Kopf et al. 2007 do, for as long
as these learn. `--methods` chooses among them. All are judged by the appearance loss on the same
slices: along the axes, at angles that training draws, and at angles (`unseen`) that it never does.
Slices along the axes are all that the other methods look at. Each measurement runs
in a process of its own, whose peak memory is told, the libraries included. Times are processor
seconds of all threads together: a busy machine favours neither.
"""

import argparse
import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import torch
from gutierrez import Generator, on_demand, trained
from kopf import kopf_blocks
from solid import optimised_blocks

from vnca.bench import append_csv, run_facts, write_json
from vnca.core import FloatArray
from vnca.engine import Compute
from vnca.features import FeatureNetwork, load_network
from vnca.io.picture import read_image
from vnca.losses.appearance import AppearanceLoss
from vnca.metrics.style_score import slice_distances
from vnca.painting.block import border_jump, grow
from vnca.rule import Rule
from vnca.rule.model import Model
from vnca.training.config import TextureConfig
from vnca.training.presets import preset, preset_names
from vnca.training.trainers import texture_trainer

METHODS = ("automaton", "gutierrez", "optimised", "kopf")


@dataclass(frozen=True)
class Task:
    """What a measurement needs to know."""

    style: Path
    preset: str
    features: str
    threads: int
    seconds: float
    iterations: int | None
    slices: int
    steps: int
    seed: int

    @property
    def config(self) -> TextureConfig:
        """How the rule is trained, and what the preset says of how blocks are judged."""
        return preset(TextureConfig, self.preset)

    @property
    def slice_size(self) -> int:
        """Rows and columns of a slice."""
        return self.config.slice.size

    def judge(self, style: FloatArray, network: FeatureNetwork) -> AppearanceLoss:
        """What the rule was trained with, for both methods."""
        return AppearanceLoss(network, style, self.config.appearance, self.slice_size)

    def begin(self) -> tuple[FloatArray, FeatureNetwork]:
        """The picture and the network, in the process that measures."""
        torch.set_num_threads(self.threads)
        return read_image(self.style), load_network(self.features)

    def done(self, started: float, iterations: int) -> bool:
        """Whether learning has had its time."""
        if self.iterations is not None:
            return iterations >= self.iterations
        return time.process_time() - started >= self.seconds


def train(task: Task) -> tuple[Rule, dict[str, Any]]:
    """A rule trained for the time given; its learning rate falls as over that time."""
    style, network = task.begin()
    config = replace(task.config, features=task.features, seed=task.seed)
    if task.iterations is None:
        trial = texture_trainer(style, config, network)
        trial.improve()
        began = time.process_time()
        for _ in range(8):
            trial.improve()
        pace = (time.process_time() - began) / 8
        config = replace(config, iterations=max(1, round(task.seconds / pace)))
    else:
        config = replace(config, iterations=task.iterations)
    trainer = texture_trainer(style, config, network)
    began = time.process_time()
    for _ in trainer.run():
        pass
    learned = time.process_time() - began
    return trainer.rule(), {"iterations": config.iterations, "learn_s": round(learned, 1)}


def grown(task: Task, rule: Rule, size: int) -> dict[str, Any]:
    """A block of a trained rule, and how near its slices come."""
    style, network = task.begin()
    began = time.process_time()
    compute = Compute(threads=task.threads)
    block = next(grow(rule, size, steps=task.steps, seed=task.seed, compute=compute)).colours
    made = time.process_time() - began
    return {"make_s": round(made, 1), "peak_mb": peak_mb(), **judged(task, block, style, network)}


def learned(task: Task) -> tuple[Generator, dict[str, Any]]:
    """The network of Gutierrez et al., trained for the time given."""
    style, network = task.begin()
    cells = task.judge(style, network).style_scale * task.slice_size
    steps = trained(style, network, cells=cells, slice_size=task.slice_size, seed=task.seed)
    began = time.process_time()
    for iterations, generator in zip(count(1), steps, strict=False):  # noqa: B007
        if task.done(began, iterations):
            break
    spent = round(time.process_time() - began, 1)
    return generator, {"iterations": iterations, "learn_s": spent}


def demanded(task: Task, generator: Generator, size: int) -> dict[str, Any]:
    """A block of that network, and how near its slices come."""
    style, network = task.begin()
    began = time.process_time()
    block = on_demand(generator, size, seed=task.seed)
    made = time.process_time() - began
    return {"make_s": round(made, 1), "peak_mb": peak_mb(), **judged(task, block, style, network)}


def optimised(task: Task, method: str, size: int) -> dict[str, Any]:
    """A block of a method that optimises it, and how near its slices come."""
    style, network = task.begin()
    appearance = task.judge(style, network)
    if method == "kopf":
        cells = appearance.style_scale * task.slice_size
        blocks = kopf_blocks(style, size, cells=cells, seed=task.seed)
    else:
        blocks = optimised_blocks(
            style, appearance, size, slice_size=task.slice_size, seed=task.seed
        )
    began = time.process_time()
    for iterations, block in zip(count(1), blocks, strict=False):  # noqa: B007
        if task.done(began, iterations):
            break
    made = time.process_time() - began
    return {
        "iterations": iterations,
        "learn_s": 0.0,
        "make_s": round(made, 1),
        "peak_mb": peak_mb(),
        **judged(task, block, style, network),
    }


def judged(
    task: Task, block: FloatArray, style: FloatArray, network: FeatureNetwork
) -> dict[str, Any]:
    found = slice_distances(
        block, task.judge(style, network), size=task.slice_size, count=task.slices, seed=1
    )
    totals = {name: distance.total for name, distance in found.items()}
    seen = (totals["axis"] + totals["oblique"]) / 2
    return {
        **{name: round(total, 3) for name, total in totals.items()},
        "unseen_ratio": round(totals["unseen"] / seen, 3),
        "border_jump": round(border_jump(block), 3),
    }


def peak_mb() -> int:
    """Most memory this process has had; Linux counts in KiB."""
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def alone(work: Callable[..., Any], *arguments: Any) -> Any:
    """The result of work in a process of its own."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(work, *arguments).result()


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--styles", type=Path, nargs="+", required=True, metavar="PICTURE")
    parser.add_argument(
        "--runs", type=Path, nargs="+", metavar="RUN", help="one a picture, instead of training"
    )
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument(
        "--sizes", type=int, nargs="*", default=[64, 128], help="of blocks by both methods"
    )
    parser.add_argument(
        "--grow", type=int, nargs="*", default=[256], help="further sizes for what learns"
    )
    parser.add_argument("--preset", choices=preset_names(TextureConfig), default="draft")
    parser.add_argument(
        "--seconds", type=float, default=600.0, help="of processor time to learn, for each method"
    )
    parser.add_argument("--iterations", type=int, help="of learning, instead of --seconds")
    parser.add_argument("--steps", type=int, default=96, help="to grow a block")
    parser.add_argument("--slices", type=int, default=16, help="of each kind that judge a block")
    parser.add_argument("--features", default="edges")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows here")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="append the rows to this")
    options = parser.parse_args()
    if options.runs and len(options.runs) != len(options.styles):
        parser.error("--runs: as many as --styles are needed")

    facts = {**run_facts("cpu", options.threads), "features": options.features}
    print("{device}, {threads} threads, torch {torch}, vnca {vnca}".format(**facts))
    print(
        f"{'style':<32}{'method':<11}{'size':>5}{'learn s':>9}{'make s':>8}{'MB':>7}"
        f"{'axis':>8}{'oblique':>9}{'unseen':>8}{'ratio':>7}{'jump':>7}"
    )
    rows: list[dict[str, Any]] = []

    def tell(task: Task, method: str, size: int, found: dict[str, Any]) -> None:
        rows.append({"style": task.style.name, "method": method, "size": size, **found})
        if options.csv is not None:
            append_csv(options.csv, facts, rows[-1:])
        print(
            f"{task.style.name:<32}{method:<11}{size:>5}{found['learn_s']:>9}{found['make_s']:>8}"
            f"{found['peak_mb']:>7}{found['axis']:>8}{found['oblique']:>9}{found['unseen']:>8}"
            f"{found['unseen_ratio']:>7}{found['border_jump']:>7}",
            flush=True,
        )

    for place, style in enumerate(options.styles):
        task = Task(
            style, options.preset, options.features, options.threads, options.seconds,
            options.iterations, options.slices, options.steps, options.seed,
        )  # fmt: skip
        sizes = [*options.sizes, *options.grow]
        if "automaton" in options.methods:
            if options.runs:
                model = Model.load(options.runs[place])
                rule = model.rule
                cost = {"iterations": model.training.get("iterations"), "learn_s": "given"}
            else:
                rule, cost = alone(train, task)
            for size in sizes:
                tell(task, "automaton", size, {**cost, **alone(grown, task, rule, size)})
        if "gutierrez" in options.methods:
            generator, cost = alone(learned, task)
            for size in sizes:
                tell(task, "gutierrez", size, {**cost, **alone(demanded, task, generator, size)})
        for method in ("optimised", "kopf"):
            for size in options.sizes if method in options.methods else ():
                tell(task, method, size, alone(optimised, task, method, size))

    if options.json is not None:
        write_json(options.json, facts, rows)


if __name__ == "__main__":
    main()
