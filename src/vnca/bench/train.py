"""Iterations of real training in every backend that can train.

All backends draw the same random numbers, so an iteration is the same work for each. The pool
holds one state that is never started again: every rollout that is timed begins from a grown
state, as most do in a long training.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import torch

from vnca.bench import Difference, Spread, peak_mb, require_agreement
from vnca.bench.plain import PlainUpdate
from vnca.core import FloatArray
from vnca.core.volume import Volume
from vnca.engine import StepSession
from vnca.features import FeatureNetwork
from vnca.training.config import SmokeConfig
from vnca.training.loop import Trainer
from vnca.training.trainers import smoke_trainer

PLAIN = ("plain", "compile")
WARMUP = 2
"""Iterations before any is timed. They start from zeros, which have no texture to move: an
untrained rule changes nothing in the first."""
TOLERANCE = 1e-3
"""Of the loss in the last iteration of the warm-up, relative: Adam's first steps are as long for
a gradient that is all rounding as for any other."""
_NEVER = 2**31


@dataclass(frozen=True)
class Training:
    """What is trained.

    Attributes:
        smoke: The frame.
        style: Linear RGB `[r, c, 3]`.
        config: The hyperparameters.
        network: The frozen network.
        device: Where to compute.
        memory_budget: Bytes that the program may take, as a trainer has it.
    """

    smoke: Volume
    style: FloatArray
    config: SmokeConfig
    network: FeatureNetwork
    device: torch.device
    memory_budget: int | None = None

    def trainer(self, backend: str) -> Trainer:
        """A rule in training with one backend.

        Raises:
            VncaError: If it cannot run here, or there is no smoke.
        """
        config = replace(
            self.config,
            backend="reference" if backend in PLAIN else backend,
            pool=replace(self.config.pool, size=1, reseed_every=_NEVER),
        )
        trainer = smoke_trainer(
            self.smoke,
            self.style,
            config,
            self.network,
            device=self.device,
            memory_budget=self.memory_budget,
        )
        if backend in PLAIN:
            compiled = backend == "compile"
            update = PlainUpdate(trainer.scene.domain, self.device, compiled=compiled)
            assert isinstance(trainer.session, StepSession)
            trainer.session = replace(trainer.session, update=update)
        return trainer


def measure_training(
    training: Training, backends: Sequence[str], *, repeats: int
) -> list[dict[str, Any]]:
    """A row for each backend: seconds an iteration, and the memory it takes at most.

    Raises:
        BackendUnavailableError: If a backend cannot run here.
        GridError: If there is no smoke in the frame.
        DisagreementError: If backends come to other losses; then nothing is timed.
    """
    trainers = {name: training.trainer(name) for name in backends}
    losses = {}
    for name, trainer in trainers.items():
        with _deterministic(name):
            losses[name] = [trainer.improve().loss for _ in range(WARMUP)][-1]
    expected = losses[backends[0]]
    require_agreement(
        Difference(name, "loss", abs(loss - expected) / abs(expected), TOLERANCE)
        for name, loss in losses.items()
    )
    times: dict[str, list[float]] = {name: [] for name in backends}
    for _ in range(repeats):
        for name, trainer in trainers.items():
            with _deterministic(name):
                times[name].append(_seconds(trainer))
    rows = []
    for name, trainer in trainers.items():
        with _deterministic(name):
            peak = peak_mb(trainer.improve, training.device.type)
        spread, config, domain = Spread.of(times[name]), training.config, trainer.scene.domain
        rows.append(
            {
                "backend": name,
                "grid": "x".join(map(str, domain.box.shape)),
                "cells": len(domain),
                "hidden": config.rule.hidden,
                "rollout": config.longest_rollout,
                "view": config.view.size,
                "kept_states": min(trainer.kept_states, config.longest_rollout),
                "seconds_min": round(spread.least, 4),
                "seconds": round(spread.median, 4),
                "seconds_max": round(spread.most, 4),
                "peak_mb": peak,
            }
        )
    return rows


def _seconds(trainer: Trainer) -> float:
    # It ends with numbers in main memory, so the GPU has nothing left to do.
    start = time.perf_counter()
    trainer.improve()
    return time.perf_counter() - start


@contextmanager
def _deterministic(backend: str) -> Iterator[None]:
    """As training computes; but torch repeats a border on a GPU with atomics only."""
    before = torch.are_deterministic_algorithms_enabled()
    torch.use_deterministic_algorithms(backend not in PLAIN)
    try:
        yield
    finally:
        torch.use_deterministic_algorithms(before)
