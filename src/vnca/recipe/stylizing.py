"""Painting a sequence of smoke from Python: frames to iterate over, in files or in memory."""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from vnca.core import FloatArray
from vnca.core.errors import OptionError
from vnca.core.records import changed
from vnca.core.volume import Volume
from vnca.engine import compute_of
from vnca.io import with_fitted_scale
from vnca.io.sequence import find_frames
from vnca.painting import Painting, Roll, painted
from vnca.painting.chunk import Chunk, Chunking
from vnca.painting.frames import VelocityCheck, require_dense
from vnca.painting.painter import OnError
from vnca.recipe import SILENT, Watch, applied, tracked
from vnca.recipe.directing import directed, say_styles
from vnca.recipe.film import FilmConfig, Shown
from vnca.recipe.painting import StylizeRun, read_painted, run
from vnca.recipe.sequence import (
    open_sequence,
    placed,
    region_of,
    require_dense_enough,
    sequence_region,
    volumes,
)
from vnca.rule.model import Model


@dataclass(frozen=True, eq=False)
class PaintedFrame:
    """A frame of a painting, in a file or in memory.

    Attributes:
        number: That of the frame.
        path: Its file; None in memory.
    """

    number: int
    path: Path | None
    _load: Callable[[], Shown] = field(repr=False)

    @cached_property
    def shown(self) -> Shown:
        """What it takes to draw it; read from the file when it is first asked for."""
        return self._load()

    @property
    def volume(self) -> Volume:
        """Its painted density, on cells that lie where its matrix says."""
        return self.shown.smoke

    @property
    def density(self) -> FloatArray:
        """`[x, y, z]`, in the units of the smoke."""
        return self.shown.smoke.density

    @property
    def colour(self) -> FloatArray:
        """Linear RGB `[x, y, z, 3]` of the same cells."""
        return self.shown.colour


def stylize(
    model: str | Path | Model,
    sequence: str | Path | Volume | Iterable[Volume],
    *,
    out: str | Path | None = None,
    frames: str | None = None,
    refine: int = 1,
    colour_grid: str | Sequence[str] = "Cd",
    preview: str | Path | None = None,
    gamma: float | None = None,
    density_scale: float | None = None,
    backend: str = "auto",
    device: str = "auto",
    precision: str = "float32",
    resume: bool = False,
    overwrite: bool = False,
    on_error: OnError = "stop",
    film: FilmConfig | Mapping[str, Any] | None = None,
    chunking: Chunking | Mapping[str, Any] | None = None,
    watch: Watch = SILENT,
    **options: Any,
) -> Iterator[PaintedFrame]:
    """Paint a sequence of smoke, one frame each time the iterator is asked for the next.

    Whoever stops asking ends the painting; in a folder it can then be resumed.

    Args:
        model: What `train` returned, or the path of a model or of the folder of a run.
        sequence: A folder, a pattern (`smoke_####.vdb`) or a file; or volumes in order.
        out: Folder for the painted files. Unless given, frames are kept in memory while they are
            used.
        frames: Which frames of a sequence in files, such as `30-53`; all unless given.
        refine: Paint on a grid so many times as fine as the smoke's.
        colour_grid: Name or names under which files hold the colour.
        preview: A film of the painting: mp4, gif or webp.
        gamma: Extinction of density 1, per cell of the smoke; that of the training unless given.
        density_scale: Density that counts as 1; that of the training frame unless given.
        backend: What computes the automaton.
        device: Where to compute: `auto`, `cpu`, `cuda`, or such as `cuda:1`.
        precision: What the native kernel rounds the factors of its products to.
        resume: Go on with a painting in `out` that was ended early.
        overwrite: Replace painted frames that `out` holds; with `resume`, where those are of
            another painting.
        on_error: With a file that cannot be read: `stop`, `skip` it, or `hold` the frame before.
        film: How the preview is filmed: a `FilmConfig`, or some of its fields.
        chunking: Which of the frames are painted, apart from the others: a `Chunking`, or some of
            its fields, as `{"chunk": "9-16"}`.
        watch: Is told how far it has come, and may cancel.
        **options: Fields of `SmokeFormat`, in the place of those that the training recorded, and of
            `StylizeConfig`.

    Raises:
        VncaError: At once if an input cannot be used or the output cannot be written; while
            painting, if a frame cannot be read or written.
    """
    name, model, smoke, config = applied(model, options)
    if isinstance(sequence, Volume):
        sequence = [sequence]
    asked = StylizeRun(
        model=name,
        sequence=str(sequence) if isinstance(sequence, (str, Path)) else "",
        out=Path(out or ""),
        frames=frames,
        colour_grid=(colour_grid,) if isinstance(colour_grid, str) else tuple(colour_grid),
        preview=None if preview is None else Path(preview),
        refine=refine,
        gamma=gamma,
        density_scale=density_scale,
        backend=backend,
        device=device,
        precision=precision,
        resume=resume,
        overwrite=overwrite,
        on_error=on_error,
        smoke=smoke,
        config=config,
        film=changed("film", FilmConfig(), film),
        chunking=changed("chunking", Chunking(), chunking),
    )
    if out is not None:
        if not isinstance(sequence, (str, Path)):
            raise OptionError("`out`: volumes have no files to be painted beside; leave it out")
        return _from_files(asked, run(asked, watch, model))
    for option in ("preview", "resume", "overwrite", "chunking"):
        if getattr(asked, option) not in (None, False, Chunking()):
            raise OptionError(f"`{option}`: needs a folder for the painting as `out`")
    if isinstance(sequence, (str, Path)):
        return _in_memory(asked, model, None, watch)
    if frames is not None:
        raise OptionError("`frames`: chooses among files; give the volumes that are wanted")
    return _in_memory(asked, model, [*sequence], watch)


