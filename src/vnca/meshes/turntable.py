"""Pictures of a textured mesh, lit simply: what one looks at before opening Blender."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.camera import Orthographic, Shot, parse_colour, view_axes
from vnca.core.errors import OptionError
from vnca.io.mesh import Mesh
from vnca.io.mesh.texture import BaseColour, base_colours
from vnca.meshes import visible
from vnca.meshes.atlas import Placement
from vnca.painting.block import Block

SAMPLES = 2
"""Samples along either side of a pixel."""
AMBIENT = 0.45
"""Share of the light that comes from everywhere; the rest comes from over the right shoulder."""

MARGIN = 0.04
"""Part of the picture's height and width left free on every side."""

Shader = Callable[[AnyArray, AnyArray], AnyArray]
"""Linear RGB `[n, 3]` of points, from their triangles `[n]` and corner weights `[n, 3]`."""


@dataclass(frozen=True)
class TurntableConfig(Shot):
    """How a mesh is filmed."""

    elevation: float = 15.0
    """How far above the horizon it stands, degrees."""
    turn: float = 360.0
    """Degrees the camera goes around the mesh."""
    background: str = "#f4f4f4"
    """Colour behind the mesh, #rrggbb."""
    frames: int = 96
    """Pictures in the film."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.frames < 1:
            raise OptionError(f"`frames` {self.frames}: at least 1 is needed")


class Turntable:
    """A mesh on a turntable.

    Attributes:
        points: `[v, 3]`, vertices of all surfaces.
        faces: `[f, 3]`, rows of `points`: the triangles that shaders are asked for.
    """

    def __init__(self, mesh: Mesh, config: TurntableConfig) -> None:
        """Prepare."""
        counts = np.cumsum([0, *(len(surface.points) for surface in mesh.surfaces)])
        self.points = np.concatenate([surface.points for surface in mesh.surfaces])
        self.faces = np.concatenate(
            [s.faces + n for s, n in zip(mesh.surfaces, counts, strict=False)]
        )
        self._config = config
        low, high = mesh.bounds
        self._middle = (low + high) / 2
        # The picture holds every point wherever the turn takes it, so that the mesh keeps its size.
        offset = self.points - self._middle
        radius = np.linalg.norm(offset[:, :2], axis=1)
        tilt = np.radians(abs(config.elevation))
        tall = (np.abs(offset[:, 2]) * np.cos(tilt) + radius * np.sin(tilt)).max()
        wide = radius.max() * config.rows / config.columns
        self._height = float(2 * max(tall, wide) / (1 - 2 * MARGIN))
        self._normals = _vertex_normals(self.points, self.faces)

    def at(self, points: AnyArray) -> Callable[[AnyArray, AnyArray], AnyArray]:
        """Values `[n, k]` at places on the surface, interpolated from `[v, k]`."""

        def values(triangles: AnyArray, weights: AnyArray) -> AnyArray:
            return np.einsum("nkc,nk->nc", points[self.faces[triangles]], weights)

        return values

    def picture(self, frame: int, shader: Shader) -> FloatArray:
        """A picture of the film, linear RGB `[r, c, 3]`."""
        config = self._config
        rows, columns = SAMPLES * config.rows, SAMPLES * config.columns
        azimuth = config.azimuth + config.turn * frame / config.frames
        x, y, z = self._middle.tolist()
        camera = Orthographic((x, y, z), azimuth, config.elevation, height=self._height)
        seen = visible(self.points, self.faces, camera, rows=rows, columns=columns)
        covered, weights = seen.covered, seen.weights[seen.covered]
        triangles = seen.triangle[covered]
        normals = self.at(self._normals)(triangles, weights)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        right, up, forward = view_axes(azimuth, config.elevation)
        light = 0.5 * right + 0.6 * up - forward
        # A side seen from inside, or of a mesh that is inside out, is lit like any other.
        facing = np.where((normals @ forward)[:, None] > 0, -normals, normals)
        lambert = np.clip(facing @ (light / np.linalg.norm(light)), 0, 1)
        picture = np.empty((rows, columns, 3), np.float32)
        picture[:] = parse_colour(config.background)
        picture[covered] = shader(triangles, weights) * (AMBIENT + (1 - AMBIENT) * lambert[:, None])
        shape = (config.rows, SAMPLES, config.columns, SAMPLES, 3)
        return picture.reshape(shape).mean((1, 3))


def _vertex_normals(points: AnyArray, faces: AnyArray) -> AnyArray:
    """Directions `[v, 3]` of the faces around each place, larger faces counting more.

    Vertices that a seam has split are one place.
    """
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    _, place = np.unique(points, axis=0, return_inverse=True)
    place = place.reshape(-1)
    total = np.zeros((place.max() + 1, 3))
    for corner in range(3):
        np.add.at(total, place[faces[:, corner]], normals)
    return total[place]


def solid(table: Turntable, place: Placement, block: Block) -> Shader:
    """Shows a block of solid texture, as baked at endless resolution."""
    points = table.at(table.points)
    return lambda triangles, weights: block.at(place(points(triangles, weights)))


def textured(table: Turntable, mesh: Mesh) -> Shader:
    """Shows the base colours in a file, filtered as a viewer would.

    Raises:
        FileFormatError: If the file is damaged, or a picture is not in it.
    """
    colours = base_colours(mesh)
    uv = table.at(np.concatenate([colour.uv for colour in colours]))
    ends = np.cumsum([len(surface.faces) for surface in mesh.surfaces])

    def shade(triangles: AnyArray, weights: AnyArray) -> AnyArray:
        at = uv(triangles, weights)
        found = np.zeros((len(triangles), 3), np.float32)
        for index in np.unique(surface := np.searchsorted(ends, triangles, side="right")):
            here = surface == index
            found[here] = read_picture(colours[index], at[here])
        return found

    return shade


def read_picture(colour: BaseColour, uv: AnyArray) -> AnyArray:
    """Linear RGB `[n, 3]` of a base colour at UVs `[n, 2]`, bilinear."""
    rows, columns = colour.picture.shape[:2]
    column, row = uv[:, 0] * columns - 0.5, uv[:, 1] * rows - 0.5
    left, top = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    mode = "wrap" if colour.repeats else "clip"
    total = np.zeros((len(uv), 3))
    for right, lower in np.ndindex(2, 2):
        across = np.abs(column - left - (1 - right))
        down = np.abs(row - top - (1 - lower))
        texel = np.ravel_multi_index((top + lower, left + right), (rows, columns), mode=mode)
        total += (across * down)[:, None] * colour.picture.reshape(-1, 3)[texel]
    return total
