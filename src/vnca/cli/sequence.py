"""A sequence of smoke as the subcommands see it: frames, gaps told, box, volumes read ahead."""

import dataclasses
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from vnca.automaton.rule import SMOKE_THRESHOLD, density_scale
from vnca.cli.options import say
from vnca.errors import SequenceError, VncaError
from vnca.files import existing_file
from vnca.io.sequence import FrameSequence, find_frames, format_frames, frames_beside
from vnca.io.smoke import SmokeFormat, read_smoke, smoke_box, with_fitted_scale
from vnca.io.smoke_format import NO_VELOCITY
from vnca.stylize.ahead import read_ahead
from vnca.stylize.painter import BROKEN
from vnca.typing import Box
from vnca.volume import Volume


def open_sequence(pattern: str, frames: str | None) -> FrameSequence:
    """The frames of a pattern; gaps and sub-frames are told on standard error.

    Raises:
        SequenceError: If there are none.
    """
    sequence = find_frames(pattern, frames)
    if sequence.gaps:
        say(f"{pattern}: no file for frames {format_frames(sequence.gaps)}; going on without")
    if sequence.sub_frames:
        count, first = len(sequence.sub_frames), sequence.sub_frames[0].name
        say(f"{pattern}: leaving out {count} sub-frames ({first}, …); only whole frames are used")
    return sequence


def beside(path: Path, smoke: SmokeFormat) -> SmokeFormat:
    """`smoke` with its velocity scale, where it is to be fitted, from a frame and its neighbours.

    Raises:
        SequenceError: If there is no neighbour to fit to.
    """
    if smoke.velocity_scale != "fit":
        return smoke
    frames = frames_beside(existing_file(path))
    places = [at for at, frame in enumerate(frames) if frame.path == path]
    if not places:
        raise SequenceError(
            f"{path}: not a numbered frame, so --velocity-scale fit has no neighbour to fit to; "
            "set a number"
        )
    return with_fitted_scale(smoke, frames[max(0, places[0] - 1) : places[0] + 2])


def sequence_box(
    sequence: FrameSequence, smoke: SmokeFormat, *, without_broken: bool = False
) -> Box:
    """The box that holds the smoke of all frames, from the files' headers where they tell.

    Args:
        sequence: The frames.
        smoke: How they are read.
        without_broken: Pass over frames that cannot be read, unless none can.

    Raises:
        SequenceError: If no frame has smoke.
        FileFormatError: If a frame cannot be read.
        GridError: If one has no smoke to read.
    """
    box, broken = Box((0, 0, 0), (0, 0, 0)), 0
    for frame in sequence:
        found = _box_or_error(frame.path, smoke)
        if isinstance(found, Box):
            box = box.union(found)
            continue
        broken += 1
        if broken == len(sequence) or not without_broken:
            raise found
    if box.is_empty:
        raise SequenceError(
            f"{sequence[0].path.parent}: there is no smoke in any frame; "
            "choose others with --frames or another grid with --density-grid"
        )
    return box


def require_dense_enough(sequence: FrameSequence, smoke: SmokeFormat, scale: float) -> None:
    """Refuse a sequence of which nothing would be painted, as with densities in another unit.

    Reads frames up to the first that is dense enough; those that cannot be read are passed over.

    Args:
        sequence: The frames.
        smoke: How they are read.
        scale: The density that counts as 1.

    Raises:
        SequenceError: If no frame holds a cell that counts as smoke.
    """
    smoke = dataclasses.replace(smoke, velocity_grid=NO_VELOCITY)
    most, typical, is_read = 0.0, 0.0, False
    for frame in sequence:
        try:
            density = read_smoke(frame.path, smoke).density
        except BROKEN:
            continue
        is_read = True
        most = max(most, float(density.max(initial=0)))
        if most > SMOKE_THRESHOLD * scale:
            return
        if density.any():
            typical = max(typical, density_scale(density))
    if is_read:
        raise SequenceError(
            f"{sequence[0].path.parent}: nothing would be painted, as the greatest density of all "
            f"frames, {most:.3g}, is below {SMOKE_THRESHOLD:.0%} of the one that counts as 1, "
            f"{scale:.3g}; "
            + (f"try --density-scale {typical:.3g}" if most else "choose others with --frames")
        )


def _box_or_error(path: Path, smoke: SmokeFormat) -> Box | VncaError:
    try:
        return smoke_box(path, smoke)
    except BROKEN as error:
        return error


def volumes(sequence: FrameSequence, smoke: SmokeFormat) -> Iterator[Volume]:
    """The frames in order, the next one read while one is used."""
    loads = (partial(read_smoke, f.path, smoke, frame=f.number) for f in sequence)
    return read_ahead(loads)
