"""The one frame a rule is trained on, ready for rollouts and pictures."""

import numpy as np
import torch
from torch import Tensor

from vnca.automaton.domain import Domain
from vnca.automaton.priors import priors
from vnca.automaton.rule import COLOUR, DENSITY_CHANGE, DENSITY_LIMIT, SMOKE_THRESHOLD, Rule
from vnca.camera import Camera, Orthographic, Perspective, frame_box
from vnca.errors import GridError
from vnca.render.colour import srgb_to_linear
from vnca.render.velocity import projected_velocity
from vnca.render.view import View, render
from vnca.training.config import ViewConfig
from vnca.typing import AnyArray, Box
from vnca.volume import Volume


class Scene:
    """Smoke on which states are rolled out and looked at; nothing in it changes.

    Attributes:
        domain: The cells that live.
        neighbours: `[27, n]` rows of the state around each cell.
        priors: `[n, 7]`.
        moves: Whether the smoke has any velocity.
    """

    def __init__(self, smoke: Volume, rule: Rule, *, device: torch.device | str = "cpu") -> None:
        """Prepare a frame.

        Args:
            smoke: The frame; must hold smoke.
            rule: Its normalisers and switches are used, not its weights.
            device: Where rollouts and pictures are computed.

        Raises:
            GridError: If there is no smoke in the frame.
        """
        self.box = smoke_bounds(smoke, rule.scales.density)
        self.domain = Domain.around_smoke(
            smoke.density,
            smoke.origin,
            threshold=SMOKE_THRESHOLD * rule.scales.density,
            reach=rule.config.reach,
            box=self.box.grown(rule.config.reach),
        )
        self.gamma = rule.scales.gamma
        self.neighbours = torch.from_numpy(self.domain.neighbours).to(device)
        self.priors = torch.from_numpy(priors(self.domain, smoke, rule)).to(device)
        density = self.domain.gather(smoke.density, smoke.origin) / rule.scales.density
        self._density = torch.from_numpy(density.astype(np.float32)).to(device)
        velocity = np.zeros((len(self.domain), 3), dtype=np.float32)
        if smoke.velocity is not None:
            velocity[:] = self.domain.gather(smoke.velocity, smoke.origin)
        self.moves = bool(velocity.any())
        self._velocity = torch.from_numpy(velocity).to(device)
        at = self.domain.cells - np.asarray(self.domain.box.lower)
        flat = np.ravel_multi_index(tuple(at.T), self.domain.box.shape)
        self._flat = torch.from_numpy(flat).to(device)

    def seed(self, channels: int) -> Tensor:
        """The state every rollout starts from, zeros `[n + 1, channels]`."""
        return torch.from_numpy(self.domain.seed(channels)).to(self.priors.device)

    def camera(
        self, azimuth: float, elevation: float, *, aspect: float = 1.0
    ) -> Orthographic | Perspective:
        """A camera around the smoke, framed on its bounding box."""
        lower, upper = (np.asarray(c) - self.domain.box.lower for c in self.box)
        return frame_box(
            (lower - 0.5).tolist(), (upper - 0.5).tolist(), azimuth, elevation, aspect=aspect
        )

    def look(
        self,
        state: Tensor,
        camera: Camera,
        view: ViewConfig,
        *,
        size: int | None = None,
        offset: float = 0.0,
    ) -> View:
        """The smoke as `state` paints it; differentiable in the state.

        `size` is that of the view unless given; `offset` shifts all samples along their rays.
        """
        colour = srgb_to_linear((state[:-1, COLOUR] + 0.5).clamp(0, 1))
        size = size or view.size
        return render(
            self._painted_density(state),
            self._dense(colour),
            camera,
            rows=size,
            columns=size,
            gamma=self.gamma,
            step=view.step,
            offset=offset,
            mode=view.mode,
        )

    def motion(
        self, state: Tensor, camera: Camera, view: ViewConfig, *, size: int, offset: float = 0.0
    ) -> tuple[Tensor, Tensor]:
        """How the smoke that `look` shows moves: pixels per frame `[r, c, 2]`, and opacity."""
        return projected_velocity(
            self._painted_density(state),
            self._dense(self._velocity),
            camera,
            rows=size,
            columns=size,
            gamma=self.gamma,
            step=view.step,
            offset=offset,
            mode=view.mode,
        )

    def _painted_density(self, state: Tensor) -> Tensor:
        change = state[:-1, DENSITY_CHANGE].clamp(-DENSITY_LIMIT, DENSITY_LIMIT)
        return self._dense(self._density * (1 + change))

    def _dense(self, values: Tensor) -> Tensor:
        shape = self.domain.box.shape
        field = values.new_zeros(int(np.prod(shape)), *values.shape[1:])
        return field.index_copy(0, self._flat, values).view(*shape, *values.shape[1:])


def smoke_bounds(smoke: Volume, density_scale: float) -> Box:
    """The box of the cells that count as smoke.

    Raises:
        GridError: If there are none.
    """
    cells = np.argwhere(smoke.density > SMOKE_THRESHOLD * density_scale)
    if len(cells) == 0:
        raise GridError(
            f"frame {smoke.frame}: there is no smoke in it to train on; choose a later frame"
        )
    lower, upper = cells.min(axis=0), cells.max(axis=0) + 1
    x, y, z = (lower + smoke.origin).tolist()
    u, v, w = (upper + smoke.origin).tolist()
    return Box((x, y, z), (u, v, w))


def density_scale(density: AnyArray) -> float:
    """The density that counts as 1: the 99th percentile of what is not empty."""
    smoke = density[density > 0]
    return float(np.percentile(smoke, 99)) if len(smoke) else 1.0


def velocity_scale(smoke: Volume) -> float:
    """Cells per frame that count as 1: the root mean square speed inside the smoke."""
    if smoke.velocity is None:
        return 1.0
    speed = np.linalg.norm(smoke.velocity[smoke.density > 0], axis=-1)
    return max(float(np.sqrt(np.mean(speed**2))), 1e-3) if len(speed) else 1.0
