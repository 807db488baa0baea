"""The one frame a rule is trained on, ready for rollouts and pictures."""

import copy
import dataclasses
from functools import partial

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor

from vnca.core import Box, FloatArray
from vnca.core.camera import Camera, Orthographic, Perspective, frame_box
from vnca.core.errors import GridError
from vnca.core.volume import Volume
from vnca.engine.domain import Domain
from vnca.losses import luma
from vnca.losses.appearance import AppearanceLoss
from vnca.rendering.colour import linear_to_srgb, srgb_to_linear
from vnca.rendering.view import Shader, View, projected_velocity, render
from vnca.rule import SMOKE_THRESHOLD, Rule, gamma_for_own_colour
from vnca.rule.conditioning import DENSITY_LIMIT as TOLD_DENSITY_LIMIT
from vnca.rule.conditioning import normalised_velocity, priors
from vnca.training.config import ViewConfig
from vnca.training.scenes import Scene, as_light, colours, density_factors
from vnca.training.scenes.framing import (
    SmokeViewpoint,
    around,
    level_turntable,
    stood,
    view_width,
)

SPEEDS = (0.25, 1.5)
"""How much slower or faster than in the frame augmented smoke moves, at most."""
STRONGEST = 1.5
"""The greatest velocity that is added to all of the smoke, in units of its typical speed."""
DENSEST = 2.0
"""How much denser, or thinner, the density is that the rule is conditioned on, at most."""
THIN = 0.5
"""Share of the views that see smoke thinner than it is, if any do."""
PREVIEW_VIEWS = ((0.0, 0.0), (90.0, 0.0), (180.0, 0.0), (30.0, 60.0))
"""Azimuth and elevation: front, right, back and from above, degrees."""
PREVIEW_STEP = 0.5
"""Distance between samples along a ray, cells: finer than in training, without terraces."""
PREVIEW_BACKGROUND = 0.01
"""Linear grey behind the smoke."""


