import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from vnca.core.errors import BackendUnavailableError, GridError
from vnca.io.mesh import Mesh, read_mesh
from vnca.io.mesh.texture import Unwrapping
from vnca.meshes.atlas import GUTTER, texel_map, unwrapped


def opened(tmp_path: Path, mesh: trimesh.Trimesh) -> Mesh:
    mesh.export(tmp_path / "mesh.glb")
    return read_mesh(tmp_path / "mesh.glb")


def with_uv(mesh: trimesh.Trimesh, uv: np.ndarray) -> trimesh.Trimesh:
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv)
    return mesh


def plane(uv: np.ndarray | None = None) -> trimesh.Trimesh:
    """A unit square; its UVs are its x and y."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    mesh = trimesh.Trimesh(points, [[0, 1, 2], [0, 2, 3]], process=False)
    return with_uv(mesh, points[:, :2] if uv is None else uv)


def test_texels_lie_where_the_surface_is(tmp_path: Path) -> None:
    mesh = opened(tmp_path, plane())
    atlas = unwrapped(mesh, "auto", size=64)
    made, texels = atlas.unwrappings, atlas.texels
    assert made[0].source is None
    assert len(texels.texel) == 64**2
    row, column = np.divmod(texels.texel, 64)
    # The file's x and y; v goes down in the texture, and up was y.
    np.testing.assert_allclose(texels.points[:, 0], (column + 0.5) / 64, atol=1e-6)
    np.testing.assert_allclose(texels.points[:, 2], 1 - (row + 0.5) / 64, atol=1e-6)


def test_the_gutter_goes_on_with_the_plane(tmp_path: Path) -> None:
    mesh = opened(tmp_path, plane(0.25 + 0.5 * plane().vertices[:, :2]))
    texels = unwrapped(mesh, "auto", size=64).texels
    row, column = np.divmod(texels.texel, 64)
    assert len(texels.texel) == (32 + 2 * GUTTER) ** 2
    np.testing.assert_allclose(texels.points[:, 0], (column + 0.5) / 32 - 0.5, atol=1e-6)
    np.testing.assert_allclose(texels.points[:, 2], 1.5 - (row + 0.5) / 32, atol=1e-6)


@pytest.mark.parametrize(
    "uv",
    [
        np.array([[0, 0], [2, 0], [2, 2], [0, 2.0]]),  # tiles
        np.array([[0, 0], [1, 0], [0, 1], [1, 0.0]]),  # one half upon the other
        np.array([[0, 0], [np.nan, 0], [1, 1], [0, 1.0]]),
    ],
)
def test_uvs_that_cannot_carry_a_solid_texture_are_replaced(tmp_path: Path, uv: np.ndarray) -> None:
    mesh = opened(tmp_path, plane())
    (surface,) = mesh.surfaces
    object.__setattr__(surface, "uv", uv)
    atlas = unwrapped(mesh, "auto", size=64)
    made, texels = atlas.unwrappings, atlas.texels
    assert made[0].source is not None
    assert texels.overlap == 0
    assert atlas.fault is not None
    with pytest.raises(GridError, match=r"mesh\.glb: its UVs cannot be used"):
        unwrapped(mesh, "never", size=64)


DATA = Path(__file__).parents[1] / "data"


@pytest.mark.parametrize("name", ["uv_zero.glb", "uvhalfpt.obj"])
def test_uvs_that_are_all_one_point_are_replaced(name: str) -> None:
    mesh = read_mesh(DATA / name)
    atlas = unwrapped(mesh, "auto", size=128)
    assert atlas.fault == "they cover 0.00% of the texture"
    assert len(atlas.texels.texel) > 0.4 * 128**2
    with pytest.raises(GridError, match=r"0\.00% of the texture\); `unwrap` always"):
        unwrapped(mesh, "never", size=128)


def grid(uv: Callable[[np.ndarray], np.ndarray]) -> trimesh.Trimesh:
    """A square of 20 × 20 squares; its UVs are what a function makes of its x and y."""
    points = np.insert(np.stack(np.mgrid[:21, :21], -1).reshape(-1, 2) / 20, 2, 0, axis=1)
    corner = (np.arange(20)[:, None] * 21 + np.arange(20)).ravel()
    quads = np.stack([corner, corner + 21, corner + 22, corner + 1], 1)
    mesh = trimesh.Trimesh(points, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3), process=False)
    mesh.unmerge_vertices()
    return with_uv(mesh, uv(mesh.vertices[:, :2]))


def collapsed(at: np.ndarray, rows: int, to: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """The triangles of the first rows of squares go where a function puts them."""
    uv = at.copy()
    uv[: 120 * rows] = to(at[: 120 * rows])
    return uv


@pytest.mark.parametrize(
    "to",
    [
        lambda at: 0 * at + 0.5,  # a point
        lambda at: at * [1, 0] + [0, 1 / 3],  # a line
        lambda at: at @ [[0.3, 0.7], [0, 0]] + 1 / 7,  # a slanting line, but for rounding
        lambda at: 1e-3 * at,  # a speck
    ],
    ids=["point", "line", "slant", "speck"],
)
@pytest.mark.parametrize("turned", [False, True])
def test_a_part_without_room_in_the_texture_makes_uvs_unusable(
    tmp_path: Path, to: Callable[[np.ndarray], np.ndarray], turned: bool
) -> None:
    def uv(at: np.ndarray) -> np.ndarray:
        found = collapsed(at, 1, to)
        return found[:, ::-1] if turned else found

    mesh = opened(tmp_path, grid(uv))
    atlas = unwrapped(mesh, "auto", size=64)
    assert atlas.fault == "40 of 800 faces have next to no area in the texture"
    assert atlas.texels.overlap == 0


def test_uneven_but_usable_uvs_are_kept(tmp_path: Path) -> None:
    mesh = opened(tmp_path, grid(lambda at: collapsed(at, 1, lambda part: part / 10)))
    # Ten times as coarse in one row; the rest of the texture is not all used.
    object.__setattr__(mesh.surfaces[0], "uv", mesh.surfaces[0].uv * [0.2, 0.2])
    atlas = unwrapped(mesh, "auto", size=512)
    assert atlas.fault is None
    assert atlas.unwrappings[0].source is None


def test_faces_without_area_on_the_surface_need_none_in_the_texture(tmp_path: Path) -> None:
    plain = grid(lambda at: at)
    degenerate = plain.faces.copy()
    degenerate[5] = degenerate[5, 0]
    mesh = with_uv(
        trimesh.Trimesh(plain.vertices, np.concatenate([plain.faces, degenerate[5:6]]),
                        process=False), plain.visual.uv,
    )  # fmt: skip
    assert unwrapped(opened(tmp_path, mesh), "auto", size=64).unwrappings[0].source is None


@pytest.mark.parametrize(("share", "used"), [(0, True), (2, False)])
def test_a_small_overlap_is_found(tmp_path: Path, share: int, used: bool) -> None:
    def uv(at: np.ndarray) -> np.ndarray:
        found = at.copy()
        found[: 3 * share] = at[-3 * share :] if share else at[:0]
        return found

    atlas = unwrapped(opened(tmp_path, grid(uv)), "auto", size=256)
    assert (atlas.fault is None) == used
    assert used or "belong to several faces" in str(atlas.fault)


def test_meshes_without_any_uvs_had_no_fault(tmp_path: Path) -> None:
    assert unwrapped(opened(tmp_path, trimesh.creation.box()), "auto", size=64).fault is None


def test_new_uvs_are_made_where_asked_for_or_missing(tmp_path: Path) -> None:
    made = unwrapped(opened(tmp_path, plane()), "always", size=64).unwrappings
    assert made[0].source is not None
    box = opened(tmp_path, trimesh.creation.box())
    made = unwrapped(box, "auto", size=64).unwrappings
    assert made[0].source is not None
    with pytest.raises(GridError, match="has none"):
        unwrapped(box, "never", size=64)


def test_several_objects_share_one_texture_without_overlap(tmp_path: Path) -> None:
    scene = trimesh.Scene([trimesh.creation.icosphere(2), trimesh.creation.box()])
    scene.export(tmp_path / "two.glb")
    mesh = read_mesh(tmp_path / "two.glb")
    atlas = unwrapped(mesh, "auto", size=256)
    made, texels = atlas.unwrappings, atlas.texels
    assert len(made) == 2
    assert texels.overlap == 0
    # Texels lie on the ball of radius 1 or on the box, but for the gutter.
    distance = np.abs(np.linalg.norm(texels.points, axis=1) - 1)
    on_box = np.abs(np.abs(texels.points).max(1) - 0.5)
    assert np.mean(np.minimum(distance, on_box) < 0.02) > 0.9
    for surface, unwrapping in zip(mesh.surfaces, made, strict=True):
        assert unwrapping.source is not None
        np.testing.assert_allclose(
            surface.points[unwrapping.source[unwrapping.faces]], surface.points[surface.faces]
        )


def test_every_face_owns_a_texel_even_where_it_is_smaller_than_one(tmp_path: Path) -> None:
    mesh = opened(tmp_path, trimesh.creation.icosphere(4))  # 5120 faces for 4096 texels
    atlas = unwrapped(mesh, "always", size=64)
    made, texels = atlas.unwrappings, atlas.texels
    assert np.abs(np.linalg.norm(texels.points, axis=1) - 1).max() < 0.3
    uv = made[0].uv[made[0].faces].mean(1)
    column, row = np.floor(64 * np.clip(uv, 0, 1 - 1e-9)).astype(int).T
    assert np.isin(row * 64 + column, texels.texel).all()


def test_faces_without_area_and_needles_do_no_harm(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(2)
    faces = np.concatenate([ball.faces, [[0, 0, 1], [5, 5, 5], [0, 1, 1]]])
    points = np.concatenate([ball.vertices, [[0, 0, 0], [100, 0, 0], [100, 1e-7, 0]]])
    needle = [[len(ball.vertices) + i for i in range(3)]]
    broken = trimesh.Trimesh(points, np.concatenate([faces, needle]), process=False)
    mesh = opened(tmp_path, broken)
    atlas = unwrapped(mesh, "auto", size=256)
    made, texels = atlas.unwrappings, atlas.texels
    assert np.isfinite(texels.points).all()
    assert made[0].faces.shape == (324, 3)
    assert len(texels.texel)


def test_meshes_far_away_and_tiny_are_unwrapped_as_others(tmp_path: Path) -> None:
    small = trimesh.creation.icosphere(2, radius=1e-4)
    texels = unwrapped(opened(tmp_path, small), "auto", size=128).texels
    assert len(texels.texel) > 0.4 * 128**2


def test_a_missing_xatlas_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = opened(tmp_path, trimesh.creation.box())
    monkeypatch.setitem(sys.modules, "xatlas", None)
    with pytest.raises(BackendUnavailableError, match=r"vnca\[texture\]"):
        unwrapped(mesh, "auto", size=64)


def test_a_map_of_nothing_but_specks_is_not_empty(tmp_path: Path) -> None:
    mesh = opened(tmp_path, plane(1e-4 * plane().vertices[:, :2]))
    (surface,) = mesh.surfaces
    texels = texel_map([surface], [Unwrapping(surface.faces, surface.uv)], 64)
    assert len(texels.texel) >= 1
    assert texels.overlap == 0
