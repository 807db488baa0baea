"""`vnca texture volume MODEL --out FILE`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from vnca.cli.options import parse
from vnca.cli.progress import made
from vnca.cli.texture_block import BlockConfig, grown_blocks, texture_rule
from vnca.core.errors import OptionError
from vnca.core.files import whole_file, writable_file
from vnca.core.typing import FloatArray
from vnca.io.vdb import Grid, Transform, write_vdb
from vnca.painting.parts import require_refinement

SUFFIXES = (".vdb", ".npz")


@dataclass(frozen=True)
class Volume:
    """Write the block of a solid texture as a volume."""

    model: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="MODEL")]
    """A model file, or the folder of a training run."""
    out: Path
    """A .vdb file with `density` 1 and `Cd`, a unit wide; or an .npz file with `Cd`."""
    refine: int = 1
    """Write a grid so many times as fine as the block's cells, at most 8."""
    grow: BlockConfig = field(default_factory=BlockConfig)
    """How the block is grown."""

    def __post_init__(self) -> None:
        if self.out.suffix.lower() not in SUFFIXES:
            raise OptionError(f"--out {self.out}: expected a name ending in .vdb or .npz")
        require_refinement(self.refine)


def run(arguments: Sequence[str]) -> None:
    """Read the options and write the block."""
    options = parse("texture volume", Volume, arguments)
    writable_file(options.out)
    (block,) = grown_blocks(texture_rule(options.model), options.grow)
    write = _write_vdb if options.out.suffix.lower() == ".vdb" else _write_npz
    write(options.out, block.refined(options.refine))
    made("block", options.out)


def _write_vdb(path: Path, block: FloatArray) -> None:
    everywhere = np.ones(block.shape[:3], bool)
    transform = Transform.uniform(1 / len(block))
    density = Grid.from_dense(
        "density",
        everywhere.astype(np.float32),
        everywhere,
        (0, 0, 0),
        transform=transform,
        grid_class="fog volume",
    )
    colour = Grid.from_dense("Cd", block, everywhere, (0, 0, 0), transform=transform)
    write_vdb(path, [density, colour])


def _write_npz(path: Path, block: FloatArray) -> None:
    with whole_file(path) as temporary:
        np.savez_compressed(temporary, Cd=block)