def _from_files(options: StylizeRun, paths: Iterator[Path | None]) -> Iterator[PaintedFrame]:
    with closing(paths):  # type: ignore[type-var]
        sources = find_frames(options.sequence, options.frames)
        chunk = Chunk.of(sources, options.chunking)
        sources = sources[chunk.first : chunk.stop]
        for source, path in zip(sources, paths, strict=True):
            if path is not None:
                load = partial(read_painted, path, source.path, options)
                yield PaintedFrame(source.number, path, load)


def _in_memory(
    options: StylizeRun, model: Model, given: Sequence[Volume] | None, watch: Watch
) -> Iterator[PaintedFrame]:
    """What paints a sequence of files, or volumes, and keeps nothing."""
    rule = model.rule.rescaled(density=options.density_scale, gamma=options.gamma)
    sequence, smoke = None, options.smoke
    if given is None:
        sequence = open_sequence(options.sequence, options.frames, watch)
        smoke = with_fitted_scale(options.smoke, sequence)
        region = sequence_region(sequence, smoke, watch)
        require_dense_enough(sequence, smoke, rule.scales.density)
        check = VelocityCheck(rule, smoke, watch.note)
        count, read = len(sequence), volumes(sequence, smoke, region.lattice, check)
    else:
        laid, region = region_of(given)
        densities = (volume.density_field.values for volume in laid)
        require_dense(densities, rule.scales.density, "`sequence`")
        check = VelocityCheck(rule, smoke, watch.note)
        count, read = len(laid), check.watched(laid, [None] * len(laid))
    rule = placed(rule, region, watch)
    compute = compute_of(options.backend, options.device, options.precision)
    roll = Roll(rule, options.config, region.box, compute)
    roll = directed(roll, model, options.refine, sequence, smoke).roll
    say_styles(model, options.config, watch)
    refined = rule.refined(options.refine)

    def frame(painting: Painting) -> PaintedFrame:
        smoke = dataclasses.replace(painting.smoke, density=painting.density)
        shown = Shown(smoke, painting.colour, refined.scales.extinction(smoke.cell_length))
        return PaintedFrame(smoke.frame, None, lambda: shown)

    return map(frame, tracked(painted(read, roll), watch, "painting", count, "frames"))
