"""Where the time of a training iteration goes, part by part.

Run `python benchmarks/iteration.py FRAME`; without a frame, one is simulated. An iteration of a
preset is taken apart: carrying, rollout, picture, losses, and the way back through each. Rays are
marched natively and in torch (`vnca.rendering.native` and `march`), in turns, in one run; with
`--features` networks are compared alike. Times are those of the processors, all threads together:
the best of the repeats.
"""

import argparse
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import contextmanager
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch

from vnca.core.volume import Volume
from vnca.engine.tensors import require_equal_runs
from vnca.features import load_network
from vnca.io import SmokeFormat, read_smoke
from vnca.io.picture import read_style
from vnca.losses.appearance import AppearanceLoss
from vnca.recipe.simulation import simulate
from vnca.rendering import native
from vnca.training.config import SmokeConfig
from vnca.training.presets import preset
from vnca.training.rollout import roll_out
from vnca.training.trainers import smoke_trainer

PARTS = ("carrying", "rollout", "picture", "losses", "losses back", "picture back", "rollout back")
T = TypeVar("T")


def main() -> None:
    asked = _asked()
    torch.set_num_threads(asked.threads)
    require_equal_runs(torch.device("cpu"))
    smoke = asked.frame and read_smoke(
        asked.frame, SmokeFormat(velocity_units="mantaflow", time_scale=0.4)
    )
    style = read_style(Path(str(files("vnca.data").joinpath("vangogh_cafe_terrace.webp"))))
    config = preset(SmokeConfig, asked.preset)
    trainer = smoke_trainer(
        smoke or _plume(),
        style,
        config,
        load_network(asked.features[0]),
        device=torch.device("cpu"),
    )
    for _ in range(asked.warmup):
        trainer.improve()
    scene, width = trainer.scene, trainer.scene.width
    losses = {
        name: AppearanceLoss(
            load_network(name), style, config.appearance, config.view.size, width, drawn=True
        )
        for name in asked.features
    }
    found: dict[tuple[str, str], dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for repeat in range(asked.repeats):
        for name, loss in losses.items():
            for way in ("native", "torch"):
                with _marching(way):
                    for part, seconds in _iteration(trainer, loss, repeat).items():
                        found[name, way][part].append(seconds)
    print(
        f"{len(scene.domain)} cells, preset {asked.preset}, {asked.threads} threads; milliseconds\n"
    )
    columns = list(found)
    print("| | " + " | ".join(f"{name}, rays in {way}" for name, way in columns) + " |")
    print("|---" * (1 + len(columns)) + "|")
    best = {key: {part: 1e3 * min(times[part]) for part in PARTS} for key, times in found.items()}
    for part in PARTS:
        print(f"| {part} | " + " | ".join(f"{best[key][part]:.0f}" for key in columns) + " |")
    for title, parts in (("all", PARTS), ("all but the rollout", PARTS[2:6])):
        sums = [sum(best[key][part] for part in parts) for key in columns]
        print(f"| {title} | " + " | ".join(f"{total:.0f}" for total in sums) + " |")


def _iteration(trainer: Any, loss: AppearanceLoss, number: int) -> dict[str, float]:
    """Seconds of each part; the same work for the same number."""
    random, generator = np.random.default_rng(number), torch.Generator().manual_seed(number)
    seconds: dict[str, float] = {}

    def timed(part: str, work: Callable[[], T]) -> T:
        start = time.process_time()
        result = work()
        seconds[part] = time.process_time() - start
        return result

    scene = trainer.scene.augmented(number)
    start = trainer.grow(32).detach()
    _, before = timed("carrying", lambda: scene.transported(start, random))
    session = trainer.session.conditioned(scene.priors)
    steps = range(16)
    state = timed("rollout", lambda: roll_out(session.step, before, steps, kept_states=16))
    seen, viewpoint = state.detach().requires_grad_(), scene.viewpoint(random)
    pictures, opacity = timed("picture", lambda: scene.pictures(seen, viewpoint, loss.background))
    judged = pictures.detach().requires_grad_()
    total = timed("losses", lambda: loss(judged, opacity, generator).total)
    timed("losses back", total.backward)
    timed("picture back", partial(pictures.backward, judged.grad))
    timed("rollout back", partial(state.backward, seen.grad))
    return seconds


@contextmanager
def _marching(way: str) -> Any:
    """Rays are marched in one way."""
    serves = native.serves
    if way == "torch":
        native.serves = lambda density: False
    try:
        yield
    finally:
        native.serves = serves


def _plume() -> Volume:
    *_, last = simulate("plume", resolution=48, frames=30)
    return last


def _asked() -> argparse.Namespace:
    assert __doc__ is not None
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("frame", nargs="?", type=Path)
    parser.add_argument("--preset", default="draft")
    parser.add_argument("--features", nargs="+", default=["efficientnet"])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--warmup", type=int, default=4)
    parser.add_argument("--repeats", type=int, default=7)
    return parser.parse_args()


if __name__ == "__main__":
    main()
