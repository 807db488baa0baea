import io

import numpy as np
import pytest
import trimesh
from PIL import Image

from vnca.core import FloatArray
from vnca.core.errors import OptionError
from vnca.io.mesh import Mesh, read_mesh
from vnca.io.mesh.texture import BaseColour
from vnca.meshes.atlas import Placement, TexelMap, bake, fill, to_png, unwrapped
from vnca.meshes.turntable import read_picture
from vnca.painting.block import Block, sample_block


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Mesh:
    path = tmp_path_factory.mktemp("ball") / "ball.glb"
    trimesh.creation.icosphere(2, radius=3).export(path)
    return read_mesh(path)


@pytest.fixture(scope="module")
def block() -> FloatArray:
    """Smooth waves that tile."""
    x, y, z = np.meshgrid(*[np.arange(16) * np.pi / 8] * 3, indexing="ij")
    return (0.5 + 0.4 * np.stack([np.sin(x), np.cos(y), np.sin(y + z)], -1)).astype(np.float32)


def test_the_block_repeats_as_often_as_asked_along_the_longest_side(ball: Mesh) -> None:
    low, high = ball.bounds
    for scale in (0.5, 1.0, 3.0):
        place = Placement.of(ball, size=16, scale=scale)
        np.testing.assert_allclose(np.ptp(place(np.stack([low, high])), 0).max(), 16 * scale)
    with pytest.raises(OptionError, match="`scale`"):
        Placement.of(ball, size=16, scale=0)


def test_the_texture_shows_the_solid_everywhere_and_on_both_sides_of_seams(
    ball: Mesh, block: FloatArray
) -> None:
    """Read as a viewer reads it, bilinearly, also right at the border of a chart."""
    atlas = unwrapped(ball, "auto", size=512)
    place = Placement.of(ball, size=16, scale=1)
    picture = bake(Block(block), atlas.texels, place)
    (surface,), (unwrapping,) = ball.surfaces, atlas.unwrappings
    random = np.random.default_rng(0)
    inside = random.dirichlet((1, 1, 1), len(surface.faces))
    on_edge = np.insert(random.dirichlet((1, 1), len(surface.faces)), 1, 0, axis=1)
    for weights in (inside, on_edge, np.eye(3)[random.integers(3, size=len(surface.faces))]):
        points = np.einsum("fk,fkc->fc", weights, surface.points[surface.faces])
        uv = np.einsum("fk,fkc->fc", weights, unwrapping.uv[unwrapping.faces])
        shown = read_picture(BaseColour(uv, picture, repeats=False), uv)
        np.testing.assert_allclose(shown, sample_block(block, place(points)), atol=0.03)


def test_only_texels_without_a_surface_are_filled(block: FloatArray) -> None:
    at = np.random.default_rng(0).uniform(0, 16, (40, 3)).astype(np.float32)
    texel = np.random.default_rng(1).choice(64**2, 40, replace=False).astype(np.int32)
    place = Placement(np.zeros(3), 1.0)
    picture = bake(Block(block), TexelMap(64, texel, at, 0.0), place)
    np.testing.assert_array_equal(picture.reshape(-1, 3)[texel], sample_block(block, at))
    others = np.delete(picture.reshape(-1, 3), texel, 0)
    assert (others > 0).any(1).all()


def test_filling_takes_the_mean_of_what_is_near() -> None:
    picture = np.zeros((8, 8, 3), np.float32)
    covered = np.zeros((8, 8), np.float32)
    picture[0, 0], picture[1, 1], picture[7, 7] = 0.2, 0.4, 0.9
    covered[0, 0] = covered[1, 1] = covered[7, 7] = 1
    filled = fill(picture, covered)
    assert filled[0, 0, 0] == np.float32(0.2)
    assert filled[0, 1, 0] == pytest.approx(0.3)
    assert filled[3, 3, 0] == pytest.approx(0.3)
    assert filled[6, 7, 0] == pytest.approx(0.9)
    assert 0.3 < filled[0, 7, 0] < 0.9
    np.testing.assert_array_equal(fill(filled, np.ones((8, 8), np.float32)), filled)
    assert not fill(0 * picture, 0 * covered).any()


def test_pictures_are_stored_as_srgb() -> None:
    with Image.open(io.BytesIO(to_png(np.full((2, 2, 3), 0.2140, np.float32)))) as image:
        assert image.getpixel((0, 0)) == (127, 127, 127)
