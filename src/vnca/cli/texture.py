"""`vnca texture {train,bake,volume,turntable}`: solid textures for meshes."""

import importlib
from collections.abc import Sequence

from vnca.errors import OptionError

COMMANDS = {
    "train": "learn a solid texture from one picture",
    "bake": "put a solid texture on a mesh",
    "volume": "write the block of a solid texture as a volume",
    "turntable": "film a textured mesh while it turns",
}


def run(arguments: Sequence[str]) -> None:
    """Run one of the subcommands, each a module of this package named after it.

    Raises:
        OptionError: If there is none of that name.
    """
    name, rest = (arguments[0], arguments[1:]) if arguments else ("", ())
    if name in ("-h", "--help"):
        print(_usage())
        return
    if name not in COMMANDS:
        raise OptionError(f"vnca texture: expected one of {', '.join(COMMANDS)}, got '{name}'")
    importlib.import_module(f"vnca.cli.texture_{name}").run(rest)


def _usage() -> str:
    lines = [f"  {name:10} {what}" for name, what in COMMANDS.items()]
    return "\n".join(
        [
            "usage: vnca texture COMMAND [OPTIONS]",
            "",
            "Grow solid textures and put them on meshes.",
            "",
            "commands:",
            *lines,
            "",
            "`vnca texture COMMAND --help` lists the options of a command.",
        ]
    )
