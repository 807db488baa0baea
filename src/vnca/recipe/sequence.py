"""A sequence of smoke in files: its frames, gaps, its box, volumes read ahead."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial, reduce
from itertools import product
from pathlib import Path

import numpy as np

from vnca.core import AnyArray, Box, FloatArray
from vnca.core.camera import world_box
from vnca.core.errors import GridError, SequenceError
from vnca.core.files import existing_file
from vnca.core.lattice import Lattice, Placement, Region
from vnca.core.volume import Volume
from vnca.io import SmokeFormat, read_smoke, smoke_extent, with_fitted_scale
from vnca.io.sequence import Frame, FrameSequence, find_frames, format_frames, frames_beside
from vnca.io.smoke_format import NO_VELOCITY, Extent, on_lattice, on_one_lattice
from vnca.painting.frames import VelocityCheck, read_ahead, require_dense
from vnca.painting.painter import BROKEN
from vnca.recipe import Watch
from vnca.rule import SMOKE_THRESHOLD, Rule, density_scale

LOOKED_AT = 12
"""Frames, at most, of which the one with the most smoke is chosen."""
MOST_APART = 30.0
"""Factor between the densities of frames trained on together, beyond which they are surely not in
the same units."""


def open_sequence(pattern: str | Path, frames: str | None, watch: Watch) -> FrameSequence:
    """The frames of a pattern; gaps and sub-frames go to `watch` as notes.

    Raises:
        SequenceError: If there are none.
    """
    sequence = find_frames(pattern, frames)
    if sequence.gaps:
        watch.note(
            f"{pattern}: no file for frames {format_frames(sequence.gaps)}; going on without"
        )
    if sequence.sub_frames:
        count, first = len(sequence.sub_frames), sequence.sub_frames[0].name
        watch.note(
            f"{pattern}: leaving out {count} sub-frames ({first}, …); only whole frames are used"
        )
    return sequence


def read_alone(path: Path, smoke: SmokeFormat, watch: Watch) -> Volume:
    """A frame on a lattice of its own; if its voxels are not those cells, a note says so.

    Raises:
        VncaError: If it cannot be read, or can have no place on a lattice.
    """
    volume = read_smoke(path, smoke)
    what = f"{path}: grid {smoke.density_grid!r}"
    lattice = Lattice.of(volume.index_to_world, what)
    place = Placement.between(volume.index_to_world, lattice.to_world, volume.box, what)
    if not place.is_whole:
        watch.note(_resampled(path, volume.index_to_world, lattice, others=0))
    return on_lattice(volume, lattice, what)


def frames_alone(
    paths: Sequence[Path],
    smoke: SmokeFormat,
    watch: Watch,
    volumes: Sequence[Volume] | None = None,
) -> list[Volume]:
    """Frames that a rule is trained on together, each on a lattice of its own.

    Args:
        paths: Their files, or what stands in their place.
        smoke: How they are read.
        watch: Is told of those whose voxels are not cells.
        volumes: The frames, if they need not be read.

    Raises:
        VncaError: If one cannot be read, can have no place on a lattice, or holds no smoke; if just
            some have a velocity; or if their densities are surely in different units.
    """
    if volumes is None:
        frames = [read_alone(path, smoke, watch) for path in paths]
    else:
        lattices = [Lattice.of(volume.index_to_world, "the frame") for volume in volumes]
        given = zip(volumes, lattices, strict=True)
        frames = [on_lattice(volume, lattice, "the frame") for volume, lattice in given]
    for path, frame in zip(paths, frames, strict=True):
        if not frame.density.any():
            raise GridError(
                f"{path}: there is no smoke in this frame to train on; choose a later one"
            )
    first, *others = frames
    for path, frame in zip(paths[1:], others, strict=True):
        if (frame.velocity is None) != (first.velocity is None):
            without = path if frame.velocity is None else paths[0]
            raise GridError(f"{without}: has no velocity, as another of the frames has")
        times = density_scale(frame.density) / density_scale(first.density)
        if not 1 / MOST_APART <= times <= MOST_APART:
            raise GridError(
                f"{path}: has {times:g} times the density of {paths[0]}; both have to be in the "
                "same units"
            )
    return frames


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
            f"{path}: not a numbered frame, so `velocity_scale` fit has no neighbour to fit to; "
            "set a number"
        )
    return with_fitted_scale(smoke, frames[max(0, places[0] - 1) : places[0] + 2])


def sequence_region(
    sequence: FrameSequence, smoke: SmokeFormat, watch: Watch, *, without_broken: bool = False
) -> Region:
    """The lattice of a sequence, and the box in it that holds the smoke of all frames.

    The lattice is that of the first frame with smoke; a note says so where others are interpolated
    to its cells. Only headers are read, where the files have what it takes in them.

    Args:
        sequence: The frames.
        smoke: How they are read.
        watch: Is told of frames that are interpolated.
        without_broken: Pass over frames that cannot be read, unless none can.

    Raises:
        SequenceError: If no frame has smoke.
        FileFormatError: If a frame cannot be read.
        GridError: If one has no smoke to read, or can have no place on the lattice.
    """
    lattice, box, broken = None, Box((0, 0, 0), (0, 0, 0)), 0
    resampled: list[tuple[Path, AnyArray]] = []
    for frame in sequence:
        try:
            extent = smoke_extent(frame.path, smoke)
            if extent.box.is_empty:
                continue
            what = f"{frame.path}: grid {smoke.density_grid!r}"
            lattice = lattice or Lattice.of(extent.index_to_world, what)
            covered, is_whole = _covered(extent, lattice, what)
        except BROKEN:
            broken += 1
            if broken == len(sequence) or not without_broken:
                raise
            continue
        box = box.union(covered)
        if not is_whole:
            resampled.append((frame.path, extent.index_to_world))
    if lattice is None:
        raise _without_smoke(sequence)
    if resampled:
        watch.note(_resampled(*resampled[0], lattice, others=len(resampled) - 1))
    return Region(lattice, box)


def fullest_frame(sequence: FrameSequence, smoke: SmokeFormat) -> Frame:
    """Of some frames, evenly spaced, the one with the most smoke.

    Raises:
        FileFormatError: If a frame cannot be read.
    """
    seen, last = replace(smoke, velocity_grid=NO_VELOCITY), len(sequence) - 1
    picked = sorted({round(at) for at in np.linspace(0, last, min(LOOKED_AT, len(sequence)))})

    def cells(at: int) -> int:
        density = read_smoke(sequence[at].path, seen).density_field.values
        return int(np.count_nonzero(density > SMOKE_THRESHOLD * density_scale(density)))

    return sequence[max(picked, key=cells)]


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
    smoke = replace(smoke, velocity_grid=NO_VELOCITY)
    require_dense(_densities(sequence, smoke), scale, str(sequence[0].path.parent))


def _densities(sequence: FrameSequence, smoke: SmokeFormat) -> Iterator[FloatArray]:
    for frame in sequence:
        with suppress(*BROKEN):
            yield read_smoke(frame.path, smoke).density_field.values


def _covered(extent: Extent, lattice: Lattice, what: str) -> tuple[Box, bool]:
    """The cells of a lattice that a frame has a part in, and whether its cells are those."""
    place = Placement.between(extent.index_to_world, lattice.to_world, extent.box, what)
    return place.box(extent.box), place.is_whole


def _resampled(path: Path, index_to_world: AnyArray, lattice: Lattice, *, others: int) -> str:
    sides = " × ".join(f"{side:g}" for side in np.linalg.norm(index_to_world[:3, :3], axis=0))
    also = f", as is that of {others} more" * (others > 0)
    return (
        f"{path}: its voxels, {sides}, are not the cells of the sequence's lattice, cubes of "
        f"{lattice.spacing:g}; its smoke is resampled to those{also}"
    )


def sequence_bounds(sequence: FrameSequence, smoke: SmokeFormat) -> tuple[AnyArray, AnyArray]:
    """The least and greatest corner of the world's box that holds the smoke of all frames.

    Files' headers are read, where they tell.

    Raises:
        SequenceError: If no frame has smoke.
        FileFormatError: If a frame cannot be read.
        GridError: If one has no smoke to read.
    """
    extents = [smoke_extent(frame.path, smoke) for frame in sequence]
    boxes = [region_bounds(*extent) for extent in extents if not extent.box.is_empty]
    if not boxes:
        raise _without_smoke(sequence)
    lower, upper = zip(*boxes, strict=True)
    return np.min(lower, axis=0), np.max(upper, axis=0)


def region_bounds(box: Box, index_to_world: AnyArray) -> tuple[AnyArray, AnyArray]:
    """The least and greatest corner of the world's box around cells, all of each cell inside."""
    lower, upper = (np.asarray(corner) - 0.5 for corner in box)
    return world_box(lower, upper, index_to_world)


