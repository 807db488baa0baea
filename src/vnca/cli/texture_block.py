"""Growing a block of solid texture, as the subcommands of `vnca texture` do."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from vnca.cli.options import say
from vnca.cli.progress import Progress
from vnca.core.errors import OptionError
from vnca.engine.session import Compute
from vnca.painting.block import KIND, LARGEST, SMALLEST, Block, grow
from vnca.rule.model import Model
from vnca.rule.rule import Rule


@dataclass(frozen=True)
class BlockConfig:
    """The block that is grown."""

    block: int = 128
    """Cells along an edge of the block; the larger, the later the pattern repeats."""
    steps: int = 96
    """Steps of the automaton from nothing to the texture."""
    steps_per_frame: int | None = None
    """Steps between two pictures of a texture that changes; the rule's own pace unless given."""
    seed: int = 0
    """Same seed, same machine, same block."""
    backend: str = "auto"
    """What computes the automaton."""

    def __post_init__(self) -> None:
        Compute(self.backend)
        if not SMALLEST <= self.block <= LARGEST:
            raise OptionError(f"--block {self.block}: must be from {SMALLEST} to {LARGEST} cells")
        if self.steps < 1:
            raise OptionError(f"--steps {self.steps}: at least 1 is needed")
        if self.steps_per_frame is not None and self.steps_per_frame < 0:
            raise OptionError(f"--steps-per-frame {self.steps_per_frame}: must not be negative")


def texture_rule(path: Path) -> Rule:
    """The rule of a model; says so if it was not trained as a texture.

    Raises:
        VncaError: If the model cannot be read.
    """
    model = Model.load(path)
    if model.training.get("kind") != KIND:
        say(f"{path}: was trained on smoke, not as a texture (vnca texture train)")
    return model.rule


def grown_blocks(rule: Rule, config: BlockConfig, count: int = 1) -> Iterator[Block]:
    """`count` blocks: the first grown from nothing, and its later life.

    Raises:
        BackendUnavailableError: If the kernel cannot run.
    """
    pause = config.steps_per_frame
    if pause is None:
        pause = rule.config.steps_per_frame
    total = config.steps + (count - 1) * pause
    with Progress(f"growing {config.block}³ cells,", total, "steps") as progress:
        steps = itertools.count(1)
        blocks = grow(
            rule,
            config.block,
            steps=config.steps,
            seed=config.seed,
            pause=pause,
            compute=Compute(config.backend),
            watch=lambda: progress.show(next(steps)),
        )
        for _ in range(count):
            yield next(blocks)
