"""`vnca texture {train,bake,volume,turntable}`: solid textures for meshes."""

from collections.abc import Sequence

from vnca.cli.subcommands import run_subcommand

COMMANDS = {
    "train": "learn a solid texture from one picture",
    "bake": "put a solid texture on a mesh",
    "volume": "write the block of a solid texture as a volume",
    "turntable": "film a textured mesh while it turns",
}


def run(arguments: Sequence[str]) -> None:
    """Run one of the subcommands."""
    run_subcommand("texture", "Grow solid textures and put them on meshes.", COMMANDS, arguments)
