from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from vnca.core import FloatArray
from vnca.core.camera import parse_colour
from vnca.core.errors import OptionError
from vnca.io.mesh import read_mesh
from vnca.io.mesh.texture import put_on
from vnca.meshes.atlas import Placement, bake, to_png, unwrapped
from vnca.meshes.turntable import Turntable, TurntableConfig, solid, textured
from vnca.painting.block import Block

FILM = TurntableConfig(rows=48, columns=64, frames=4)


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    trimesh.creation.icosphere(3, radius=2).export(tmp_path / "ball.glb")
    return tmp_path / "ball.glb"


@pytest.fixture
def block() -> FloatArray:
    x, y, z = np.meshgrid(*[np.arange(16) * np.pi / 8] * 3, indexing="ij")
    return (0.5 + 0.4 * np.stack([np.sin(x), np.cos(y), np.sin(z)], -1)).astype(np.float32)


def test_the_baked_mesh_looks_like_the_solid_from_all_sides(ball: Path, block: FloatArray) -> None:
    """Without seams: the texture and the solid itself give the same film."""
    mesh = read_mesh(ball)
    place = Placement.of(mesh, size=16, scale=1)
    atlas = unwrapped(mesh, "auto", size=256)
    put_on(mesh, atlas.unwrappings, to_png(bake(Block(block), atlas.texels, place)))
    mesh.glb.write(ball.with_name("textured.glb"))
    baked = read_mesh(ball.with_name("textured.glb"))
    before, after = Turntable(mesh, FILM), Turntable(baked, FILM)
    seen, shown = solid(before, place, Block(block)), textured(after, baked)
    pictures = []
    for frame in range(4):
        expected, found = before.picture(frame, seen), after.picture(frame, shown)
        assert np.abs(found - expected).mean() < 0.003
        assert np.quantile(np.abs(found - expected), 0.999) < 0.03
        pictures.append(found)
    assert np.abs(pictures[0] - pictures[2]).mean() > 0.01


def test_a_turning_mesh_stays_in_the_picture(tmp_path: Path) -> None:
    trimesh.creation.box((8, 1, 1)).export(tmp_path / "bar.glb")
    table = Turntable(read_mesh(tmp_path / "bar.glb"), replace(FILM, frames=16))
    for frame in range(16):
        picture = table.picture(frame, lambda triangles, _: np.zeros((len(triangles), 3)))
        border = np.concatenate(
            [picture[[0, -1]].reshape(-1, 3), picture[:, [0, -1]].reshape(-1, 3)]
        )
        np.testing.assert_allclose(border, parse_colour(FILM.background)[0], atol=1e-6)
        assert picture.min() < 0.1


def test_a_turning_mesh_keeps_its_size(ball: Path) -> None:
    table = Turntable(read_mesh(ball), replace(FILM, frames=16))
    covered = [
        np.mean(table.picture(frame, lambda triangles, _: np.zeros((len(triangles), 3))) < 0.5)
        for frame in range(16)
    ]
    np.testing.assert_allclose(covered, covered[0], rtol=0.01)


@pytest.mark.parametrize("inverted", [False, True])
def test_the_lit_side_is_brighter_also_inside_out(tmp_path: Path, inverted: bool) -> None:
    ball = trimesh.creation.icosphere(3)
    if inverted:
        ball.invert()
    ball.export(tmp_path / "ball.glb")
    table = Turntable(read_mesh(tmp_path / "ball.glb"), FILM)
    picture = table.picture(0, lambda triangles, _: np.ones((len(triangles), 3)))
    assert picture[14, 38, 0] > 0.9
    assert picture[40, 24, 0] < 0.7


def test_colours_without_a_texture_are_shown(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 255])
    box.visual = trimesh.visual.TextureVisuals(material=material)
    box.export(tmp_path / "red.glb")
    mesh = read_mesh(tmp_path / "red.glb")
    table = Turntable(mesh, FILM)
    picture = table.picture(0, textured(table, mesh))
    assert picture[24, 32, 0] > 0.3
    assert picture[24, 32, 1] == 0


@pytest.mark.parametrize(
    "wrong",
    [
        {"rows": 2},
        {"frames": 0},
        {"elevation": 91.0},
        {"turn": float("nan")},
        {"fps": 0.0},
    ],
)
def test_values_that_cannot_work_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(OptionError):
        TurntableConfig(**wrong)  # type: ignore[arg-type]
