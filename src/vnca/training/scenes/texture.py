"""The block a rule for a solid texture is trained on, and the planes it is seen on.

A slice is what an orthographic camera would see of a single plane: its target is the middle, its
angles are the slice's, and up in the picture is up in the block as far as the angle allows. A
pattern that has an up in the picture keeps it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from vnca.core import BoolArray, FloatArray
from vnca.core.camera import Orthographic, view_axes
from vnca.engine.domain import Domain
from vnca.io.mesh import Mesh
from vnca.meshes import visible
from vnca.painting.block import block_domain
from vnca.rendering.colour import linear_to_srgb
from vnca.rendering.march import sample
from vnca.rule import PRIORS, Decoder
from vnca.training.config import SliceConfig
from vnca.training.scenes import Scene, as_light, colours

Angles = tuple[float, float]
"""Azimuth and elevation, degrees."""

DIAGONAL = math.degrees(math.asin(math.sqrt(1 / 3)))
"""Elevation of a view along a diagonal of the block."""
UNSEEN = 15.0
"""Degrees around the block's diagonals that training keeps out of: what a rule shows there, it
was not taught."""


def axis_angles(random: np.random.Generator) -> Angles:
    """A plane along two axes of the block: from one of four sides, or from above or below."""
    elevation = random.choice([-90.0, 0.0, 0.0, 0.0, 0.0, 90.0])
    return 90.0 * int(random.integers(4)), float(elevation)


def oblique_angles(random: np.random.Generator) -> Angles:
    """A plane at any angle, uniform over the sphere, but those of `unseen_angles`."""
    while True:
        azimuth = random.uniform(0, 360)
        elevation = math.degrees(math.asin(random.uniform(-1, 1)))
        if not is_unseen(azimuth, elevation):
            return azimuth, elevation


def unseen_angles(random: np.random.Generator) -> Angles:
    """A plane across a diagonal of the block, within a few degrees."""
    while True:
        azimuth = 45.0 + 90.0 * int(random.integers(4)) + random.uniform(-UNSEEN, UNSEEN)
        elevation = random.choice([-1, 1]) * (DIAGONAL + random.uniform(-UNSEEN, UNSEEN))
        if is_unseen(azimuth, elevation):
            return azimuth, elevation


FAMILIES: dict[str, Callable[[np.random.Generator], Angles]] = {
    "axis": axis_angles,
    "oblique": oblique_angles,
    "unseen": unseen_angles,
}
"""Slices by what training knows of them: the first two kinds it draws, the third never."""


def is_unseen(azimuth: float, elevation: float) -> bool:
    """Whether a plane's normal is near a diagonal of the block."""
    normal = np.abs(view_axes(azimuth, elevation)[2])
    return bool(normal.sum() / math.sqrt(3) > math.cos(math.radians(UNSEEN)))


def slice_points(
    angles: Angles, middle: np.ndarray, *, size: int, spacing: float = 1.0
) -> Float[Tensor, "r c 3"]:
    """Cell coordinates of the pixels of a slice."""
    x, y, z = (float(value) for value in middle)
    plane = Orthographic((x, y, z), *angles, height=size * spacing)
    return torch.from_numpy(plane.rays(size, size)[0].astype(np.float32))


def periodic(block: Float[Tensor, "x y z c"]) -> Float[Tensor, "_ _ _ c"]:
    """A block with its first cells repeated behind the last, to be read up to its border."""
    padded = functional.pad(block.permute(3, 0, 1, 2)[None], (0, 1) * 3, mode="circular")
    return padded[0].permute(1, 2, 3, 0)


def shown(
    block: Float[Tensor, "x y z c"], points: Float[Tensor, "*pixels 3"]
) -> Float[Tensor, "*pixels c"]:
    """Values of a block that tiles space at points in cells, trilinear; differentiable."""
    inside = torch.remainder(points, points.new_tensor(block.shape[:3])).view(-1, 3)
    return sample(periodic(block), inside).view(*points.shape[:-1], -1)


def averaged(samples: Float[Tensor, "_ _ c"], along: int) -> Float[Tensor, "_ _ c"]:
    """Pixels of which each is the mean of `along` × `along` samples; differentiable."""
    if along == 1:
        return samples
    rows, columns, channels = samples.shape
    return samples.view(rows // along, along, columns // along, along, channels).mean((1, 3))


def as_picture(colour: Float[Tensor, "r c 3"]) -> Float[Tensor, "1 3 r c"]:
    """Linear RGB as the appearance loss wants it: sRGB, channels first."""
    return linear_to_srgb(colour).permute(2, 0, 1)[None]


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

    All its cells are active; it is its own neighbour on every side. Priors are zero: a texture is
    the same everywhere. Its rule leaves the density alone: smoke painted with it keeps its shape.
    """

    paints_density = False

    def __init__(
        self,
        size: int,
        slices: SliceConfig,
        *,
        conditioning_width: int = PRIORS,
        domain: Domain | None = None,
        mesh: Mesh | None = None,
        decoder: Decoder | None = None,
        device: torch.device | str = "cpu",
        backend: str = "auto",
    ) -> None:
        """Prepare a block.

        Args:
            size: Cells along an edge.
            slices: How it is looked at.
            conditioning_width: Numbers that a cell is conditioned on: all are zero here.
            domain: Cells that tile space; all of the block unless given.
            mesh: Seen from all sides beside the slices.
            decoder: What is seen between cells; they are interpolated unless given.
            device: Where rollouts and pictures are computed.
            backend: What decodes.

        Raises:
            OptionError: If the size cannot work.
        """
        domain = domain or block_domain(size)
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
        return as_light(self.seen(state, points.view(-1, 3)))[0].view(points.shape)

    def drift(self, random: np.random.Generator) -> FloatArray:
        """Any way, about a cell and a half: all of the block alike."""
        return random.standard_normal(3).astype(np.float32)

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

    @torch.no_grad()
    def seen_shares(self, shares: Tensor, viewpoint: list[Cut]) -> Tensor:
        """See `Scene.seen_shares`."""
        size, samples = self.slices.size, self.slices.supersampling
        field, pictures = self.dense(shares[:, None]), []
        for points, covered in viewpoint:
            part = shown(field, points)
            if covered is not None:
                empty = field.new_full((*covered.shape, 1), torch.nan)
                part = empty.index_put((covered,), part)
            pictures.append(averaged(part, samples).view(size, size))
        return torch.stack(pictures)

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

    def angles(self, random: np.random.Generator) -> Angles:
        """Of a slice, drawn at random."""
        oblique = random.uniform() < self.slices.oblique
        return oblique_angles(random) if oblique else axis_angles(random)

    def _cut(self, random: np.random.Generator) -> Cut:
        device = self.priors.device
        middle = random.uniform(0, self.domain.box.shape[0], 3)
        if self.views and random.uniform() < self.slices.mesh:
            view = self.views[int(random.integers(len(self.views)))]
            points = torch.from_numpy(view.points + middle.astype(np.float32))
            return Cut(points.to(device), torch.from_numpy(view.covered).to(device))
        angles = self.angles(random)
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
