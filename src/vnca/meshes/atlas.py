"""The texture of a mesh: where its surfaces lie in it, and a solid texture baked into it."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from PIL import Image

from vnca.core import AnyArray, FloatArray, IntArray
from vnca.core.errors import BackendUnavailableError, GridError, OptionError
from vnca.io.mesh import Mesh, Surface
from vnca.io.mesh.texture import Unwrapping
from vnca.io.picture import to_srgb8
from vnca.meshes import fragments, weights_at
from vnca.painting.block import Block

Unwrap: TypeAlias = Literal["auto", "always", "never"]

GUTTER = 4
"""Texels around a chart that go on with its surface: filters read them."""
WRONG = 1e-3
"""Share of the texels that two faces may share, and of the surface that may have none, before UVs
count as unusable: about what a patch takes of which one can tell the colour."""
SPARSE = 1e-3
"""Share of its fair part of the texture below which a face counts as having none, and of the whole
texture below which a mesh does: nothing but a few texels' colours would be seen."""
_NOBODY = -1
# A texel of the gutter goes on with the plane of its face, but not to the ends of the world.
_FARTHEST = 8.0


@dataclass(frozen=True, eq=False)
class TexelMap:
    """The texels of a texture that show a surface.

    Attributes:
        size: Rows and columns of the texture.
        texel: `[n]`, row · size + column.
        points: `[n, 3]`, where on the surface they are, +z up.
        overlap: Share of the covered texels that several faces claim.
        width: That of a texel on the surface, on average, in lengths of the mesh.
    """

    size: int
    texel: IntArray
    points: FloatArray
    overlap: float
    width: float = 0.0


@dataclass(frozen=True, eq=False)
class Atlas:
    """A mesh in one texture.

    Attributes:
        unwrappings: One a surface.
        texels: Those that show it.
        fault: Why UVs that were there are not used; None if they are, or were not asked for.
    """

    unwrappings: list[Unwrapping]
    texels: TexelMap
    fault: str | None = None


def unwrapped(mesh: Mesh, unwrap: Unwrap, *, size: int) -> Atlas:
    """UVs for all surfaces of a mesh, in one texture, and the texels under them.

    `auto` keeps UVs that are there if all of them fit into one texture, do not overlap, and give
    every face a place; `never` insists on them; `always` makes new ones.

    Raises:
        GridError: If the UVs there are cannot be used and have to be.
        BackendUnavailableError: If xatlas is needed and not installed.
    """
    fault = None
    if unwrap != "always":
        fault = _unusable(mesh.surfaces)
        if fault is None:
            kept = [Unwrapping(s.faces, s.uv) for s in mesh.surfaces if s.uv is not None]
            texels = texel_map(mesh.surfaces, kept, size)
            if texels.overlap <= WRONG:
                return Atlas(kept, texels)
            fault = f"{texels.overlap:.1%} of the texels belong to several faces"
        if unwrap == "never":
            raise GridError(f"{mesh.glb.path}: its UVs cannot be used ({fault}); `unwrap` always")
    made = _unwrap(mesh.surfaces, size)
    had_some = any(surface.uv is not None for surface in mesh.surfaces)
    return Atlas(made, texel_map(mesh.surfaces, made, size), fault if had_some else None)


