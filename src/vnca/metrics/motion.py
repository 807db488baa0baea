"""How well a painted texture moves with the smoke it lies on, as estimators of optical flow see it.

The density stays that of one frame, so that whatever moves in the pictures is texture.
"""

import dataclasses
import importlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import torch
from scipy.ndimage import gaussian_filter
from torch import Tensor

from vnca.core import AnyArray, BoolArray, Box, FloatArray
from vnca.core.errors import BackendUnavailableError, GridError
from vnca.core.volume import Volume
from vnca.engine import Compute
from vnca.features.flow import FlowNetwork
from vnca.losses import MotionConfig, compare_motion, luma, supervised
from vnca.painting import Roll, StylizeConfig
from vnca.rendering.colour import linear_to_srgb
from vnca.rendering.march import sample
from vnca.rule import COLOUR, Rule
from vnca.training.config import ViewConfig
from vnca.training.scenes.framing import SmokeViewpoint
from vnca.training.scenes.smoke import SmokeScene

Estimator: TypeAlias = Callable[[FloatArray, FloatArray], FloatArray]
"""Grey pictures `[row, column]` before and after, as displayed (sRGB, 0–1), to pixels moved,
`[row, column, (right, down)]`, at the pixels of the first."""
AZIMUTHS = (0.0, 60.0, 120.0, 180.0, 240.0, 300.0)
"""Degrees around the smoke at which motion is measured."""
ELEVATION = 10.0
"""Degrees above the horizon."""


def estimators() -> Mapping[str, Estimator]:
    """What sees motion: the network that training uses, and one it never meets.

    Raises:
        BackendUnavailableError: If OpenCV is not installed.
        FileFormatError: If the network's weights are missing or damaged.
    """
    return {"network": ours(), "dis": dis()}


def ours(device: str = "cpu") -> Estimator:
    """The network that training uses.

    Raises:
        FileFormatError: If its weights are missing or damaged.
    """
    return estimator_of(FlowNetwork.load(device))


def estimator_of(network: FlowNetwork) -> Estimator:
    """A flow network called like the others."""
    device = next(network.parameters()).device

    def estimate(before: FloatArray, after: FloatArray) -> FloatArray:
        pair = torch.from_numpy(np.stack([before, after])[:, None]).float().to(device)
        with torch.no_grad():
            flow = network(pair[0], pair[1])[0]
        return np.ascontiguousarray(flow.permute(1, 2, 0).cpu().numpy())

    return estimate


def dis() -> Estimator:
    """Dense inverse search, preset "medium", down to single pixels.

    Raises:
        BackendUnavailableError: If OpenCV is not installed.

    Reference: Kroeger et al. 2016.
    """
    cv2 = _opencv()
    search = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    search.setFinestScale(0)

    def estimate(before: FloatArray, after: FloatArray) -> FloatArray:
        return search.calc(_bytes(before), _bytes(after), None)

    return estimate


def farneback() -> Estimator:
    """Polynomial expansion, five halvings, windows of 15 pixels.

    Raises:
        BackendUnavailableError: If OpenCV is not installed.

    Reference: Farnebäck 2003.
    """
    cv2 = _opencv()

    def estimate(before: FloatArray, after: FloatArray) -> FloatArray:
        return cv2.calcOpticalFlowFarneback(
            _bytes(before), _bytes(after), None,
            pyr_scale=0.5, levels=5, winsize=15, iterations=3, poly_n=5, poly_sigma=1.1, flags=0,
        )  # fmt: skip

    return estimate


def _opencv() -> Any:
    try:
        return importlib.import_module("cv2")
    except ImportError as error:
        raise BackendUnavailableError(
            "optical flow by OpenCV: it is not installed; pip install 'vnca[evaluate]'"
        ) from error


def _bytes(picture: FloatArray) -> np.ndarray:
    return np.ascontiguousarray(np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8))


@dataclass(frozen=True, eq=False)
class SeenPair:
    """A view of the smoke before and after a frame has passed.

    Attributes:
        before: Grey, 0 to 1, `[r, c]`, display-referred.
        after: The same view a frame later.
        target: How the smoke moves: pixels per frame to the right and down, `[r, c, 2]`.
        where: The pixels in which motion is compared, `[r, c]`.
    """

    before: FloatArray
    after: FloatArray
    target: FloatArray
    where: BoolArray


@dataclass(frozen=True)
class MotionMeasures:
    """How the texture of a rule moves; means over views and frames.

    Attributes:
        direction: Name of an estimator → mean cosine distance, 0 to 2 (L_dir).
        magnitude: Name of an estimator → mean difference of speeds, pixels per frame (L_mag).
        transport: ‖S' − advect(S, v)‖ / ‖S' − S‖ over the cells in smoke, for states S and S'
            a frame apart: 0 if all change is transport, 1 or more if none is.
        speed: Mean speed of the smoke where motion is compared, pixels per frame.
    """

    direction: Mapping[str, float]
    magnitude: Mapping[str, float]
    transport: float
    speed: float