def _without_smoke(sequence: FrameSequence) -> SequenceError:
    return SequenceError(
        f"{sequence[0].path.parent}: there is no smoke in any frame; "
        "choose others with `frames` or another grid with `density_grid`"
    )


def region_of(given: Iterable[Volume]) -> tuple[list[Volume], Region]:
    """Volumes as they lie on one lattice, and what of it holds the smoke of them all.

    Raises:
        SequenceError: If there is no smoke in any.
        GridError: If one can have no place on the lattice.
    """
    laid = [*on_one_lattice(given)]
    smoke = [volume for volume in laid if volume.density_field.values.any()]
    if not smoke:
        raise SequenceError("`sequence`: there is no smoke in any of the volumes")
    box = reduce(Box.union, (volume.box for volume in smoke))
    return laid, Region(Lattice(smoke[0].index_to_world), box)


def placed(rule: Rule, region: Region, watch: Watch) -> Rule:
    """A rule as it is for a region: apart from where it was trained, that has positions of its own.

    A rule that is conditioned on position would else see the same position in all cells; a note
    says so.
    """
    if rule.place is None or not rule.config.is_conditioned_on("position"):
        return rule
    there = rule.place.lattice.to_world
    place = Placement.between(region.lattice.to_world, there, region.box, "the sequence")
    ends = np.array(list(product(*zip(*region.box, strict=True)))) - 0.5
    lower, upper = (np.array(end) - 0.5 for end in rule.place.box)
    corners = place.cells(ends)
    if (corners.max(axis=0) > lower).all() and (corners.min(axis=0) < upper).all():
        return rule
    watch.note(
        "the smoke lies apart from where the rule was trained; positions, on which "
        "the rule is conditioned, are those in the box of this sequence"
    )
    return replace(rule, place=None)


def volumes(
    sequence: FrameSequence,
    smoke: SmokeFormat,
    lattice: Lattice | None = None,
    check: VelocityCheck | None = None,
) -> Iterator[Volume]:
    """The frames in order, as `read_smoke` gives them; the next is read while one is used.

    Args:
        sequence: The frames.
        smoke: How they are read.
        lattice: On whose cells they are wanted; each has its own unless given.
        check: Is shown each of them.
    """
    loads = (partial(read_smoke, f.path, smoke, frame=f.number, lattice=lattice) for f in sequence)
    read = read_ahead(loads)
    return read if check is None else check.watched(read, [frame.path for frame in sequence])
