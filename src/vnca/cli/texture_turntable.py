"""`vnca texture turntable MESH --out FILM`."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from pathlib import Path
from typing import Annotated

import tyro

from vnca.cli.options import parse
from vnca.cli.progress import made, tracked
from vnca.cli.texture_block import BlockConfig, grown_blocks, texture_rule
from vnca.core.errors import OptionError
from vnca.core.files import writable_file
from vnca.io.film import SUFFIXES as FILMS
from vnca.io.film import FilmWriter
from vnca.io.mesh import Mesh, read_mesh
from vnca.io.picture import SUFFIXES as PICTURES
from vnca.io.picture import write_image
from vnca.io.smoke_format import UpAxis
from vnca.meshes.atlas import Placement
from vnca.meshes.turntable import Shader, Turntable, TurntableConfig, solid, textured


@dataclass(frozen=True)
class TurntableOptions:
    """Film a textured mesh while it turns."""

    mesh: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="MESH")]
    """A GLB file with a texture; with --model any mesh: GLB, OBJ, PLY or STL."""
    out: Path
    """A film (mp4, gif, webp), or a picture (png, jpg) of its beginning."""
    model: Path | None = None
    """Show the solid texture of this model as it changes, instead of the texture in the file."""
    scale: float = 1.0
    """With --model: how often the block repeats along the longest side of the mesh."""
    up_axis: UpAxis | None = None
    """The mesh's up axis; y for OBJ and GLB, z for PLY and STL unless given."""
    film: Annotated[TurntableConfig, tyro.conf.arg(name="")] = field(
        default_factory=TurntableConfig
    )
    """How it is filmed."""
    grow: Annotated[BlockConfig, tyro.conf.arg(name="")] = field(default_factory=BlockConfig)
    """With --model: how the block is grown. 0 steps a frame for a texture that stands still."""

    def __post_init__(self) -> None:
        if self.out.suffix.lower() not in (*FILMS, *PICTURES):
            raise OptionError(
                f"--out {self.out}: expected a film ({', '.join(FILMS)}) or a picture "
                f"({', '.join(PICTURES)})"
            )


def run(arguments: Sequence[str]) -> None:
    """Read the options and film."""
    options = parse("texture turntable", TurntableOptions, arguments)
    writable_file(options.out)
    mesh = read_mesh(options.mesh, options.up_axis)
    table = Turntable(mesh, options.film)
    is_film = options.out.suffix.lower() in FILMS
    frames = options.film.frames if is_film else 1
    shaders = zip(range(frames), _shaders(options, mesh, table, frames), strict=False)
    if not is_film:
        write_image(options.out, *(table.picture(*shown) for shown in shaders))
    else:
        with FilmWriter(options.out, options.film.fps) as film:
            # One that goes on changing shows its own progress.
            is_changing = options.model is not None and options.grow.steps_per_frame != 0
            for frame, shader in (
                shaders if is_changing else tracked(shaders, "filming", frames, "frames")
            ):
                film.add(table.picture(frame, shader))
    made("film", options.out)


def _shaders(
    options: TurntableOptions, mesh: Mesh, table: Turntable, frames: int
) -> Iterator[Shader]:
    """What each frame shows."""
    if options.model is None:
        yield from repeat(textured(table, mesh))
        return
    rule = texture_rule(options.model)
    place = Placement.of(mesh, size=options.grow.block, scale=options.scale)
    if options.grow.steps_per_frame == 0:
        (block,) = grown_blocks(rule, options.grow)
        yield from repeat(solid(table, place, block))
        return
    for block in grown_blocks(rule, options.grow, frames):
        yield solid(table, place, block)