class SmokeScene(Scene[SmokeViewpoint]):
    """A frame of smoke on which states are rolled out and looked at; nothing in it changes.

    Attributes:
        view: How it is looked at.
        augment: Whether the velocity and the density that a rule is conditioned on differ from
            life to life of the states.
        box: The cells that hold smoke lie in it.
        velocity: `[n, 3]`, cells per frame.
        moves: Whether the smoke has any.
    """

    def __init__(
        self,
        smoke: Volume,
        rule: Rule,
        view: ViewConfig,
        *,
        augment: bool = False,
        width: float | None = None,
        device: torch.device | str = "cpu",
        backend: str = "auto",
    ) -> None:
        """Prepare a frame.

        Args:
            smoke: The frame; must hold smoke.
            rule: Its normalisers, switches and decoder are used, not the weights of its automaton.
            view: How it is looked at; gamma is the rule's.
            augment: Whether the velocity and the density that the rule is conditioned on differ
                from life to life of the states.
            width: Cells across a picture; by default those of the smoke from any side, or fewer as
                the view asks for.
            device: Where rollouts and pictures are computed.
            backend: What decodes.

        Raises:
            GridError: If there is no smoke in the frame.
        """
        self.view = view
        self.augment = augment
        self.box = smoke_bounds(smoke, rule.scales.density)
        box = self.box.grown(rule.config.dilation)
        if rule.config.domain == "box":
            domain = Domain.filling(box)
        else:
            domain = Domain.around_smoke(
                smoke.density_field,
                threshold=SMOKE_THRESHOLD * rule.scales.density,
                dilation=rule.config.dilation,
                box=box,
            )
        if width is None:
            width = view_width(self.box, smoke.index_to_world)
            if view.pixels_per_cell is not None:
                width = min(width, view.size / view.pixels_per_cell)
        super().__init__(
            domain,
            priors(domain, smoke, rule),
            device,
            width=width,
            decoder=rule.decoder,
            backend=backend,
        )
        self._place = stood(smoke.index_to_world)
        self.samples = max(domain.box.shape) / view.step * self._supersampling**2
        self.gamma = rule.scales.gamma
        self._grey_gamma = self.gamma
        if view.mode != "paper":
            self._grey_gamma = gamma_for_own_colour(smoke.density / rule.scales.density)
        self._smoke_cells = np.argwhere(smoke.density > SMOKE_THRESHOLD * rule.scales.density)
        self._smoke_cells += np.subtract(smoke.origin, domain.box.lower)
        density = smoke.density_field.gather(domain.cells) / rule.scales.density
        centres = (domain.cells - np.asarray(domain.box.lower)).astype(np.float32)
        self._centres = torch.from_numpy(centres).to(device)
        self._density = torch.from_numpy(density.astype(np.float32)).to(device)
        velocity = np.zeros((len(domain), 3), dtype=np.float32)
        if smoke.velocity_field is not None:
            velocity[:] = smoke.velocity_field.gather(domain.cells)
        self.moves = bool(velocity.any())
        self.velocity = torch.from_numpy(velocity).to(device)
        self._rule = rule

    def augmented(self, number: int) -> "SmokeScene":
        """The smoke as a state sees it in its life: faster or slower, denser or thinner.

        At odd numbers its velocity is turned at random, too, and one that all cells share is added.
        The rule is conditioned on that velocity, and motion is judged by it; the density that is
        seen stays as it is.
        """
        if not (self.augment and self.moves):
            return self
        random = np.random.default_rng(number)
        velocity = self.velocity.cpu().numpy() * random.uniform(*SPEEDS)
        denser = DENSEST ** random.uniform(-1, 1)
        if number % 2:
            turn, heading = Rotation.from_quat(random.standard_normal((2, 4))).as_matrix()
            strength = random.uniform(0, STRONGEST) * self._rule.scales.velocity
            velocity = velocity @ turn + strength * heading[0]
        velocity = velocity.astype(np.float32)
        told = torch.from_numpy(normalised_velocity(velocity, self._rule))
        scene = copy.copy(self)
        scene.velocity = torch.from_numpy(velocity).to(self.velocity)
        scene.priors = self.priors.clone()
        config = self._rule.config
        if (where := config.columns("velocity")) is not None:
            scene.priors[:, where] = told.to(self.priors)
        if (where := config.columns("density")) is not None:
            density = (self._density * denser).clamp_max(TOLD_DENSITY_LIMIT)
            scene.priors[:, where] = density[:, None]
        return scene

    def drift(self, random: np.random.Generator) -> FloatArray:
        """The velocity."""
        del random
        return self.velocity.cpu().numpy()

    def mass_change(self, state: Tensor) -> Tensor:
        """By what part of it the state changes the mass of the smoke; differentiable."""
        factors = self._density_factors(state)
        return (self._density * factors).sum() / self._density.sum() - 1

    def camera(
        self, azimuth: float, elevation: float, *, aspect: float = 1.0
    ) -> Orthographic | Perspective:
        """A camera around the smoke, as near to its bounding box as that side allows.

        It is in the world, where lengths are those of a cell.
        """
        return frame_box(*self._corners, azimuth, elevation, aspect=aspect)

    @property
    def _corners(self) -> tuple[list[float], list[float]]:
        lower, upper = (np.asarray(c) - self.domain.box.lower - 0.5 for c in self.box)
        return around(lower, upper, self._place)

    def viewpoint(self, random: np.random.Generator) -> SmokeViewpoint:
        """A camera around the smoke, and where along the rays sampling begins."""
        azimuths = self.view.azimuths
        azimuth = float(random.choice(azimuths)) if azimuths else random.uniform(0, 360)
        elevation = random.uniform(-self.view.elevation, self.view.elevation)
        camera = level_turntable(*self._corners, azimuth, elevation)
        if self.width < camera.height:
            camera = self._closer(camera, random)
        elif self.width > camera.height:
            camera = dataclasses.replace(camera, height=self.width)
        # Samples at random depths: no pattern can hide between them.
        offset = float(random.uniform()) if self.view.mode == "emission-absorption" else 0.0
        thinness = 1.0
        if self.view.thinnest < 1 and random.uniform() < THIN:
            thinness = float(self.view.thinnest ** random.uniform())
        return SmokeViewpoint(camera, offset, thinness)

    def _closer(self, camera: Orthographic, random: np.random.Generator) -> Orthographic:
        """The camera before some cell of the smoke, so near that it sees `width` cells."""
        cell = self._smoke_cells[int(random.integers(len(self._smoke_cells)))]
        if self._place is not None:
            cell = self._place[:3, :3] @ cell + self._place[:3, 3]
        x, y, z = np.asarray(cell, float).tolist()
        return dataclasses.replace(camera, target=(x, y, z), height=self.width)

    def pictures(
        self, state: Tensor, viewpoint: SmokeViewpoint, background: Tensor
    ) -> tuple[Tensor, Tensor]:
        """A view, as `Scene.pictures` has it."""
        view = self.look(
            state, viewpoint.camera, offset=viewpoint.offset, thinness=viewpoint.thinness
        )
        picture = linear_to_srgb(view.over(background))
        return picture.permute(2, 0, 1)[None], view.opacity[None]

    @torch.no_grad()
    def seen_shares(self, shares: Tensor, viewpoint: SmokeViewpoint) -> Tensor:
        """See `Scene.seen_shares`; of the smoke with the density of its file."""
        view = render(
            self.dense(self._density),
            self.dense(shares[:, None].expand(-1, 3)),
            viewpoint.camera,
            rows=self.view.size,
            columns=self.view.size,
            gamma=self.gamma * viewpoint.thinness,
            step=self.view.step,
            offset=viewpoint.offset,
            cells_to_world=self._place,
        )
        share = (view.colour[..., 0] / view.opacity).clamp(0, 1)
        return torch.where(view.opacity > AppearanceLoss.least_opacity, share, torch.nan)[None]

    def density_pictures(
        self, state: Tensor, viewpoint: SmokeViewpoint, background: Tensor
    ) -> Tensor:
        """The density in grey, as `Scene.density_pictures` has it.

        I = Σ d' τ over the cells of a ray, by the paper's integrand whatever that of the colours:
        by emission and absorption, white smoke that lets nothing through is white, however dense.

        Reference: VNCA, the equations for I and for L_app.
        """
        view = render(
            *self._coloured(state, white=True),
            viewpoint.camera,
            rows=self.view.size,
            columns=self.view.size,
            gamma=self._grey_gamma * viewpoint.thinness,
            offset=viewpoint.offset,
            mode="paper",
            cells_to_world=self._place,
            supersampling=self._supersampling,
        )
        behind = srgb_to_linear(luma(linear_to_srgb(background).view(1, 3, 1, 1))).view(3)
        return linear_to_srgb(view.over(behind)).permute(2, 0, 1)[None]

    def preview_views(self, state: Tensor, size: int) -> list[FloatArray]:
        """Views from the front, the right, the back and above."""
        view = dataclasses.replace(self.view, size=size)
        if view.mode == "emission-absorption":
            view = dataclasses.replace(view, step=PREVIEW_STEP)
        pictures = []
        for azimuth, elevation in PREVIEW_VIEWS:
            seen = self.look(state, self.camera(azimuth, elevation), view)
            pictures.append(seen.over([PREVIEW_BACKGROUND] * 3).clamp(0, 1).cpu().numpy())
        return pictures

    def look(
        self,
        state: Tensor,
        camera: Camera,
        view: ViewConfig | None = None,
        *,
        offset: float = 0.0,
        thinness: float = 1.0,
    ) -> View:
        """The smoke as `state` paints it; differentiable in the state.

        `view` is that of training unless given; `offset` shifts all samples along their rays, and
        `thinness` is what gamma is multiplied by.
        """
        view = view or self.view
        return render(
            *self._coloured(state),
            camera,
            rows=view.size,
            columns=view.size,
            gamma=self.gamma * thinness,
            step=view.step,
            offset=offset,
            mode=view.mode,
            cells_to_world=self._place,
            supersampling=self._supersampling,
        )

    @property
    def _supersampling(self) -> int:
        """Of what is as fine as cells, one ray a pixel shows everything."""
        return 1 if self.decoder is None else self.view.supersampling

    def _coloured(self, state: Tensor, *, white: bool = False) -> tuple[Tensor, Tensor | Shader]:
        """Density and colour as `vnca.rendering.render` takes them."""
        if self.decoder is not None:
            return self.dense(self._density), partial(self._shade, state, white=white)
        density = self._painted_density(state)
        if white:
            return density, density.new_ones(1).expand(*density.shape, 3)
        return density, self.dense(colours(state[:-1]))

    def _shade(
        self, state: Tensor, points: Tensor, *, white: bool = False
    ) -> tuple[Tensor, Tensor]:
        """What a decoded state shows at points `[m, 3]`, as `vnca.rendering.Shader` has it."""
        seen = self.seen(state, points)
        hues, factors = as_light(seen)
        return factors, seen.new_ones(len(seen), 3) if white else hues

    @torch.no_grad()
    def motion(self, state: Tensor, viewpoint: SmokeViewpoint, size: int) -> tuple[Tensor, Tensor]:
        """How the smoke that `pictures` shows moves: pixels per frame `[r, c, 2]`, and opacity.

        `size` is that of such a picture, rows and columns.
        """
        return projected_velocity(
            self._painted_density(state),
            self.dense(self.velocity),
            viewpoint.camera,
            rows=size,
            columns=size,
            gamma=self.gamma * viewpoint.thinness,
            step=self.view.step,
            offset=viewpoint.offset,
            mode=self.view.mode,
            cells_to_world=self._place,
        )

    def _painted_density(self, state: Tensor) -> Tensor:
        """The density on the grid."""
        return self.dense(self._density * self._density_factors(state))

    def _density_factors(self, state: Tensor) -> Tensor:
        """1 + Δd at the cells; of a decoded state, what is seen in their middle."""
        cells = state[:-1]
        if self.decoder is not None:
            cells = self.seen(state, self._centres)
        return density_factors(cells)


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


def velocity_scale(smoke: Volume) -> float:
    """Cells per frame that count as 1: the root mean square speed inside the smoke."""
    if smoke.velocity is None:
        return 1.0
    speed = np.linalg.norm(smoke.velocity[smoke.density > 0], axis=-1)
    return max(float(np.sqrt(np.mean(speed**2))), 1e-3) if len(speed) else 1.0
