"""How much memory training takes, and what to do where there is not so much."""

import os
import re
from dataclasses import dataclass
from math import inf, prod
from pathlib import Path
from typing import Any

import torch

from vnca.errors import OptionError
from vnca.training.course import CourseConfig
from vnca.training.rollout import fewest_kept
from vnca.training.scene import Scene

PIXEL_BYTES = 6000
"""A pixel of a picture, once in colour and once in grey, with all that a network computes from it.
Measured at 128² and 256² pixels: EfficientNet 5,700 bytes, VGG16 3,100 to 4,800."""
SAMPLE_BYTES = {"cpu": 30, "cuda": 130}
"""A sample on a pixel's ray, if the smoke's box fills the picture. Measured at 32³ and 64³ cells,
128² and 192² pixels; what a GPU runs was measured on the CPU."""
CELL_BYTES = 150
"""A cell with what is computed from its colour and density, beside states."""
BOX_BYTES = 100
"""A cell of the box around them, in dense grids."""
STATES_AT_WORK = 5
"""States beside those of the pool and the rollout: gradients, penalties, the one put back. This and
the two above: measured at 48³ and 64³ cells, together 390 to 630 bytes a cell of 12 channels."""
MARGIN = 1.1
"""What was measured is at most so much more than what this foretells."""

_UNITS = {"MB": 10**6, "GB": 10**9, "TB": 10**12, "MIB": 2**20, "GIB": 2**30, "TIB": 2**40}


@dataclass(frozen=True)
class MemoryNeeds:
    """About how many bytes training takes beside what it holds before it begins.

    Attributes:
        pool: The pool, once it is full.
        state: A state of a rollout that is kept for the gradient, with its mask.
        pictures: What is computed from pictures.
        work: All else.
    """

    pool: int
    state: int
    pictures: int
    work: int

    @property
    def beside_rollout(self) -> int:
        """All but the states of the rollout."""
        return self.pool + self.pictures + self.work


def memory_needs(scene: Scene[Any], config: CourseConfig) -> MemoryNeeds:
    """About how much memory training takes on a scene."""
    cells, box = len(scene.domain), scene.domain.box
    state = cells * config.rule.channels * 4
    mask = cells * config.rule.update_probability * 4
    sample = SAMPLE_BYTES["cpu" if scene.priors.device.type == "cpu" else "cuda"]
    seen, appearance = config.pictures, config.appearance
    pixel = PIXEL_BYTES * (appearance.colour + appearance.grey)
    pixel += (1 + appearance.shows_density) * scene.samples * sample
    return MemoryNeeds(
        pool=config.pool.size * state,
        state=round(state + mask),
        pictures=round(seen.count * seen.size**2 * pixel),
        work=cells * CELL_BYTES + prod(box.shape) * BOX_BYTES + STATES_AT_WORK * state,
    )


def states_to_keep(scene: Scene[Any], config: CourseConfig, budget: int | None) -> float:
    """How many states of a rollout may be kept at a time; infinity if memory is no matter.

    Args:
        scene: What is trained on.
        config: The hyperparameters.
        budget: Bytes for the whole program, or all its tensors on a GPU; by default what it has
            and what is free. Where even that does not seem to be enough, the fewest states are
            tried.

    Raises:
        OptionError: If the budget given is not enough.
    """
    device = scene.priors.device
    used, needs = memory_used(device), memory_needs(scene, config)
    free = memory_free(device) if budget is None else budget - used
    room = (free / MARGIN - needs.beside_rollout) / needs.state
    fewest = fewest_kept(config.longest_rollout)
    if room >= fewest:
        return room
    if budget is None:
        return fewest
    least = used + MARGIN * (needs.beside_rollout + fewest * needs.state)
    raise OptionError(
        f"--memory-budget {_size(budget)}: at least {_size(least)} are needed here: {_size(used)} "
        f"are in use already, and training takes {_listed(needs, config, fewest)}"
    )