def texel_map(
    surfaces: Sequence[Surface], unwrappings: Sequence[Unwrapping], size: int
) -> TexelMap:
    """Which texel of a `size` × `size` texture shows which point.

    Texels whose centres a face covers lie on it. Around them a gutter goes on in the plane of
    the nearest face: a solid texture is defined there too, so that a filter that reads beyond a
    seam reads what comes next. A face smaller than the texels gets the one in its middle.
    """
    corners = size * np.concatenate([u.uv[u.faces] for u in unwrappings]) - 0.5
    places = np.concatenate([s.points[s.faces] for s in surfaces])
    owner = np.full(size * size, _NOBODY, np.int32)
    inside, claimed = 0, np.zeros(size * size, bool)
    for part in fragments(corners, size, size):
        texel = part.row * size + part.column
        owner[texel] = part.triangle
        within = weights_at(corners[part.triangle], part.column, part.row).min(1) > 1e-4
        inside += int(within.sum())
        claimed[texel[within]] = True
    overlap = (inside - claimed.sum()) / max(inside, 1)
    _give_small_faces_a_texel(owner, corners, size)
    _widen(owner.reshape(size, size), GUTTER)
    texel = np.flatnonzero(owner != _NOBODY).astype(np.int32)
    points = np.empty((len(texel), 3), np.float32)
    for start in range(0, len(texel), 1 << 20):
        chunk = texel[start : start + (1 << 20)]
        faces = owner[chunk]
        weights = weights_at(corners[faces], chunk % size, chunk // size)
        weights = np.clip(weights, -_FARTHEST, _FARTHEST)
        weights[:, 0] = 1 - weights[:, 1] - weights[:, 2]
        points[start : start + (1 << 20)] = np.einsum("nk,nkc->nc", weights, places[faces])
    first, second = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    area = np.linalg.norm(np.cross(first, second), axis=1).sum() / 2
    width = float(np.sqrt(area / max(inside, 1)))
    return TexelMap(size, texel, points, float(overlap), width)


def _unusable(surfaces: Sequence[Surface]) -> str | None:
    for surface in surfaces:
        if surface.uv is None:
            return f"'{surface.name}' has none"
        used = surface.uv[surface.faces]
        # A NaN fails the comparison too.
        if not (used.min() >= -1e-6 and used.max() <= 1 + 1e-6):
            return f"those of '{surface.name}' leave the texture"
    uv = np.concatenate([s.uv[s.faces] for s in surfaces if s.uv is not None])
    areas = np.concatenate([_areas(s.points[s.faces]) for s in surfaces])
    given = _areas(uv)
    if not given.sum() > SPARSE:
        return f"they cover {given.sum():.2%} of the texture"
    starved = given < SPARSE * given.sum() * areas / max(areas.sum(), np.finfo(float).tiny)
    if areas[starved].sum() > WRONG * areas.sum():
        return f"{starved.sum()} of {len(areas)} faces have next to no area in the texture"
    return None


def _areas(triangles: AnyArray) -> AnyArray:
    """Of `[f, 3, dimension]`, `[f]`."""
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    if triangles.shape[-1] == 2:
        return np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    return np.linalg.norm(np.cross(a, b), axis=1) / 2


def _unwrap(surfaces: Sequence[Surface], size: int) -> list[Unwrapping]:
    """UVs by xatlas, all surfaces in one texture."""
    try:
        import xatlas
    except ImportError as error:
        raise BackendUnavailableError(
            "a mesh without usable UVs needs xatlas to unwrap it: pip install 'vnca[texture]'"
        ) from error
    atlas = xatlas.Atlas()
    # xatlas takes edges shorter than a millionth of a unit for nothing.
    extent = max(np.ptp(surface.points, axis=0).max() for surface in surfaces)
    for surface in surfaces:
        points = (surface.points - surface.points.min(0)) / extent
        atlas.add_mesh(points.astype(np.float32), surface.faces.astype(np.uint32))
    options = xatlas.PackOptions()
    options.resolution, options.padding = size, 2 * GUTTER
    atlas.generate(pack_options=options)
    made = []
    for index in range(len(surfaces)):
        source, faces, uv = atlas[index]
        made.append(Unwrapping(faces.astype(np.int64), np.clip(uv, 0, 1), source.astype(np.int64)))
    return made


def _give_small_faces_a_texel(owner: IntArray, corners: AnyArray, size: int) -> None:
    """Let faces that no texel's centre lies in own the free texel in their middle."""
    seen = np.zeros(len(corners), bool)
    seen[owner[owner != _NOBODY]] = True
    unseen = np.flatnonzero(~seen)
    column, row = np.clip(np.rint(corners[unseen].mean(1)), 0, size - 1).astype(np.int64).T
    texel = row * size + column
    free = owner[texel] == _NOBODY
    owner[texel[free]] = unseen[free]


def _widen(owner: IntArray, texels: int) -> None:
    """Give free texels to the owners beside them, so many times, in place."""
    forth, back = slice(1, None), slice(None, -1)
    for _ in range(texels):
        for lines in (owner, owner.T):
            before = lines.copy()
            for here, beside in ((forth, back), (back, forth)):
                free = lines[here] == _NOBODY
                lines[here][free] = before[beside][free]


@dataclass(frozen=True)
class Placement:
    """Where a mesh lies in the block: cell = (point − corner) · cells.

    Attributes:
        corner: `[3]`, the point that lies on cell (0, 0, 0).
        cells: Cells to a unit of the mesh.
    """

    corner: AnyArray
    cells: float

    @classmethod
    def of(cls, mesh: Mesh, *, size: int, scale: float) -> "Placement":
        """The block of `size` cells repeated `scale` times along the mesh's longest side.

        Raises:
            OptionError: If the scale is not positive.
        """
        if not 0 < scale < np.inf:
            raise OptionError(f"`scale` {scale}: must be positive")
        low, high = mesh.bounds
        return cls(low, size * scale / float((high - low).max()))

    def __call__(self, points: AnyArray) -> AnyArray:
        """Cell coordinates `[..., 3]` of points of the mesh."""
        return (points - self.corner) * self.cells


def bake(block: Block, texels: TexelMap, place: Placement) -> FloatArray:
    """The texture `[size, size, 3]`, linear RGB; texels without a surface blend in."""
    size = texels.size
    width = texels.width * place.cells
    picture = np.zeros((size * size, 3), np.float32)
    covered = np.zeros(size * size, np.float32)
    for start in range(0, len(texels.texel), 1 << 20):
        part = slice(start, start + (1 << 20))
        picture[texels.texel[part]] = block.at(place(texels.points[part]), width)
    covered[texels.texel] = 1
    return fill(picture.reshape(size, size, 3), covered.reshape(size, size))


def fill(picture: FloatArray, covered: FloatArray) -> FloatArray:
    """A picture `[s, s, 3]` whose uncovered pixels take the mean of what is near them.

    Each from the smallest of the blocks of 2, 4, 8, … pixels around it with anything in it: what
    a smaller version of the texture, as used far away, mixes in beside the charts is then theirs.

    Reference: Gortler et al. 1996, "The Lumigraph", section 3.5 (pull and push).
    """
    size = len(picture)
    if size == 1 or covered.all():
        return picture
    quarters = (size // 2, 2, size // 2, 2)
    weight = covered.reshape(quarters).sum((1, 3))
    total = (picture * covered[..., None]).reshape(*quarters, 3).sum((1, 3))
    smaller = fill(total / np.maximum(weight, 1)[..., None], np.minimum(weight, 1))
    larger = smaller.repeat(2, 0).repeat(2, 1)
    return np.where(covered[..., None] > 0, picture, larger)


def to_png(picture: FloatArray) -> bytes:
    """A linear picture as the bytes of an sRGB PNG file."""
    stream = io.BytesIO()
    Image.fromarray(to_srgb8(picture)).save(stream, "PNG")
    return stream.getvalue()
