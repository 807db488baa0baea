"""`python tools/flow/train.py --out flow.safetensors` trains the flow network."""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import torch
import tyro
from jaxtyping import Float
from pairs import Pairs, random_pairs
from textures import KINDS, bank
from torch import Generator, Tensor

from vnca.core.errors import BackendUnavailableError, VncaError
from vnca.core.files import writable_file
from vnca.features.flow import FlowNetwork

SIDES = (64, 96, 128)
"""Of the pictures, in turn."""
TEXTURES, TEXTURE_SIDE = 1024, 192
RATE = 2e-3
EASY = 0.1
"""Share of the iterations over which easy pairs give way to hard ones."""
UNSEEN_WEIGHT = 0.05
SCALE_WEIGHTS = 0.3
"""Of every scale's error but the finest's."""
DIRECTION_WEIGHT = 0.2
SLOW = 0.5
"""Pixels; errors of motion slower than this count as they are, of faster motion relative to it."""


@dataclass(frozen=True)
class FlowTraining:
    """How the flow network is trained.

    Attributes:
        out: Where the weights go.
        seed: Of everything random.
        iterations: Steps of the optimiser.
        pixels: In each of the two pictures of a step, over all its pairs; 16 pairs of 96².
        device: What computes.
        every: Iterations between reports and unfinished weights.
    """

    out: Path
    seed: int = 0
    iterations: int = 6000
    pixels: int = 147456
    device: Literal["cpu", "cuda"] = "cpu"
    every: int = 200


def train(options: FlowTraining, report: Callable[[str], None] = print) -> FlowNetwork:
    """Train a network and write it, also every so often while it is not finished.

    Raises:
        BackendUnavailableError: If scikit-image is not installed, or there is no GPU to train on.
        OutputError: If the weights cannot be written.
    """
    writable_file(options.out)
    if options.device == "cuda" and not torch.cuda.is_available():
        raise BackendUnavailableError("`device` cuda: no usable GPU was found; use `device` cpu")
    device = torch.device(options.device)
    torch.manual_seed(options.seed)
    random = Generator(device).manual_seed(options.seed)
    textures = bank(KINDS, TEXTURES, TEXTURE_SIDE, random)
    network = FlowNetwork().to(device).to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
    optimiser = torch.optim.Adam(network.parameters(), lr=RATE)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, RATE, total_steps=options.iterations, pct_start=0.05
    )
    start = time.perf_counter()
    losses: list[float] = []
    errors: list[float] = []
    for iteration in range(1, options.iterations + 1):
        side = SIDES[iteration % len(SIDES)]
        easy = max(0.0, 1 - iteration / (EASY * options.iterations))
        count = max(1, options.pixels // side**2)
        pairs = random_pairs(textures, count, side, random, easy=easy)
        with torch.autocast(device.type, dtype=torch.bfloat16):
            scales = network.scales(pairs.before, pairs.after)
        loss = flow_loss([flow.float() for flow in scales], pairs)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        losses.append(loss.item())
        errors.append(_endpoint_error(scales[-1], pairs).item())
        if iteration % options.every == 0 or iteration == options.iterations:
            spent = time.perf_counter() - start
            report(
                f"{iteration:>6} of {options.iterations}: loss {sum(losses) / len(losses):.4f}, "
                f"endpoint error {sum(errors) / len(errors):.3f} px, "
                f"{spent / iteration:.3f} s an iteration, "
                f"{spent / iteration * (options.iterations - iteration) / 60:.0f} min left"
            )
            losses.clear()
            errors.clear()
            network.write(options.out)
    return network


def flow_loss(scales: list[Float[Tensor, "b 2 r c"]], pairs: Pairs) -> Float[Tensor, ""]:
    """Endpoint error relative to speed, and cosine distance, where there is texture.

    Args:
        scales: Coarse to fine, all in pixels of the pictures.
        pairs: With the true motion.
    """
    speed = pairs.flow.norm(dim=1)
    weight = torch.lerp(torch.full_like(pairs.seen, UNSEEN_WEIGHT), pairs.seen, pairs.seen)
    weight = weight / weight.sum()
    total = speed.new_zeros(())
    for index, flow in enumerate(scales):
        finest = index == len(scales) - 1
        error = ((flow - pairs.flow).square().sum(dim=1) + 1e-4).sqrt() / (SLOW + speed)
        total = total + (1.0 if finest else SCALE_WEIGHTS) * (weight * error).sum()
    found = scales[-1]
    lengths = (found.square().sum(dim=1) + 1e-4).sqrt() * speed.clamp(min=1e-4)
    cosine = (found * pairs.flow).sum(dim=1) / lengths
    return total + DIRECTION_WEIGHT * (weight * (1 - cosine) * (speed > 0.05)).sum()


def _endpoint_error(flow: Tensor, pairs: Pairs) -> Tensor:
    error = (flow.detach().float() - pairs.flow).norm(dim=1)
    return (error * pairs.seen).sum() / pairs.seen.sum()


if __name__ == "__main__":
    try:
        train(tyro.cli(FlowTraining, description=__doc__))
    except VncaError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
