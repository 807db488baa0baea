"""`vnca texture bake MODEL MESH --out FILE`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from vnca.cli.options import parse, say
from vnca.cli.progress import made
from vnca.cli.texture_block import BlockConfig, grown_blocks, texture_rule
from vnca.core.errors import OptionError
from vnca.core.files import whole_file, writable_file
from vnca.io.mesh import Mesh, read_mesh
from vnca.io.mesh.texture import put_on, write_coloured
from vnca.io.picture import to_srgb8
from vnca.io.smoke_format import UpAxis
from vnca.meshes.atlas import Placement, Unwrap, bake, to_png, unwrapped
from vnca.painting.block import sample_block
from vnca.rule.rule import Rule

SUFFIXES = (".glb", ".ply")
MANY_FACES = 200_000
"""From here on a note says that unwrapping takes long."""


@dataclass(frozen=True)
class Bake:
    """Put a solid texture on a mesh."""

    model: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="MODEL")]
    """A model file, or the folder of a training run."""
    mesh: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="MESH")]
    """The mesh: GLB, OBJ, PLY or STL."""
    out: Path
    """A .glb file with the texture in it, or a .ply file with vertex colours."""
    size: int = 2048
    """Rows and columns of the texture, a power of two."""
    scale: float = 1.0
    """How often the block repeats along the longest side of the mesh."""
    animate: int = 0
    """Write so many pictures of the texture as it changes beside the mesh: OUT_0001.png and on."""
    unwrap: Unwrap = "auto"
    """Make UVs: auto keeps those there where they can be used, never insists on them."""
    up_axis: UpAxis | None = None
    """The mesh's up axis; y for OBJ and GLB, z for PLY and STL unless given."""
    grow: Annotated[BlockConfig, tyro.conf.arg(name="")] = field(default_factory=BlockConfig)
    """How the block is grown."""

    def __post_init__(self) -> None:
        if self.out.suffix.lower() not in SUFFIXES:
            raise OptionError(f"--out {self.out}: expected a name ending in .glb or .ply")
        if not 64 <= self.size <= 8192 or self.size & (self.size - 1):
            raise OptionError(f"--size {self.size}: expected a power of two, 64 to 8192")
        if not 0 < self.scale < np.inf:
            raise OptionError(f"--scale {self.scale}: must be positive")
        if self.animate < 0:
            raise OptionError(f"--animate {self.animate}: must not be negative")
        if self.animate and self.out.suffix.lower() != ".glb":
            raise OptionError(f"--animate {self.animate}: a PLY file has no texture; use .glb")


def run(arguments: Sequence[str]) -> None:
    """Read the options and bake."""
    bake_mesh(parse("texture bake", Bake, arguments))


def bake_mesh(options: Bake) -> None:
    """Bake as asked.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    writable_file(options.out)
    rule = texture_rule(options.model)
    mesh = read_mesh(options.mesh, options.up_axis)
    place = Placement.of(mesh, size=options.grow.block, scale=options.scale)
    if options.out.suffix.lower() == ".ply":
        _colour_vertices(options, rule, mesh, place)
    else:
        _bake(options, rule, mesh, place)
    made("textured", options.out)


def _bake(options: Bake, rule: Rule, mesh: Mesh, place: Placement) -> None:
    # Unwrapping can fail; growing, which takes longest, cannot.
    if mesh.face_count > MANY_FACES:
        say(f"{options.mesh}: {mesh.face_count} faces; without UVs, unwrapping takes long")
    atlas = unwrapped(mesh, options.unwrap, size=options.size)
    if atlas.fault is not None:
        say(f"{options.mesh}: its UVs cannot be used ({atlas.fault}); it gets new ones")
    kept = all(unwrapping.source is None for unwrapping in atlas.unwrappings)
    say(
        f"{len(mesh.surfaces)} surfaces, {mesh.face_count} faces, "
        f"{'their own UVs' if kept else 'new UVs'}, "
        f"{len(atlas.texels.texel) / options.size**2:.0%} of the texture used"
    )
    states = grown_blocks(rule, options.grow, max(options.animate, 1))
    for number, block in enumerate(states, 1):
        png = to_png(bake(block, atlas.texels, place))
        if number == 1:
            put_on(mesh, atlas.unwrappings, png)
            mesh.glb.write(options.out)
        if options.animate:
            with whole_file(_frame(options.out, number)) as temporary:
                temporary.write_bytes(png)


def _colour_vertices(options: Bake, rule: Rule, mesh: Mesh, place: Placement) -> None:
    (block,) = grown_blocks(rule, options.grow)
    colours = [to_srgb8(sample_block(block, place(s.points))) for s in mesh.surfaces]
    write_coloured(options.out, mesh, colours)


def _frame(out: Path, number: int) -> Path:
    return out.with_name(f"{out.stem}_{number:04d}.png")
