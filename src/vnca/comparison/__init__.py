"""Methods side by side: each paints the same smoke after the same picture, and is judged alike.

A contender is `vnca`, one of `vnca.peers`, or a folder that something else has painted.
"""

import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import vnca
from vnca.bench import peak_mb
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import FileFormatError, OptionError
from vnca.core.files import existing_file, whole_file, writable_folder
from vnca.io import SmokeFormat
from vnca.io.picture import read_style, write_image
from vnca.io.sequence import FrameSequence
from vnca.peers.gram import grey_picture
from vnca.peers.methods import METHODS, method_named
from vnca.recipe import Watch, peers, recorded
from vnca.recipe.paint import PAINTED, PaintRun
from vnca.recipe.paint import run as paint

OURS = "vnca"
PICTURE = "picture.png"
"""In the folder: the picture, grey, as every method is given it."""
COST = "cost.json"
"""In the folder of a contender: what it was, and what it cost."""


@dataclass(frozen=True, kw_only=True)
class CompareRun:
    """Methods compared on the same smoke and the same picture."""

    sequence: str
    """A folder, a pattern (name_%04d.vdb, name_####.vdb, name.$F4.vdb, name_*.vdb) or a file."""
    picture: Path
    """The picture; it is made grey for all, as the other methods know no colour."""
    out: Path
    """Folder for the report, the films, and what each method paints."""
    methods: tuple[str, ...] = (OURS, "aurand", "lnst", "tnst")
    """What is compared: vnca, those of vnca peers list, or NAME=FOLDER of frames painted
    already."""
    frames: str | None = None
    """Frames to paint, such as 30-49; all unless given."""
    preset: str = "draft"
    """How the rule of vnca is trained: draft, standard, paper, or a TOML file."""
    features: str = "vgg16"
    """Network by which the other methods compare; see vnca peers run."""
    size: int = 224
    """Rows and columns of the pictures that are judged, pixels."""
    seed: int = 0
    """Same seed, same machine, same painting."""
    study: bool = False
    """Write a page, too, that asks people: unlabelled films in random order."""
    smoke: SmokeFormat = field(default_factory=SmokeFormat)
    """How smoke is read from files."""

    def __post_init__(self) -> None:
        if len(self.methods) < 1:
            raise OptionError("`methods`: at least one is needed")
        names = [name_of(method) for method in self.methods]
        if len(set(names)) < len(names):
            raise OptionError(f"`methods` {', '.join(names)}: expected each of them once")
        if self.size < 64:
            raise OptionError(f"`size` {self.size}: at least 64 pixels are needed")
        for method in self.methods:
            if "=" not in method and method != OURS:
                try:
                    method_named(method)
                except OptionError:
                    known = ", ".join([OURS, *METHODS])
                    raise OptionError(
                        f"`methods` {method}: expected {known}, or NAME=FOLDER"
                    ) from None


def name_of(method: str) -> str:
    """What a contender is called."""
    return method.partition("=")[0]


@dataclass(frozen=True)
class Contender:
    """A painted sequence.

    Attributes:
        name: What it is called.
        folder: Where its frames are.
        grey_is_density: Its picture is how much light its density gives, not its colour.
        seconds: To paint a frame, None where that is not known.
        training: Seconds before the first frame, None where there is no training.
        peak_mb: The most memory that it took.
    """

    name: str
    folder: Path
    grey_is_density: bool
    seconds: float | None = None
    training: float | None = None
    peak_mb: float | None = None


def contenders(options: CompareRun, sequence: FrameSequence, watch: Watch) -> list[Contender]:
    """Paint what is not painted yet, one method after the other.

    A method that an earlier call finished with the same options, on the same files, is not run
    again.

    Raises:
        VncaError: If an input cannot be used or the output cannot be written.
    """
    out = writable_folder(options.out)
    picture = read_style(options.picture)
    light = srgb_to_linear(grey_picture(picture)).astype(np.float32)
    write_image(out / PICTURE, np.repeat(light[..., None], 3, axis=-1))
    asked = _asked(options, sequence)
    return [_contender(method, options, asked, watch) for method in options.methods]


