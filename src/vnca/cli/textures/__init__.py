"""`vnca texture {train,bake,volume,turntable,film}`: textures, solid for meshes, and flat."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from vnca.cli.options import parse, run_subcommand
from vnca.cli.terminal import Progress, made, say, tracked
from vnca.core import FloatArray
from vnca.core.errors import OptionError
from vnca.core.files import whole_file, writable_file
from vnca.core.records import changed_fields
from vnca.engine import Compute, compute_of
from vnca.io.film import SUFFIXES as FILMS
from vnca.io.film import FilmWriter
from vnca.io.mesh import Mesh, read_mesh
from vnca.io.mesh.texture import put_on, write_coloured
from vnca.io.picture import SUFFIXES as PICTURES
from vnca.io.picture import to_srgb8, write_image
from vnca.io.smoke_format import UpAxis
from vnca.io.vdb import Grid, Transform, write_vdb
from vnca.meshes.atlas import Placement, Unwrap, bake, to_png, unwrapped
from vnca.meshes.turntable import Shader, Turntable, TurntableConfig, solid, textured
from vnca.painting.block import KIND, LARGEST, SMALLEST, Block, grow
from vnca.rule import Rule
from vnca.rule.model import Model
from vnca.rule.paint import require_refinement
from vnca.rule.styles import alone, style_number

COMMANDS = {
    "train": "learn a texture from one picture, solid or flat",
    "bake": "put a solid texture on a mesh",
    "volume": "write the block of a solid texture as a volume",
    "turntable": "film a textured mesh while it turns",
    "film": "film a flat texture, or write its pictures",
}
_HOMES = {
    "train": "train:run_texture",
    **{name: f"textures:run_{name}" for name in ("bake", "volume", "turntable")},
    "film": "textures.film:run",
}
BAKED = (".glb", ".ply")
VOLUMES = (".vdb", ".npz")


def run(arguments: Sequence[str]) -> None:
    """Run one of the subcommands."""
    purpose = "Grow textures: solid ones, to put on meshes, and flat ones, to film."
    run_subcommand("texture", purpose, COMMANDS, _HOMES, arguments)


@dataclass(frozen=True)
class GrowthConfig:
    """How a texture is grown."""

    steps: int = 96
    """Steps of the automaton from nothing to the texture."""
    steps_per_frame: int | None = None
    """Steps between two pictures of a texture that changes; the rule's own pace unless given."""
    style: str | None = None
    """Of a model of several styles, the one that is grown, by name or number; the first unless
    given."""
    seed: int = 0
    """Same seed, same machine, same block."""
    backend: str = "auto"
    """What computes the automaton."""
    device: str = "auto"
    """Where: auto, cpu, cuda, or as cuda:1."""

    def __post_init__(self) -> None:
        Compute(self.backend)
        if self.steps < 1:
            raise OptionError(f"--steps {self.steps}: at least 1 is needed")
        if self.steps_per_frame is not None and self.steps_per_frame < 0:
            raise OptionError(f"--steps-per-frame {self.steps_per_frame}: must not be negative")


