"""A page on which rules paint a sequence while one looks: served to this machine, or as a site."""

import json
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path

from vnca.core.errors import OptionError, OutputError
from vnca.core.lattice import Region
from vnca.core.volume import Volume
from vnca.io import SmokeFormat, with_fitted_scale
from vnca.io.sequence import FrameSequence
from vnca.recipe import Watch, load, recorded_smoke, tracked
from vnca.recipe.sequence import (
    beside,
    open_sequence,
    read_alone,
    region_of,
    sequence_region,
    volumes,
)
from vnca.recipe.simulation import simulate
from vnca.rule.conditioning import conditioning_named
from vnca.rule.library import load_style, style_bytes, style_names, style_thumbnail
from vnca.rule.model import CONFIG_NAME, MODEL_NAME, Model
from vnca.rule.styles import alone
from vnca.viewer import RUN_NAME, SMOKE_NAME, Show, ShownRule, contents, model_name
from vnca.viewer.server import Content, PageServer
from vnca.viewer.site import export
from vnca.viewer.smoke_file import write_smoke_file
from vnca.viewer.training_run import progress, untaught

FIRST_STYLE = "stained_glass"
"""The style that paints where no model is given."""
_RESOLUTION, _FRAMES = 32, 40  # of the plume that is simulated where no sequence is given


@dataclass(frozen=True, kw_only=True)
class ViewRun:
    """Watch rules paint smoke, live in a browser with WebGPU."""

    model: str | None = None
    """A model file, the folder of a run, or a style of the library; the others can be chosen on the
    page."""
    sequence: str | None = None
    """A folder, a pattern or a file; of a model in the folder of its run the frame of the training
    unless given, else a plume that is simulated."""
    frames: str | None = None
    """Frames to show, such as 30-53 or 1,4,7-9; all unless given."""
    export: Path | None = None
    """Folder for a site that any web server can hold, in the place of serving the page here."""
    page_fps: float = 24.0
    """Frames a second at which the page plays."""
    port: int = 0
    """Port of the page on this machine; any free one unless given."""
    browser: bool = True
    """Open the page in the browser."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""

    def __post_init__(self) -> None:
        if not 0 < self.page_fps < inf or self.page_fps > 1000:
            raise OptionError(f"`page_fps` {self.page_fps}: must be positive, at most 1000")
        if not 0 <= self.port < 65536:
            raise OptionError(f"`port` {self.port}: must be from 0 to 65535")


def run(options: ViewRun, watch: Watch, opened: Callable[[str], None]) -> None:
    """Write the site, or serve the page until Ctrl-C.

    Args:
        options: What to show.
        watch: Is told how far it has come.
        opened: Is given the address of the page once it is there.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    shown = _shown(options, watch)
    if options.export is not None:
        export(shown.show, options.export, shown.write_smoke)
        watch.made("site", options.export)
        return
    folder = Path(options.model or "")
    run_folder = folder if (folder / CONFIG_NAME).exists() else None
    with _served(shown, options.port, run_folder) as server:
        opened(server.address)
        server.wait()


@contextmanager
def training_watched(
    run_folder: Path, frame: Path, smoke: SmokeFormat, watch: Watch, opened: Callable[[str], None]
) -> Iterator[None]:
    """A page on which a training can be watched that goes on while the context lasts.

    Args:
        run_folder: Where it writes its model and curves.
        frame: What it is trained on.
        smoke: How that is read.
        watch: Is told what happens.
        opened: Is given the address of the page once it is there.

    Raises:
        VncaError: If the frame cannot be read.
    """
    laid, region = region_of([read_alone(frame, beside(frame, smoke), watch)])
    rule = ShownRule(run_folder.resolve().name, "the rule as it learns", b"")
    shown = _Shown(Show(frame.stem, [rule, *_library(FIRST_STYLE)], {}), laid, region, 24.0)
    with _served(shown, 0, run_folder) as server:
        opened(server.address)
        yield


@dataclass(frozen=True)
class _Shown:
    """What a page shows: its frames can be gone through again."""

    show: Show
    frames: Iterable[Volume]
    region: Region
    fps: float

    def write_smoke(self, path: Path) -> None:
        """The sequence, for the page."""
        write_smoke_file(path, self.frames, self.region, name=self.show.title, fps=self.fps)