def _contender(method: str, options: CompareRun, asked: dict[str, Any], watch: Watch) -> Contender:
    name, given, folder = method.partition("=")
    if given:
        return _given(name, Path(folder))
    home = options.out / name
    done = _finished(home, asked)
    if done is None:
        watch.note(f"{name}: painting")
        done = (_ours if name == OURS else _peer)(name, home, options, watch)
        with whole_file(home / COST) as temporary:
            temporary.write_text(json.dumps({"asked": asked, **done}, indent=2) + "\n")
    else:
        watch.note(f"{name}: painted already")
    frames = home / PAINTED if name == OURS else home
    return Contender(
        name, frames, name != OURS, done["seconds"], done.get("training"), done["peak_mb"]
    )


def _given(name: str, folder: Path) -> Contender:
    if not name or not folder.is_dir():
        raise OptionError(f"`methods` {name}={folder}: there is no such folder of painted frames")
    record = folder / peers.RECORD
    if not record.exists():
        return Contender(name, folder, grey_is_density=False)
    told = peers.read_record(folder)
    return Contender(name, folder, True, told.get("seconds_per_frame"), None, told.get("peak_mb"))


def _asked(options: CompareRun, sequence: FrameSequence) -> dict[str, Any]:
    """What has to be the same for a painting not to be made again, as JSON values."""
    asked = recorded(options)
    for name in ("out", "methods", "size", "study"):
        del asked[name]
    files = [(path.name, path.stat()) for path in (options.picture, *(f.path for f in sequence))]
    asked["files"] = [[name, status.st_size, status.st_mtime_ns] for name, status in files]
    return json.loads(json.dumps({**asked, "vnca": vnca.__version__}))


def _finished(home: Path, asked: dict[str, Any]) -> dict[str, Any] | None:
    """What a finished painting cost; None where there is none, or another."""
    if not (home / COST).exists():
        return None
    path = existing_file(home / COST)
    try:
        told = json.loads(path.read_text())
        known = told["asked"] == asked
        return {name: told[name] for name in ("seconds", "training", "peak_mb")} if known else None
    except (ValueError, KeyError, TypeError) as error:
        raise FileFormatError(f"{path}: damaged ({error}); remove it") from error


def _peer(name: str, home: Path, options: CompareRun, watch: Watch) -> dict[str, Any]:
    method = method_named(name)
    asked = peers.PeersRun(
        sequence=options.sequence,
        picture=options.out / PICTURE,
        out=home,
        frames=options.frames,
        features=options.features,
        overwrite=True,
        smoke=options.smoke,
    )
    for _ in peers.run(asked, method.settings(seed=options.seed), watch):
        pass
    told = peers.read_record(home)
    return {"seconds": told["seconds_per_frame"], "training": None, "peak_mb": told["peak_mb"]}


class _Timed:
    """A watch that passes all on, and notes when painting began."""

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self.began: float | None = None

    def progress(self, what: str, done: int, total: int, unit: str, note: str = "") -> None:
        if what == "painting" and self.began is None:
            self.began = time.monotonic()
        self._watch.progress(what, done, total, unit, note)

    def note(self, line: str) -> None:
        self._watch.note(line)

    def made(self, what: str, path: Path) -> None:
        self._watch.made(what, path)


def _ours(name: str, home: Path, options: CompareRun, watch: Watch) -> dict[str, Any]:
    asked = PaintRun(
        sequence=options.sequence,
        picture=options.out / PICTURE,
        out=home,
        preset=options.preset,
        frames=options.frames,
        refine=1,
        seed=options.seed,
        device="cpu",
        overwrite=True,
        without_film=True,
        smoke=options.smoke,
    )
    timed, painted = _Timed(watch), []

    def work() -> None:
        painted.extend(paint(asked, timed))

    start = time.monotonic()
    memory = peak_mb(work, "cpu")
    end = time.monotonic()
    began = start if timed.began is None else timed.began
    return {
        "seconds": (end - began) / max(1, len(painted)),
        "training": began - start,
        "peak_mb": memory,
    }
