"""The command line: subcommands, and what each of them is for."""

import os
import sys
from collections.abc import Sequence

import vnca
from vnca.cli.help import ASKED, JSON_PROGRESS
from vnca.cli.options import command_at, spelled_out, usage
from vnca.cli.terminal import as_options, end_line, event, json_events, terminable
from vnca.core.errors import OptionError, Terminated, TextError, VncaError
from vnca.ranks import ended, give_up, launched

COMMANDS = {
    "paint": "paint a sequence in the style of a picture: train, stylize and film in one go",
    "styles": "list the styles that paint without training",
    "demo": "simulate, train, stylize and film a small plume, from nothing",
    "simulate": "write a smoke simulation to play with",
    "train": "learn a rule from one frame of smoke and one picture",
    "stylize": "paint a smoke sequence with a trained rule",
    "texture": "grow textures: solid ones to put on meshes, flat ones to film",
    "evaluate": "measure how well a rule paints a sequence, in a report",
    "ablate": "train without parts of the method, and measure what these do",
    "compare": "paint the same smoke with several methods, and judge them alike",
    "peers": "stylize smoke with other published methods, to compare with",
    "render": "make a film or a turntable of a sequence",
    "view": "watch rules paint, live in a browser",
    "farm": "write a job that trains, paints and films shots on many machines",
    "sweep": "train on a table of pictures, settings and seeds, in a report",
    "plan": "predict what painting a sequence takes, from its headers",
    "bench": "time steps, training and painting on this machine",
    "info": "describe a volume file, a model or a training run",
}
HOMES = {name: f"{name}:run" for name in COMMANDS} | {
    "styles": "info:run_styles",
    "stylize": "paint:run_stylize",
    "texture": "textures:run",
    "render": "paint:run_render",
    "ablate": "evaluate:run_ablate",
    "sweep": "farm:run_sweep",
    "plan": "farm:run_plan",
}
"""The function of each command, as `module:function` of this package."""
SHARED = ("paint", "stylize")
"""What several ranks of MPI do together."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a subcommand; the exit code is 2 where the user can mend what went wrong.

    Ctrl-C ends it with code 130, SIGTERM with 143.

    What a subcommand needs is imported only when it is called, so that `vnca info` never waits for
    torch.
    """
    # On a machine that is busy, threads that spin while they wait cost several times the work.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    words = spelled_out(sys.argv[1:] if arguments is None else arguments)
    try:
        try:
            with json_events(wanted=JSON_PROGRESS in words):
                code = _call([word for word in words if word != JSON_PROGRESS])
        finally:
            sys.stdout.flush()
        return ended(code)
    except BrokenPipeError:
        # The reader of our output went away, as `head` does; Python would complain at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _call(arguments: Sequence[str]) -> int:
    if not arguments or arguments[0] in (*ASKED, "help"):
        print(usage("vnca", "Turn smoke simulations into moving paintings.", COMMANDS))
        return 0 if arguments else 2
    name, *rest = arguments
    if name in ("-V", "--version"):
        print(f"vnca {vnca.__version__}")
        return 0
    if name not in COMMANDS:
        return _failed(f"'{name}' is not a command; expected one of {', '.join(COMMANDS)}")
    try:
        if launched().size > 1 and name not in SHARED:
            raise OptionError(f"mpirun: ranks share {' and '.join(SHARED)} alone, not {name}")
        with terminable():
            command_at(HOMES[name])(rest)
    except TextError as error:
        return _failed(str(error), error.pointer)
    except VncaError as error:
        return _failed(str(error))
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("vnca"):
            raise
        return _failed(f"'vnca {name}' needs {error.name}: pip install 'vnca[train]'")
    except MemoryError as error:
        return _failed(f"'vnca {name}' ran out of memory ({error}); give it less to hold at once")
    except KeyboardInterrupt as stop:
        code = 143 if isinstance(stop, Terminated) else 130
        if not event("error", message="stopped", exit_code=code):
            print(file=sys.stderr)
        return code
    except Exception as fault:
        event("error", message=f"a fault of vnca: {fault!r}", exit_code=1)
        raise
    return 0


def _failed(message: str, shown: Sequence[str] = ()) -> int:
    """Say what went wrong; and below it, on a terminal, the text in which it did."""
    end_line()
    # What a library says of a damaged file may have several lines.
    line = as_options(" ".join(message.split()))
    give_up(line)
    if not event("error", message=line, exit_code=2):
        print(f"vnca: {line}\n", end="", file=sys.stderr)  # whole, where several write there
        for each in shown:
            print(f"  {each}", file=sys.stderr)
    return 2
