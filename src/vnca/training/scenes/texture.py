"""The block a rule for a solid texture is trained on, ready for rollouts and pictures."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from vnca.core.camera import Orthographic
from vnca.core.typing import BoolArray, FloatArray
from vnca.io.mesh import Mesh
from vnca.meshes.raster import visible
from vnca.painting.block import block_domain
from vnca.rule.decoder import Decoder
from vnca.rule.rule import PRIORS
from vnca.training.scene import Scene, colours
from vnca.training.scenes.slices import (
    DIAGONAL,
    Angles,
    as_picture,
    averaged,
    axis_angles,
    oblique_angles,
    shown,
    slice_points,
)
from vnca.training.texture_config import SliceConfig

MESH_VIEWS = 24
"""Views of the mesh that training chooses from."""
PREVIEW_VIEWS: tuple[Angles, ...] = ((0.0, 0.0), (90.0, 0.0), (0.0, 90.0), (45.0, DIAGONAL))
"""From the front, the right and above, and across a diagonal, which training never does."""
PREVIEW_CELLS = 128
"""Cells across a preview view of states that are interpolated."""
DECODED_CELLS = 32
"""Cells across one of states that are decoded: their strokes are finer."""


@dataclass(frozen=True, eq=False)
class MeshView:
    """What a camera sees of a mesh.

    Attributes:
        points: `[n, 3]` in cells, one for each pixel that shows the mesh.
        covered: `[r, c]`, which those are.
    """

    points: FloatArray
    covered: BoolArray


class Cut(NamedTuple):
    """A picture's place in the block: a slice, or a view of the mesh.

    Attributes:
        points: In cells, `[r, c, 3]`, or `[n, 3]` of the pixels covered.
        covered: `[r, c]`, the pixels that show the mesh; all of a slice.
    """

    points: Tensor
    covered: Tensor | None


class BlockScene(Scene[list[Cut]]):
    """A block on which states are rolled out and looked at; nothing in it changes.

    All its cells live; it is its own neighbour on every side. Priors are zero: a texture is the
    same everywhere. Its rule leaves the density alone: smoke painted with it keeps its shape.
    """

    paints_density = False

    def __init__(
        self,
        size: int,
        slices: SliceConfig,
        *,
        conditioning_width: int = PRIORS,
        mesh: Mesh | None = None,
        decoder: Decoder | None = None,
        device: torch.device | str = "cpu",
        backend: str = "auto",
    ) -> None:
        """Prepare a block.

        Args:
            size: Cells along an edge.
            slices: How it is looked at.
            conditioning_width: Numbers that a cell of the rule is told: all are zero here.
            mesh: Seen from all sides beside the slices.
            decoder: What is seen between cells; they are interpolated unless given.
            device: Where rollouts and pictures are computed.
            backend: What decodes.

        Raises:
            OptionError: If the size cannot work.
        """
        domain = block_domain(size)
        nothing = np.zeros((len(domain), conditioning_width), np.float32)
        super().__init__(
            domain, nothing, device, width=slices.cells, decoder=decoder, backend=backend
        )
        self.slices = slices
        self.samples = float(slices.supersampling**2)
        self.views: list[MeshView] = []
        if mesh is not None:
            self.views = mesh_views(mesh, slices.size * slices.supersampling, slices.cells)

    def shown(self, state: Tensor, points: Tensor) -> Tensor:
        """Linear RGB `[*, 3]` of a state at points `[*, 3]` in cells; differentiable."""
        if self.decoder is None:
            return shown(self.dense(colours(state[:-1])), points)
        return colours(self.seen(state, points.view(-1, 3))).view(points.shape)

    def viewpoint(self, random: np.random.Generator) -> list[Cut]:
        """Random slices, or views of the mesh."""
        return [self._cut(random) for _ in range(self.slices.count)]

    def pictures(
        self, state: Tensor, viewpoint: list[Cut], background: Tensor
    ) -> tuple[Tensor, Tensor]:
        """The slices and views, as `Scene.pictures` has it."""
        size, samples = self.slices.size, self.slices.supersampling
        pictures, opacities = [], []
        for points, covered in viewpoint:
            colour, opacity = self.shown(state, points), state.new_ones(size, size)
            if covered is not None:
                empty = background.expand(*covered.shape, 3)
                colour = empty.index_put((covered,), colour)
                opacity = averaged(covered.to(colour.dtype)[..., None], samples)[..., 0]
            pictures.append(as_picture(averaged(colour, samples)))
            opacities.append(opacity)
        return torch.cat(pictures), torch.stack(opacities)

    def preview_views(self, state: Tensor, size: int) -> list[FloatArray]:
        """Slices from the front, the right and above, and across a diagonal."""
        cells = PREVIEW_CELLS if self.decoder is None else DECODED_CELLS
        samples = self.slices.supersampling
        middle = np.full(3, self.domain.box.shape[0] / 2)
        views = []
        for angles in PREVIEW_VIEWS:
            across = samples * size
            points = slice_points(angles, middle, size=across, spacing=cells / across)
            colour = averaged(self.shown(state, points.to(state.device)), samples)
            views.append(colour.cpu().numpy())
        return views

    def _cut(self, random: np.random.Generator) -> Cut:
        device = self.priors.device
        middle = random.uniform(0, self.domain.box.shape[0], 3)
        if self.views and random.uniform() < self.slices.mesh:
            view = self.views[int(random.integers(len(self.views)))]
            points = torch.from_numpy(view.points + middle.astype(np.float32))
            return Cut(points.to(device), torch.from_numpy(view.covered).to(device))
        oblique = random.uniform() < self.slices.oblique
        angles = oblique_angles(random) if oblique else axis_angles(random)
        across = self.slices.size * self.slices.supersampling
        spacing = self.slices.cells / across * self.slices.zoom ** random.uniform(-1, 1)
        points = slice_points(angles, middle, size=across, spacing=spacing)
        return Cut(points.to(device), None)


def mesh_views(mesh: Mesh, size: int, cells: float) -> list[MeshView]:
    """A mesh from all sides, as large as the picture allows: `size` pixels and `cells` across."""
    low, high = mesh.bounds
    diameter = float(np.linalg.norm(high - low))
    points = np.concatenate([surface.points for surface in mesh.surfaces])
    points = (points - (low + high) / 2) * (cells / diameter)
    counts = np.cumsum([0, *(len(surface.points) for surface in mesh.surfaces)])
    faces = np.concatenate([s.faces + n for s, n in zip(mesh.surfaces, counts, strict=False)])
    views, random = [], np.random.default_rng(0)
    for _ in range(MESH_VIEWS):
        angles = random.uniform(0, 360), float(np.degrees(np.arcsin(random.uniform(-1, 1))))
        camera = Orthographic((0.0, 0.0, 0.0), *angles, height=cells)
        seen = visible(points, faces, camera, rows=size, columns=size)
        views.append(MeshView(seen.interpolate(points, faces).astype(np.float32), seen.covered))
    return views
