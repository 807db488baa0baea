"""`vnca paint`, the whole job, and two of its parts: `vnca stylize` and `vnca render`."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from vnca.cli.options import is_given, parse
from vnca.cli.terminal import Terminal, finishing
from vnca.direction import Direction
from vnca.direction.shot import SUFFIX as SHOT
from vnca.direction.shot import Shot
from vnca.io import SmokeFormat
from vnca.painting import StylizeConfig
from vnca.ranks import launched
from vnca.recipe import SILENT, paint, painting, recorded_smoke, rendering
from vnca.recipe.film import FilmConfig
from vnca.rule.model import Model


@dataclass(frozen=True, kw_only=True)
class Paint(paint.PaintRun):
    """Paint a smoke sequence in the style of a picture: train, stylize and film in one go.

    Or as a file has it: vnca paint shot.toml. `vnca train`, `vnca stylize` and `vnca render` take
    more options one by one.
    """

    sequence: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SMOKE")]
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    picture: Annotated[tyro.conf.Positional[Path | None], tyro.conf.arg(metavar="PICTURE")] = None
    """The picture to learn from (docs/guide/formats.md lists the formats); or a model that has
    learned already, a file or the folder of a run."""
    style: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """A style of the library in the place of a picture (vnca styles lists them): it paints at
    once, without training."""
    preset: Annotated[str, tyro.conf.arg(metavar="NAME|FILE")] = "draft"
    """How the rule is trained: draft, standard, paper, or a TOML file."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    direction: Direction = field(default_factory=Direction)
    """What is asked of the painting."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and do the whole job; SIGTERM ends it once a piece of it is finished."""
    shot = None
    if arguments and Path(arguments[0]).suffix == SHOT:
        shot, arguments = Shot.load(arguments[0]), arguments[1:]
    options = _asked(shot, arguments, SmokeFormat())
    smoke = paint.recorded_format(options)
    if smoke != options.smoke:
        options = _asked(shot, arguments, smoke)
    options.require_one_style()
    ranks = launched()
    with finishing() as stop_if_asked:
        for _ in paint.run(options, Terminal(stop_if_asked) if ranks.leads else SILENT, ranks):
            pass


def _asked(shot: Shot | None, arguments: Sequence[str], smoke: SmokeFormat) -> Paint:
    """The options of a shot, if there is one, in the place of which stand those of the line.

    Args:
        shot: The shot.
        arguments: The others.
        smoke: How smoke is read unless something else is asked.
    """
    missing: Any = tyro.MISSING
    default = Paint(sequence=missing, out=missing, smoke=smoke)
    if shot is None:
        return parse(paint.COMMAND, Paint, arguments, default=default)
    default = shot.applied(default)
    if is_given(arguments, "--without-film"):
        default = dataclasses.replace(default, film=FilmConfig())
    options = parse(paint.COMMAND, Paint, arguments, default=default)
    if options.style != default.style:
        return dataclasses.replace(options, picture=None)
    if options.picture != default.picture:
        return dataclasses.replace(options, style=None)
    return options


@dataclass(frozen=True, kw_only=True)
class Stylize(painting.StylizeRun):
    """Paint a smoke sequence with a trained rule."""

    model: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="MODEL")]
    """A model file, or the folder of a training run."""
    sequence: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SEQUENCE")]
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""
    config: StylizeConfig = field(default_factory=StylizeConfig)
    """How the rule is applied."""


def run_stylize(arguments: Sequence[str]) -> None:
    """Read the options and paint; smoke is read as for training unless options say otherwise.

    SIGTERM ends it once a frame is finished.
    """
    options = parse("stylize", Stylize, arguments)
    model = Model.load(options.model)
    smoke = recorded_smoke(options.model, model)
    if smoke is not None:
        missing: Any = tyro.MISSING
        defaults = Stylize(model=missing, sequence=missing, out=missing, smoke=smoke)
        options = parse("stylize", Stylize, arguments, default=defaults)
    ranks = launched()
    with finishing() as stop_if_asked:
        watch = Terminal(stop_if_asked) if ranks.leads else SILENT
        for _ in painting.run(options, watch, model, ranks):
            pass


@dataclass(frozen=True, kw_only=True)
class Render(rendering.RenderRun):
    """Make a film or a turntable of a sequence, painted or not, or a picture of each frame."""

    sequence: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SEQUENCE")]
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""


def run_render(arguments: Sequence[str]) -> None:
    """Read the options and render."""
    rendering.run(parse("render", Render, arguments), Terminal())