def memory_advice(scene: Scene[Any], config: CourseConfig, kept: float) -> str:
    """What takes how much memory, and what would take less, in one line.

    `kept` is the number of states that rollouts may keep.
    """
    needs, seen, longest = memory_needs(scene, config), config.pictures, config.longest_rollout
    kept, fewest = min(longest, kept), fewest_kept(longest)
    pool, pixels = max(1, config.pool.size // 2), max(32, seen.size // 2)
    savings = {
        f"--pool.size {pool}": needs.pool * (1 - pool / config.pool.size),
        "a --memory-budget": (kept - fewest) * needs.state,
        f"--{seen.option} {pixels}": needs.pictures * (1 - (pixels / seen.size) ** 2),
    }
    best = max(savings, key=lambda option: savings[option])
    return (
        f"for {len(scene.domain)} cells training takes {_listed(needs, config, kept)}; "
        f"{best} would take up to {_size(savings[best])} less"
    )


def memory_budget(text: str) -> int | None:
    """Bytes of a `--memory-budget`, such as 12GB or 800 MiB; None for `auto`.

    Raises:
        OptionError: If it is neither.
    """
    if text == "auto":
        return None
    found = re.fullmatch(r"(\d+(?:\.\d+)?) ?([MGT]I?B)", text.upper())
    if found is None:
        raise OptionError(f"--memory-budget {text}: expected auto, or a size such as 12GB or 800MB")
    return round(float(found[1]) * _UNITS[found[2]])


def memory_used(device: torch.device) -> int:
    """Bytes that this program has now, 0 where that cannot be known; on a GPU, those of tensors."""
    if device.type == "cuda":
        return torch.cuda.memory_allocated(device)
    pages = _number(Path("/proc/self/statm"), r"\d+ (\d+)")
    return 0 if pages is None else pages * os.sysconf("SC_PAGE_SIZE")


def memory_free(device: torch.device) -> float:
    """Bytes that it may have beside, as the system says; infinity where it does not say."""
    if device.type == "cuda":
        kept_for_tensors = torch.cuda.memory_reserved(device) - torch.cuda.memory_allocated(device)
        return torch.cuda.mem_get_info(device)[0] + kept_for_tensors
    available = _number(Path("/proc/meminfo"), r"MemAvailable:\s+(\d+) kB")
    group = Path("/sys/fs/cgroup")  # what a container may have
    limit, taken = (_number(group / f"memory.{name}", r"(\d+)") for name in ("max", "current"))
    cached = _number(group / "memory.stat", r"inactive_file (\d+)") or 0
    return min(
        inf if available is None else available * 1024,
        inf if limit is None or taken is None else limit - taken + cached,
    )


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an allocation failed: torch says so in an error that has no class of its own."""
    told = str(error)
    return isinstance(error, MemoryError) or (
        isinstance(error, RuntimeError)
        and any(
            words in told for words in ("allocate memory", "not enough memory", "out of memory")
        )
    )


def _number(path: Path, pattern: str) -> int | None:
    """The number in a file of the Linux kernel's; None if there is none."""
    try:
        found = re.search(pattern, path.read_text())
    except OSError:
        return None
    return int(found[1]) if found else None


def _listed(needs: MemoryNeeds, config: CourseConfig, kept: float) -> str:
    """What takes how much memory if rollouts keep so many states."""
    taken = {
        f"--pool.size {config.pool.size}": needs.pool,
        f"--longest-rollout {config.longest_rollout}": kept * needs.state,
        f"--{config.pictures.option} {config.pictures.size}": needs.pictures,
        "the cells": needs.work,
    }
    return ", ".join(f"{what} about {_size(bytes_)}" for what, bytes_ in taken.items())


def _size(bytes_: float) -> str:
    return f"{bytes_ / 1e9:.1f} GB" if bytes_ >= 1e9 else f"{bytes_ / 1e6:.0f} MB"