def measure_motion(
    rule: Rule,
    smoke: Volume,
    estimators: Mapping[str, Estimator],
    *,
    size: int = 128,
    frames: int = 3,
    warmup: int = 64,
    seed: int = 0,
    compute: Compute | None = None,
) -> MotionMeasures:
    """Let a rule paint one frame of smoke for some time and see how its texture moves.

    Args:
        rule: The rule.
        smoke: The frame, with velocity.
        estimators: What sees the motion, by name.
        size: Rows and columns of the pictures.
        frames: How many times a frame's steps are made and looked at.
        warmup: Steps before all that.
        seed: Of the update masks.
        compute: How steps are computed.

    Raises:
        GridError: If there is no smoke in the frame, it has no velocity, or nothing in it moves.

    Reference: VNCA table 3 (L_dir and L_mag at a fixed density frame).
    """
    scene = _moving_scene(rule, smoke, size)
    config = StylizeConfig(warmup=warmup, seed=seed)
    states = list(_states(rule, smoke, scene.box, config, frames + 1, compute))
    return _measure(scene, smoke, states, estimators)


def measure_carried_noise(
    rule: Rule,
    smoke: Volume,
    estimators: Mapping[str, Estimator],
    *,
    size: int = 128,
    frames: int = 2,
    grain: float = 1.3,
    seed: int = 0,
) -> MotionMeasures:
    """What is measured of a texture that the velocity does carry: how well motion can be seen.

    No measure of a rule should be expected to be much better. Where a velocity crosses the surface
    of the smoke, other layers of the texture come to light, which no estimator sees as motion.

    Args:
        rule: Its normalisers are used, not its weights.
        smoke: The frame, with velocity.
        estimators: What sees the motion, by name.
        size: Rows and columns of the pictures.
        frames: How often it is moved and looked at.
        grain: Size of the noise's grains: standard deviation of a Gaussian, cells.
        seed: Of the noise.

    Raises:
        GridError: As `measure_motion` does.
    """
    scene = _moving_scene(rule, smoke, size)
    random, channels = np.random.default_rng(seed), rule.config.channels
    noise = np.zeros((*scene.domain.box.shape, channels), np.float32)
    for channel in range(*COLOUR.indices(channels)):
        noise[..., channel] = gaussian_filter(random.standard_normal(noise.shape[:3]), grain)
    noise *= 0.25 / noise[..., COLOUR].std()
    cells = torch.from_numpy(scene.domain.cells - np.asarray(scene.domain.box.lower)).float()
    states = []
    for frame in range(frames + 1):
        carried = sample(torch.from_numpy(noise), cells - frame * scene.velocity)
        states.append(np.concatenate([carried.numpy(), np.zeros((1, channels), np.float32)]))
    return _measure(scene, smoke, states, estimators)


def measure_drift(rule: Rule, smoke: Volume, *, size: int = 128) -> tuple[float, float]:
    """L_dir and L_mag of a texture that moves as one, by the smoke's mean velocity.

    A rule that is not conditioned on the velocity can do this; one that does better follows the
    smoke.

    Args:
        rule: Its normalisers are used, not its weights.
        smoke: The frame, with velocity.
        size: Rows and columns of the pictures.

    Raises:
        GridError: As `measure_motion` does.
    """
    scene = _moving_scene(rule, smoke, size)
    state = scene.seed(rule.config.channels)
    mean = scene.velocity[scene.velocity.any(dim=1)].mean(dim=0).numpy()
    everywhere = np.broadcast_to(mean, (*smoke.density.shape, 3))
    drifting = SmokeScene(dataclasses.replace(smoke, velocity=everywhere), rule, scene.view)
    drifts = torch.stack([_target(drifting, state, azimuth)[0] for azimuth in AZIMUTHS])
    targets, where = map(
        torch.stack, zip(*(_target(scene, state, azimuth) for azimuth in AZIMUTHS), strict=True)
    )
    motion = compare_motion(drifts, targets, where)
    return float(motion.direction), float(motion.magnitude)


def _moving_scene(rule: Rule, smoke: Volume, size: int) -> SmokeScene:
    scene = SmokeScene(smoke, rule, ViewConfig(size=size))
    if smoke.velocity is None:
        raise GridError(f"frame {smoke.frame}: it has no velocity to compare motion with")
    return scene