@contextmanager
def _served(shown: _Shown, port: int, run_folder: Path | None) -> Iterator[PageServer]:
    """A page that is served while the context lasts; of a run with how it goes on.

    Raises:
        OutputError: If the port is taken.
    """
    with tempfile.TemporaryDirectory(prefix="vnca-view-") as folder:
        smoke = Path(folder) / SMOKE_NAME
        shown.write_smoke(smoke)
        show = replace(shown.show, run=run_folder is not None)
        files: dict[str, Content] = {**contents(show), SMOKE_NAME: smoke}
        if run_folder is not None:
            density = next(iter(shown.frames)).density_field.values
            blank = untaught(density, Path(folder) / MODEL_NAME)
            files |= _of_run(run_folder, blank)
        try:
            server = PageServer(files, port=port)
        except OSError as error:
            raise OutputError(f"`port` {port}: cannot be listened on ({error.strerror})") from error
        try:
            yield server
        finally:
            server.close()


def _of_run(folder: Path, blank: bytes) -> dict[str, Content]:
    """The files of a page that change while a training goes on."""
    path = folder / MODEL_NAME

    def model() -> bytes:
        if not path.exists():
            return blank
        several = Model.load(path, to_describe=True).style_names
        return alone(Model.load(path)).encoded() if several else path.read_bytes()

    return {model_name(0): model, RUN_NAME: lambda: progress(folder)}


def _shown(options: ViewRun, watch: Watch) -> _Shown:
    given, smoke = _given(options)
    rules = _rules(given, options)
    asked = options.sequence or (None if given is None else _training_frame(options.model))
    if asked is None:
        if smoke.fields:
            raise OptionError(
                f"`sequence`: a plume that is simulated has no {', '.join(smoke.fields)}, as "
                f"{options.model or '`smoke.fields`'} asks for; name a sequence that has"
            )
        watch.note("no sequence given: a plume is simulated")
        frames = [*simulate("plume", resolution=_RESOLUTION, frames=_FRAMES, watch=watch)]
        laid, region = region_of(frames)
        return _Shown(Show("a plume", rules, {}), laid, region, options.page_fps)
    sequence = open_sequence(asked, options.frames, watch)
    smoke = with_fitted_scale(smoke, sequence)
    region = sequence_region(sequence, smoke, watch)
    title = sequence[0].path.parent.name if len(sequence) > 1 else sequence[0].path.stem
    frames = _Frames(sequence, smoke, region, watch)
    return _Shown(Show(title, rules, {}), frames, region, options.page_fps)


@dataclass(frozen=True)
class _Frames:
    """The frames of files, read anew each time they are gone through."""

    sequence: FrameSequence
    smoke: SmokeFormat
    region: Region
    watch: Watch

    def __iter__(self) -> Iterator[Volume]:
        read = volumes(self.sequence, self.smoke, self.region.lattice)
        return tracked(read, self.watch, "reading", len(self.sequence), "frames")


def _given(options: ViewRun) -> tuple[Model | None, SmokeFormat]:
    """The model that is asked for by its path, and how smoke is read for it."""
    if options.model is None or options.model in style_names():
        return None, options.smoke
    model = load(options.model)
    recorded = recorded_smoke(Path(options.model), model)
    # What is asked for counts; what was recorded stands for what is not.
    smoke = recorded if recorded and options.smoke == SmokeFormat() else options.smoke
    told = model.rule.config.conditioning
    needed = (name for name in told if conditioning_named(name).scale is not None)
    return model, replace(smoke, fields=tuple(dict.fromkeys((*smoke.fields, *needed))))


def _training_frame(model: str | None) -> str | None:
    """The frame that a run was trained on, where its folder tells and it is still there."""
    folder = Path(model or "")
    try:
        frame = json.loads((folder / CONFIG_NAME).read_text())["inputs"]["frame"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return frame if isinstance(frame, str) and Path(frame).exists() else None


def _rules(given: Model | None, options: ViewRun) -> list[ShownRule]:
    """The model that is asked for, and the styles of the library."""
    first = options.model if given is None and options.model else FIRST_STYLE
    rules = _library(first)
    if given is None:
        return rules
    path = Path(options.model or "")
    path = path / MODEL_NAME if path.is_dir() else path
    name = path.parent.resolve().name if path.name == MODEL_NAME else path.stem
    # The page mixes rules of a single style.
    parts = {f"{name}_{style}": alone(given, n) for n, style in enumerate(given.style_names)}
    several = [
        ShownRule(title, str(part.training.get("style", "")), part.encoded())
        for title, part in parts.items()
    ]
    sole = ShownRule(name, str(given.training.get("style", "")), path.read_bytes())
    return [*(several or [sole]), *rules]


def _library(first: str) -> list[ShownRule]:
    """The styles of the library, one of them before the others."""
    return [
        ShownRule(
            name,
            str(load_style(name).training.get("title", "")),
            style_bytes(name),
            style_thumbnail(name),
        )
        for name in sorted(style_names(), key=lambda name: name != first)
    ]
