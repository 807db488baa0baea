"""What decoding costs: at points along rays, with its gradient, and in all parts of cells.

Run `python benchmarks/decode.py`. Backends take turns, in one run, after each was held to the
reference; times are nanoseconds a point, the median of the repeats with their extremes, and how
many times as fast as the reference in torch that is.
"""

import argparse
import os
from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from vnca.bench import Spread, in_turns
from vnca.core import AnyArray, Box
from vnca.engine import array_decode, torch_decode
from vnca.engine.automaton import DecoderWeights
from vnca.engine.domain import Domain
from vnca.rule import Decoder

PARTS, SAMPLES = 2, 2
"""Parts along a cell, and points along each, for `parts`."""


def along_rays(edge: int, points: int) -> AnyArray:
    """Points one cell apart on parallel rays that cross a box aslant, ray by ray."""
    rays = max(1, points // edge)
    random = np.random.default_rng(0)
    side = int(np.ceil(rays**0.5))
    u, v = np.divmod(np.arange(rays), side)
    place = (np.stack([u, np.zeros_like(u), v], axis=1) + random.random(3)) / side * (edge - 1)
    direction = np.array([0.2, 0.95, 0.24])
    at = place[:, None] + np.arange(edge)[:, None] * direction
    return at.reshape(-1, 3) % (edge - 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edge", type=int, default=48, help="cells along a side, all alive")
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--channels", type=int, default=12)
    parser.add_argument("--units", type=int, default=32)
    parser.add_argument("--backends", default="native,numpy", help="besides reference")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)

    domain = Domain.filling(Box((0, 0, 0), (options.edge,) * 3))
    random = np.random.default_rng(1)
    state = random.uniform(-0.5, 0.5, (len(domain) + 1, options.channels)).astype(np.float32)
    state[-1] = 0
    rows, fractions = domain.corners(along_rays(options.edge, options.points))
    weights = Decoder.initial(options.channels, seed=0, units=options.units).weights
    points = len(fractions)
    device = options.device
    to = [torch.tensor(a, device=device) for a in (state, rows, fractions)]
    trained = [to[0].requires_grad_(), *(torch.tensor(w, device=device) for w in weights)]
    for weight in trained[1:]:
        weight.requires_grad_()
    gradient = torch.ones(points, 4, device=device)

    def on_tensors(backend: str) -> Callable[[], torch.Tensor]:
        decode = torch_decode(backend, device=device, threads=options.threads)
        return lambda: decode(trained[0], *to[1:], DecoderWeights(*trained[1:]))

    def both(seen: Callable[[], torch.Tensor]) -> Any:
        return lambda: torch.autograd.grad(seen(), trained, gradient)

    works: dict[tuple[str, str], Callable[[], object]] = {}
    chosen = np.arange(
        0, len(domain), max(1, len(domain) * (PARTS * SAMPLES) ** 3 // points), dtype=np.int32
    )
    for name in ("reference", *options.backends.split(",")):
        if name != "numpy":
            seen = on_tensors(name)
            works[name, "forward"] = lambda seen=seen: seen().detach()
            works[name, "both"] = both(seen)
        if name != "triton" and device == "cpu" and name != "reference":
            arrays = array_decode("reference" if name == "numpy" else name, threads=options.threads)
            if name == "numpy":
                works[name, "forward"] = lambda a=arrays: a.decode(state, rows, fractions, weights)
            works[name, "parts"] = lambda a=arrays: a.decode_parts(
                state, chosen, domain.neighbours, PARTS, SAMPLES, weights, 0.5
            )

    expected = torch.as_tensor(works["reference", "forward"]()).cpu()
    for (name, kind), work in works.items():
        if kind == "forward":
            off = (torch.as_tensor(work()).cpu() - expected).abs().max().item()
            assert off < 1e-4, f"{name} is off by {off}"

    begins = {key: lambda w=work: w for key, work in works.items()}
    times = in_turns(begins, device, options.repeats)
    shape = f"{options.channels} channels, {options.units} units"
    print(f"{shape}, {points} points, {options.threads} threads, {device}")
    for (name, kind), seconds in times.items():
        count = len(chosen) * (PARTS * SAMPLES) ** 3 if kind == "parts" else points
        cost = Spread.of([1e9 * s / count for s in seconds])
        base = times["reference", "both" if kind == "both" else "forward"]
        ratio = Spread.of([1e9 * s / points for s in base]).median / cost.median
        print(
            f"{name:10} {kind:8} {cost.median:7.0f} ns a point "
            f"({cost.least:.0f} to {cost.most:.0f}), {ratio:.1f}×"
        )


if __name__ == "__main__":
    main()