@dataclass(frozen=True)
class BlockConfig(GrowthConfig):
    """The block that is grown."""

    block: int = 128
    """Cells along an edge of the block; the larger, the later the pattern repeats."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not SMALLEST <= self.block <= LARGEST:
            raise OptionError(f"--block {self.block}: must be from {SMALLEST} to {LARGEST} cells")


def texture_rule(path: Path, style: str | None = None) -> Rule:
    """The rule of a solid texture.

    Raises:
        VncaError: If the model cannot be read, is of a flat texture, or has no such style.
    """
    model = texture_model(path, style)
    if model.training.get("dimensions") == 2:
        raise OptionError(f"{path}: is a flat texture, to be filmed (vnca texture film)")
    return model.rule


def texture_model(path: Path, style: str | None = None) -> Model:
    """A model, in a style of several; says so if it was not trained as a texture.

    Raises:
        VncaError: If it cannot be read, or has no such style.
    """
    model = Model.load(path)
    number = 0 if style is None else style_number(model, style, "style")
    if style is None and model.style_names:
        listed = ", ".join(f"{n} {name}" for n, name in enumerate(model.style_names, 1))
        say(f"growing the first of the styles {listed}; --style asks for another")
    model = alone(model, number)
    if model.training.get("kind") != KIND:
        say(f"{path}: was trained on smoke, not as a texture (vnca texture train)")
    return model


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
            compute=compute_of(config.backend, config.device),
            watch=lambda: progress.show(next(steps)),
        )
        for _ in range(count):
            yield next(blocks)


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
    grow: BlockConfig = field(default_factory=BlockConfig)
    """How the block is grown."""

    def __post_init__(self) -> None:
        if self.out.suffix.lower() not in BAKED:
            raise OptionError(f"--out {self.out}: expected a name ending in .glb or .ply")
        if not 64 <= self.size <= 8192 or self.size & (self.size - 1):
            raise OptionError(f"--size {self.size}: expected a power of two, 64 to 8192")
        if not 0 < self.scale < np.inf:
            raise OptionError(f"--scale {self.scale}: must be positive")
        if self.animate < 0:
            raise OptionError(f"--animate {self.animate}: must not be negative")
        if self.animate and self.out.suffix.lower() != ".glb":
            raise OptionError(f"--animate {self.animate}: a PLY file has no texture; use .glb")


def run_bake(arguments: Sequence[str]) -> None:
    """Read the options and bake.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    options = parse("texture bake", Bake, arguments)
    writable_file(options.out)
    rule = texture_rule(options.model, options.grow.style)
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
    colours = [to_srgb8(block.at(place(s.points))) for s in mesh.surfaces]
    write_coloured(options.out, mesh, colours)


def _frame(out: Path, number: int) -> Path:
    return out.with_name(f"{out.stem}_{number:04d}.png")


@dataclass(frozen=True)
class BlockVolume:
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
        if self.out.suffix.lower() not in VOLUMES:
            raise OptionError(f"--out {self.out}: expected a name ending in .vdb or .npz")
        require_refinement(self.refine)


def run_volume(arguments: Sequence[str]) -> None:
    """Read the options and write the block."""
    options = parse("texture volume", BlockVolume, arguments)
    writable_file(options.out)
    (block,) = grown_blocks(texture_rule(options.model, options.grow.style), options.grow)
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
    film: TurntableConfig = field(default_factory=TurntableConfig)
    """How it is filmed."""
    grow: BlockConfig = field(default_factory=BlockConfig)
    """With --model: how the block is grown. 0 steps a frame for a texture that stands still."""

    def __post_init__(self) -> None:
        if self.out.suffix.lower() not in (*FILMS, *PICTURES):
            raise OptionError(
                f"--out {self.out}: expected a film ({', '.join(FILMS)}) or a picture "
                f"({', '.join(PICTURES)})"
            )
        given = changed_fields(self.film, TurntableConfig())
        of_films = [name for name in ("turn", "fps", "frames") if name in given]
        if of_films and self.out.suffix.lower() not in FILMS:
            raise OptionError(f"`film.{of_films[0]}`: a picture has none; --out {self.out}")
        grown = changed_fields(self.grow, BlockConfig()) + ["scale"] * (self.scale != 1)
        if grown and self.model is None:
            raise OptionError(f"`{grown[0]}`: shapes the texture of a model; name one with --model")


def run_turntable(arguments: Sequence[str]) -> None:
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
    rule = texture_rule(options.model, options.grow.style)
    place = Placement.of(mesh, size=options.grow.block, scale=options.scale)
    if options.grow.steps_per_frame == 0:
        (block,) = grown_blocks(rule, options.grow)
        yield from repeat(solid(table, place, block))
        return
    for block in grown_blocks(rule, options.grow, frames):
        yield solid(table, place, block)