def _measure(
    scene: SmokeScene,
    smoke: Volume,
    states: Sequence[FloatArray],
    estimators: Mapping[str, Estimator],
) -> MotionMeasures:
    """How states a frame apart move."""
    velocity = _dense(scene, scene.velocity.numpy())
    inside = _inside(scene)
    pairs = [
        _look(scene, before, after, azimuth)
        for before, after in pairwise(states)
        for azimuth in AZIMUTHS
    ]
    pairs = [pair for pair in pairs if pair.where.any()]
    if not pairs:
        raise GridError(f"frame {smoke.frame}: no smoke in it moves enough to be measured")
    compared = {name: _compare(pairs, estimator) for name, estimator in estimators.items()}
    return MotionMeasures(
        direction={name: direction for name, (direction, _) in compared.items()},
        magnitude={name: magnitude for name, (_, magnitude) in compared.items()},
        transport=_mean(
            transport_ratio(_dense(scene, before), _dense(scene, after), velocity, inside)
            for before, after in pairwise(states)
        ),
        speed=float(
            np.concatenate([np.linalg.norm(p.target[p.where], axis=1) for p in pairs]).mean()
        ),
    )


def transport_ratio(
    before: FloatArray, after: FloatArray, velocity: FloatArray, inside: BoolArray
) -> float:
    """How much of the change of a state is transport: ‖S' − advect(S, v)‖ / ‖S' − S‖.

    Advection is semi-Lagrangian: each cell takes what was v upstream, interpolated. Cells that
    would take it from outside are left out. A state that does not change at all gives 1.

    Args:
        before: S, `[x, y, z, c]`.
        after: S', a frame later.
        velocity: `[x, y, z, 3]`, cells per frame.
        inside: `[x, y, z]`, the cells that hold a state.
    """
    cells = torch.from_numpy(np.argwhere(inside)).float()
    at = tuple(cells.long().T)
    origin = cells - torch.from_numpy(velocity)[at]
    known = sample(torch.from_numpy(inside)[..., None].float(), origin)[:, 0] > 1 - 1e-4
    advected = sample(torch.from_numpy(before), origin[known])
    old, new = (torch.from_numpy(s)[at][known] for s in (before, after))
    change = float((new - old).norm())
    return float((new - advected).norm()) / change if change else 1.0


def _states(
    rule: Rule,
    smoke: Volume,
    box: Box,
    config: StylizeConfig,
    count: int,
    compute: Compute | None,
) -> Iterator[FloatArray]:
    """States a frame's steps apart, on density that stays as it is."""
    roll = Roll(rule, config, box, compute or Compute())
    state = roll.start()
    for _ in range(count):
        state = roll.paint(smoke, state).state
        yield state.values


@torch.no_grad()
def _look(scene: SmokeScene, before: FloatArray, after: FloatArray, azimuth: float) -> SeenPair:
    camera = scene.camera(azimuth, ELEVATION)
    earlier, later = (torch.from_numpy(state) for state in (before, after))
    target, where = _target(scene, earlier, azimuth)
    shown = [scene.look(state, camera) for state in (earlier, later)]
    # The mean colour of the smoke behind it: a silhouette that stands still should not be seen.
    weight = shown[0].opacity.sum().clamp_min(1e-6)
    background = shown[0].colour.sum((0, 1)) / weight
    return SeenPair(
        before=_grey(shown[0].over(background)),
        after=_grey(shown[1].over(background)),
        target=target.numpy(),
        where=where.numpy(),
    )


def _target(scene: SmokeScene, state: Tensor, azimuth: float) -> tuple[Tensor, Tensor]:
    """How the smoke is seen to move, `[r, c, 2]`, and where motion is compared, `[r, c]`."""
    viewpoint = SmokeViewpoint(scene.camera(azimuth, ELEVATION), offset=0.0)
    target, opacity = scene.motion(state, viewpoint, scene.view.size)
    return target, supervised(target, opacity, MotionConfig())


def _grey(picture: Tensor) -> FloatArray:
    return luma(linear_to_srgb(picture).permute(2, 0, 1)[None])[0, 0].numpy()


def _compare(pairs: Sequence[SeenPair], estimator: Estimator) -> tuple[float, float]:
    """Mean L_dir and L_mag; every pixel compared counts alike."""
    found = [torch.from_numpy(estimator(pair.before, pair.after)) for pair in pairs]
    motion = compare_motion(
        torch.stack(found),
        torch.from_numpy(np.stack([pair.target for pair in pairs])),
        torch.from_numpy(np.stack([pair.where for pair in pairs])),
    )
    return float(motion.direction), float(motion.magnitude)


def _dense(scene: SmokeScene, values: AnyArray) -> FloatArray:
    count = len(scene.domain)
    return scene.domain.scatter(values[:count], scene.domain.box).astype(np.float32)


def _inside(scene: SmokeScene) -> BoolArray:
    return _dense(scene, np.ones((len(scene.domain), 1), np.float32))[..., 0] > 0


def _mean(values: Iterable[float]) -> float:
    return float(np.mean(list(values)))
