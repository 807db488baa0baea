"""The block a rule for a solid texture is trained on, ready for rollouts and pictures."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from vnca.automaton.rule import COLOUR, PRIORS
from vnca.camera import Orthographic
from vnca.io.mesh import Mesh
from vnca.render.colour import srgb_to_linear
from vnca.texturing.block import block_domain
from vnca.texturing.config import SliceConfig
from vnca.texturing.raster import visible
from vnca.texturing.slices import (
    as_picture,
    axis_angles,
    oblique_angles,
    shown,
    slice_points,
)
from vnca.typing import BoolArray, FloatArray

MESH_VIEWS = 24
"""Views of the mesh that training chooses from."""


@dataclass(frozen=True, eq=False)
class MeshView:
    """What a camera sees of a mesh.

    Attributes:
        points: `[n, 3]` in cells, one for each pixel that shows the mesh.
        covered: `[r, c]`, which those are.
    """

    points: FloatArray
    covered: BoolArray


class BlockScene:
    """A block on which states are rolled out and looked at; nothing in it changes.

    Attributes:
        domain: All cells of the block; it is its own neighbour on every side.
        neighbours: `[27, n]`.
        priors: `[n, 7]` zeros: a texture is the same everywhere.
    """

    def __init__(
        self,
        size: int,
        slices: SliceConfig,
        *,
        mesh: Mesh | None = None,
        device: torch.device | str = "cpu",
    ) -> None:
        """Prepare a block.

        Args:
            size: Cells along an edge.
            slices: How it is looked at.
            mesh: Seen from all sides beside the slices; a pixel shows about a cell.
            device: Where rollouts and pictures are computed.

        Raises:
            OptionError: If the size cannot work.
        """
        self.slices = slices
        self.domain = block_domain(size)
        self.neighbours = torch.from_numpy(self.domain.neighbours).to(device)
        self.priors = torch.zeros(len(self.domain), PRIORS, device=device)
        flat = np.ravel_multi_index(tuple(self.domain.cells.T), self.domain.box.shape)
        self._flat = torch.from_numpy(flat).to(device)
        self.views = mesh_views(mesh, slices.size) if mesh is not None else []

    def seed(self, channels: int) -> Tensor:
        """The state every rollout starts from, zeros `[n + 1, channels]`."""
        return torch.from_numpy(self.domain.seed(channels)).to(self.priors.device)

    def block(self, state: Tensor) -> Tensor:
        """Linear RGB `[x, y, z, 3]` of a state; differentiable."""
        colour = srgb_to_linear((state[:-1, COLOUR] + 0.5).clamp(0, 1))
        shape = self.domain.box.shape
        return torch.zeros_like(colour).index_copy(0, self._flat, colour).view(*shape, 3)

    def pictures(
        self, state: Tensor, random: np.random.Generator, background: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Random slices of a state, or views of the mesh, differentiable.

        Returns:
            sRGB `[b, 3, r, c]` over the background, and opacity `[b, r, c]`.
        """
        block = self.block(state)
        seen = [self._seen(block, random, background) for _ in range(self.slices.count)]
        colours, opacities = zip(*seen, strict=True)
        return torch.cat([as_picture(colour) for colour in colours]), torch.stack(opacities)

    def _seen(
        self, block: Tensor, random: np.random.Generator, background: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Linear RGB `[r, c, 3]` of a slice or a view, and its opacity `[r, c]`."""
        size = self.slices.size
        middle = random.uniform(0, len(block), 3)
        if self.views and random.uniform() < self.slices.mesh:
            view = self.views[int(random.integers(len(self.views)))]
            points = torch.from_numpy(view.points + middle.astype(np.float32)).to(block.device)
            covered = torch.from_numpy(view.covered).to(block.device)
            empty = background.expand(size, size, 3)
            return empty.index_put((covered,), shown(block, points)), covered.to(block.dtype)
        oblique = random.uniform() < self.slices.oblique
        angles = oblique_angles(random) if oblique else axis_angles(random)
        spacing = self.slices.zoom ** random.uniform(-1, 1)
        points = slice_points(angles, middle, size=size, spacing=spacing).to(block.device)
        return shown(block, points), block.new_ones(size, size)


def mesh_views(mesh: Mesh, size: int) -> list[MeshView]:
    """A mesh from all sides, a cell a pixel: the mesh as large as the picture allows."""
    low, high = mesh.bounds
    diameter = float(np.linalg.norm(high - low))
    points = np.concatenate([surface.points for surface in mesh.surfaces])
    points = (points - (low + high) / 2) * (size / diameter)
    counts = np.cumsum([0, *(len(surface.points) for surface in mesh.surfaces)])
    faces = np.concatenate([s.faces + n for s, n in zip(mesh.surfaces, counts, strict=False)])
    views, random = [], np.random.default_rng(0)
    for _ in range(MESH_VIEWS):
        angles = random.uniform(0, 360), float(np.degrees(np.arcsin(random.uniform(-1, 1))))
        camera = Orthographic((0.0, 0.0, 0.0), *angles, height=size)
        seen = visible(points, faces, camera, rows=size, columns=size)
        views.append(MeshView(seen.interpolate(points, faces).astype(np.float32), seen.covered))
    return views
