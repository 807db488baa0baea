"""One judgement for all: grey pictures of what each method painted, from the front and around.

Where a method changes density only, its picture is the light that its density gives, as it saw it
itself; of others it is the brightness of what a film of them shows. All are compared where the
smoke, as it comes, is opaque: the same pixels for all.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import mean, pstdev

import numpy as np
import torch

from vnca.comparison import Contender
from vnca.core import Box, FloatArray
from vnca.core.colour import linear_to_srgb, luminance, srgb_to_linear
from vnca.core.errors import BackendUnavailableError, SequenceError
from vnca.core.lattice import Region
from vnca.core.volume import Volume
from vnca.features import FeatureNetwork, load_network
from vnca.io import SmokeFormat, read_smoke
from vnca.io.painted import read_colour
from vnca.io.provenance import read_provenance
from vnca.io.sequence import FrameSequence
from vnca.io.smoke_format import NO_VELOCITY
from vnca.losses.appearance import AppearanceConfig, AppearanceLoss
from vnca.metrics import FILM, DensityChange
from vnca.metrics.coherence import Coherence, mean_agreement
from vnca.metrics.motion import estimators
from vnca.metrics.setup import OPAQUE, Coloured, Pair, Seen, Setup, Viewpoint
from vnca.painting import Painting, RollState
from vnca.recipe import Watch
from vnca.recipe.rendering import CELL_OPACITY
from vnca.rule import density_scale, gamma_for_cell_opacity

JUDGES = ("efficientnet", "edges")
"""Networks that say how unlike the picture it is: ours is trained with the first, the other methods
compare by the second."""
FRONT = Viewpoint(0.0, 0.0)
AROUND = tuple(Viewpoint(45.0 * turn, 0.0) for turn in range(8))
FRONT_FRAMES = 5
"""Frames whose front is compared with the picture."""


@dataclass(frozen=True, eq=False)
class Result:
    """What was found of one contender; None where it could not be measured.

    Attributes:
        contender: Whom.
        front: L_app (grey) of the front, by network.
        around: L_app (grey), mean over views all around the middle frame, by network.
        spread: Standard deviation of that over its mean, by the first network there is.
        short: Disagreement with the frame before, where the smoke has moved to.
        long: With that seven frames before.
        flow: Difference between the motion seen in the painting and in the smoke, pixels a frame.
        moved: Share of the mass that is taken away or added.
        mass: What this comes to in total.
        film: Its pictures as perceived, `[r, c]`, a frame each.
    """

    contender: Contender
    front: dict[str, float]
    around: dict[str, float]
    spread: float | None
    short: float | None
    long: float | None
    flow: float | None
    moved: float
    mass: float
    film: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class Bench:
    """What all contenders are judged with.

    Attributes:
        setup: How smoke is looked at where it is to be opaque.
        region: Where it lies.
        judges: Losses by network.
        smoke: How files are read.
        plain: Results of the smoke as it comes, lit from above.
    """

    setup: Setup
    region: Region
    judges: dict[str, AppearanceLoss]
    smoke: SmokeFormat


def bench(
    given: Sequence[Volume],
    region: Region,
    picture: FloatArray,
    smoke: SmokeFormat,
    size: int,
    watch: Watch,
) -> Bench:
    """What is needed to judge paintings of some smoke.

    Args:
        given: The smoke.
        region: Where it lies.
        picture: Grey, linear RGB `[r, c, 3]`.
        smoke: How it is read.
        size: Rows and columns of pictures.
        watch: Is told of networks that are not installed.

    Raises:
        BackendUnavailableError: If no network is.
    """
    densities = np.concatenate([volume.density_field.values.ravel() for volume in given])
    scale = density_scale(densities)
    gamma = gamma_for_cell_opacity(densities / scale, CELL_OPACITY["painted"]) / scale
    setup = Setup(region.box, gamma, size)
    cells = setup.camera(FRONT).height
    config, judges = AppearanceConfig(colour=False, pixels=0.0), {}
    for name in JUDGES:
        try:
            network: FeatureNetwork = load_network(name)
        except BackendUnavailableError as error:
            watch.note(str(error))
            continue
        judges[name] = AppearanceLoss(network, picture, config, size, cells)
    if not judges:
        raise BackendUnavailableError("no network is installed that could judge; see the notes")
    return Bench(setup, region, judges, smoke)


def measure(
    contender: Contender, given: Sequence[Volume], sequence: FrameSequence, bench: Bench
) -> Result:
    """Look at all frames of a contender.

    Raises:
        SequenceError: If a frame is missing.
        FileFormatError: If one cannot be read.
    """
    coherence = Coherence(estimators()["dis"])
    front: dict[str, list[float]] = {name: [] for name in bench.judges}
    around: dict[str, list[float]] = {name: [] for name in bench.judges}
    changes, film = [], []
    picked = set(np.linspace(0, len(given) - 1, min(FRONT_FRAMES, len(given))).round().astype(int))
    for at, (smoke, painted) in enumerate(
        zip(given, _painted(contender, sequence, bench), strict=True)
    ):
        before = _over(smoke, painted.box)
        changes.append(
            DensityChange.of(
                Painting(
                    before, painted.coloured.density, painted.coloured.colour, RollState.empty(4)
                )
            )
        )
        pair = _pair(before, painted, contender, FILM, bench)
        coherence.add(smoke.frame, pair, bench.setup.motion(before, FILM))
        film.append(_perceived(pair.painted))
        if at in picked:
            _judge(front, _pair(before, painted, contender, FRONT, bench), bench)
        if at == len(given) // 2:
            for viewpoint in AROUND:
                _judge(around, _pair(before, painted, contender, viewpoint, bench), bench)
    spreads = [pstdev(values) / mean(values) for values in around.values() if values]
    short, long = (
        mean_agreement(getattr(step, kind) for step in coherence.steps)
        for kind in ("short", "long")
    )
    flows = [step.flow for step in coherence.steps if step.flow is not None]
    return Result(
        contender,
        {name: mean(values) for name, values in front.items() if values},
        {name: mean(values) for name, values in around.items() if values},
        spreads[0] if spreads else None,
        short and short.painted,
        long and long.painted,
        mean(flows) if flows else None,
        mean(change.moved for change in changes),
        mean(change.mass_change for change in changes),
        tuple(film),
    )


@dataclass(frozen=True, eq=False)
class _Painted:
    """A painted frame, over a box that holds all of it and of the smoke."""

    coloured: Coloured
    box: Box
    gamma: float


def _painted(contender: Contender, sequence: FrameSequence, bench: Bench) -> Iterator[_Painted]:
    format = replace(bench.smoke, velocity_grid=NO_VELOCITY)
    for frame in sequence:
        path = contender.folder / f"{frame.path.stem}.vdb"
        if not path.exists():
            raise SequenceError(f"{path}: {contender.name} has not painted this frame")
        told = read_provenance(path)
        up = bench.smoke.up_axis if told is None else told.up_axis
        format = replace(format, up_axis=up)
        volume = read_smoke(path, format, frame=frame.number, lattice=bench.region.lattice)
        box = volume.box.union(bench.region.box)
        colour = read_colour(path, format, grid="Cd", box=box, lattice=bench.region.lattice)
        if colour is None:
            colour = np.ones((*box.shape, 3), np.float32)
        density = volume.density_field.dense(box)
        length = volume.cell_length
        gamma = bench.setup.gamma if told is None else told.extinction * length
        yield _Painted(Coloured(density, colour, box.lower), box, gamma)


def _over(smoke: Volume, box: Box) -> Volume:
    """The same smoke over a larger box."""
    velocity = smoke.velocity_field
    return Volume(
        smoke.density_field.dense(box),
        None if velocity is None else velocity.dense(box),
        box.lower,
        smoke.index_to_world,
        smoke.frame,
    )


def _pair(
    smoke: Volume, painted: _Painted, contender: Contender, viewpoint: Viewpoint, bench: Bench
) -> Pair:
    plain = bench.setup.look(Coloured.plain(smoke), viewpoint)
    inside = (plain.opacity > OPAQUE).astype(np.float32)
    seen = replace(bench.setup, gamma=painted.gamma).look(painted.coloured, viewpoint)
    if contender.grey_is_density:
        light = seen.opacity / max(float(seen.opacity.max()), 1e-6)
        brightness = srgb_to_linear(light).astype(np.float32)
    else:
        brightness = luminance(seen.colour).astype(np.float32)
    grey = np.repeat(brightness[..., None], 3, axis=-1)
    return Pair(
        viewpoint,
        Seen(grey, inside, plain.depth),
        Seen(
            np.repeat(luminance(plain.colour).astype(np.float32)[..., None], 3, -1),
            inside,
            plain.depth,
        ),
    )


def _perceived(seen: Seen) -> FloatArray:
    """A grey picture in 0–1 as perceived, `[r, c]`."""
    return linear_to_srgb(seen.colour[..., 0].clip(0, 1)).astype(np.float32)


@torch.no_grad()
def _judge(found: dict[str, list[float]], pair: Pair, bench: Bench) -> None:
    if not pair.painted.opacity.any():
        return
    picture = torch.from_numpy(_perceived(pair.painted)).expand(1, 3, -1, -1)
    opacity = torch.from_numpy(pair.painted.opacity)[None]
    for name, loss in bench.judges.items():
        value = loss(picture, opacity, torch.Generator().manual_seed(0)).total
        found[name].append(value.item())
