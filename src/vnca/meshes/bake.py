"""A solid texture as a picture on a mesh."""

import io
from dataclasses import dataclass

import numpy as np
from PIL import Image

from vnca.core.errors import OptionError
from vnca.core.typing import AnyArray, FloatArray
from vnca.io.mesh.mesh import Mesh
from vnca.io.picture import to_srgb8
from vnca.meshes.unwrap import TexelMap
from vnca.painting.block import Block


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
