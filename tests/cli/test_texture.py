import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from vnca.core import Box
from vnca.io.mesh.glb import Glb
from vnca.io.vdb import open_vdb
from vnca.rule import DENSITY_CHANGE, RuleConfig
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.config import TextureConfig
from vnca.training.trainers import initial_rule

Vnca = Callable[..., Any]

SMALL = ("--block", 16, "--steps", 6)
TINY = (
    *("--block", 16, "--slice.size", 32, "--slice.count", 2, "--hidden", 8, "--channels", 6),
    *("--iterations", 2, "--shortest-rollout", 2, "--longest-rollout", 3, "--device", "cpu"),
    *("--appearance.samples", 64, "--appearance.layers", "stem", "block1"),
)


@pytest.fixture
def texture(tmp_path: Path) -> Path:
    """The folder of a run whose model was made up."""
    plain: dict[str, Any] = {f"{name}_prior": False for name in ("position", "density", "velocity")}
    rule = initial_rule(TextureConfig(rule=RuleConfig(channels=6, hidden=8, **plain)))
    output = np.random.default_rng(4).normal(0, 0.3, rule.output.shape).astype(np.float32)
    output[DENSITY_CHANGE] = 0  # as training leaves it
    model = Model(replace(rule, output=output), {"kind": "texture", "style": "gold.png"})
    model.save(tmp_path / "texture" / MODEL_NAME)
    return tmp_path / "texture"


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    trimesh.creation.icosphere(2).export(tmp_path / "ball.obj")
    return tmp_path / "ball.obj"


def test_a_run_leaves_a_model_that_bakes(
    vnca: Vnca, style: Path, mesh: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    outcome = vnca("texture", "train", style, "--out", run, "--mesh", mesh, *TINY)
    assert outcome.code == 0, outcome.err
    model = Model.load(run)
    assert model.training["kind"] == "texture"
    assert model.training["style"] == "style.png"
    assert model.training["mesh"] == "ball.obj"
    assert model.training["iterations"] == 2
    assert model.rule.output.any()
    assert not model.rule.config.density_prior
    assert model.style is not None
    config = json.loads((run / "config.json").read_text())["config"]
    assert config["slice"]["size"] == 32
    assert (run / "preview_000002.png").exists()
    outcome = vnca("texture", "bake", run, mesh, "--out", tmp_path / "a.glb", *SMALL, "--size", 64)
    assert outcome.code == 0, outcome.err


def test_same_seed_same_bytes(vnca: Vnca, style: Path, tmp_path: Path) -> None:
    for name in "ab":
        assert vnca("texture", "train", style, "--out", tmp_path / name, *TINY).code == 0
    a, b = ((tmp_path / name / MODEL_NAME).read_bytes() for name in "ab")
    assert a == b


def test_an_earlier_run_is_not_overwritten_unasked(vnca: Vnca, style: Path, texture: Path) -> None:
    assert "--overwrite" in vnca("texture", "train", style, "--out", texture, *TINY).complaint


@pytest.mark.parametrize("suffix", ["glb", "obj", "ply", "stl"])
def test_meshes_of_every_format_are_textured(
    vnca: Vnca, texture: Path, tmp_path: Path, suffix: str
) -> None:
    source, out = tmp_path / f"ball.{suffix}", tmp_path / "out.glb"
    trimesh.creation.icosphere(2).export(source)
    outcome = vnca("texture", "bake", texture, source, "--out", out, "--size", 128, *SMALL)
    assert outcome.code == 0, outcome.err
    (shape,) = trimesh.load_scene(out).geometry.values()
    assert shape.area == pytest.approx(trimesh.creation.icosphere(2).area, rel=1e-4)
    picture = np.asarray(shape.visual.material.baseColorTexture)
    assert picture.shape == (128, 128, 3)
    assert picture.std() > 5


def test_unusable_uvs_are_told_of_and_replaced(vnca: Vnca, texture: Path, tmp_path: Path) -> None:
    source = Path(__file__).parents[1] / "data/uv_zero.glb"
    out = tmp_path / "out.glb"
    arguments = ("texture", "bake", texture, source, "--out", out, "--size", 64, *SMALL)
    assert "0.00% of the texture" in vnca(*arguments, "--unwrap", "never").complaint
    assert not out.exists()
    outcome = vnca(*arguments)
    assert outcome.code == 0, outcome.err
    assert "uv_zero.glb: its UVs cannot be used (they cover 0.00% of the texture)" in outcome.err
    assert "new UVs" in outcome.err
    (shape,) = trimesh.load_scene(out).geometry.values()
    assert np.asarray(shape.visual.material.baseColorTexture).std() > 5


def test_same_seed_same_texture_and_another_seed_another(
    vnca: Vnca, texture: Path, mesh: Path, tmp_path: Path
) -> None:
    files = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        out = tmp_path / f"{name}.glb"
        options = ("--out", out, "--size", 64, "--seed", seed)
        assert vnca("texture", "bake", texture, mesh, *options, *SMALL).code == 0
        files.append(out.read_bytes())
    assert files[0] == files[1]
    assert files[0] != files[2]


def test_a_living_texture_is_a_row_of_pictures(
    vnca: Vnca, texture: Path, mesh: Path, tmp_path: Path
) -> None:
    out = tmp_path / "alive.glb"
    options = ("--size", 64, "--animate", 3, "--steps-per-frame", 2)
    assert vnca("texture", "bake", texture, mesh, "--out", out, *options, *SMALL).code == 0
    frames = sorted(tmp_path.glob("alive_*.png"))
    assert [frame.name for frame in frames] == [f"alive_000{n}.png" for n in (1, 2, 3)]
    first, second, third = (np.asarray(Image.open(frame)).astype(int) for frame in frames)
    assert 0 < np.abs(second - first).mean() < 60
    assert np.abs(third - second).any()
    glb = Glb.read(out)
    embedded = glb.bytes_of(glb.document["images"][0]["bufferView"])
    assert embedded == frames[0].read_bytes()


def test_vertices_are_coloured(vnca: Vnca, texture: Path, mesh: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.ply"
    assert vnca("texture", "bake", texture, mesh, "--out", out, *SMALL).code == 0
    written = trimesh.load_mesh(out, process=False)
    original = trimesh.load_mesh(mesh, process=False)
    np.testing.assert_allclose(written.vertices, original.vertices, atol=1e-6)
    assert written.visual.vertex_colors[:, :3].std() > 5


def test_the_block_is_written_as_a_volume(vnca: Vnca, texture: Path, tmp_path: Path) -> None:
    for name in ("block.vdb", "block.npz"):
        outcome = vnca("texture", "volume", texture, "--out", tmp_path / name, *SMALL)
        assert outcome.code == 0, outcome.err
    with np.load(tmp_path / "block.npz") as file:
        colour = file["Cd"]
    assert colour.shape == (16, 16, 16, 3)
    with open_vdb(tmp_path / "block.vdb") as file:
        box = Box((0, 0, 0), (16, 16, 16))
        values, active = file.grids["Cd"].read().to_dense(box)
        density, _ = file.grids["density"].read().to_dense(box)
        assert file.grids["Cd"].transform.voxel_size == pytest.approx([1 / 16] * 3)
    np.testing.assert_array_equal(values, colour)
    assert active.all()
    assert (density == 1).all()


def test_films_of_baked_and_of_living_textures(
    vnca: Vnca, texture: Path, mesh: Path, tmp_path: Path
) -> None:
    baked = tmp_path / "baked.glb"
    assert vnca("texture", "bake", texture, mesh, "--out", baked, "--size", 64, *SMALL).code == 0
    size = ("--rows", 32, "--columns", 32)
    film = ("--frames", 3, *size)
    out = tmp_path / "turn.gif"
    outcome = vnca("texture", "turntable", baked, "--out", out, *film)
    assert outcome.code == 0, outcome.err
    with Image.open(out) as image:
        assert (image.size, image.n_frames) == ((32, 32), 3)
    living = ("--model", texture, "--out", tmp_path / "living.webp", *film, *SMALL)
    outcome = vnca("texture", "turntable", mesh, *living)
    assert outcome.code == 0, outcome.err
    still = ("--model", texture, "--steps-per-frame", 0, "--out", tmp_path / "still.png")
    outcome = vnca("texture", "turntable", mesh, *still, *size, *SMALL)
    assert outcome.code == 0, outcome.err
    with Image.open(tmp_path / "still.png") as image:
        assert image.size == (32, 32)


def test_smoke_can_be_painted_with_a_texture(
    vnca: Vnca, texture: Path, smoke: Path, tmp_path: Path
) -> None:
    outcome = vnca("stylize", texture, smoke, "--out", tmp_path / "painted", "--warmup", 4)
    assert outcome.code == 0, outcome.err
    for name in ("ball_0001.vdb", "ball_0003.vdb"):
        with open_vdb(smoke / name) as before, open_vdb(tmp_path / "painted" / name) as after:
            grids = [file.grids["density"].read() for file in (before, after)]
            old, new = (grid.to_dense(grids[0].active_box())[0] for grid in grids)
            np.testing.assert_array_equal(new, old)
            assert "Cd" in after.grids


def test_a_rule_trained_on_smoke_bakes_and_says_so(
    vnca: Vnca, model: Path, mesh: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.glb"
    outcome = vnca("texture", "bake", model, mesh, "--out", out, "--size", 64, *SMALL)
    assert outcome.code == 0
    assert "trained on smoke" in outcome.err


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--out", "a.fbx"], "--out a.fbx"),
        (["--out", "a.glb", "--size", "100"], "--size 100"),
        (["--out", "a.glb", "--scale", "0"], "--scale 0"),
        (["--out", "a.glb", "--block", "4"], "--block 4"),
        (["--out", "a.glb", "--steps", "0"], "--steps 0"),
        (["--out", "a.glb", "--animate", "-1"], "--animate -1"),
        (["--out", "a.ply", "--animate", "2"], "--animate 2"),
        (["--out", "a.glb", "--unwrap", "never"], "ball.obj"),
    ],
)
def test_mistakes_end_in_one_line(
    vnca: Vnca, texture: Path, mesh: Path, options: list[str], line: str
) -> None:
    assert line in vnca("texture", "bake", texture, mesh, *options).complaint


def test_other_mistakes_end_in_one_line_too(
    vnca: Vnca, texture: Path, mesh: Path, style: Path, tmp_path: Path
) -> None:
    (tmp_path / "empty.obj").write_text("v 0 0 0\n")
    for arguments, line in (
        (("paint",), "expected one of train, bake"),
        ((), "expected one of train, bake"),
        (("volume", texture, "--out", "block.raw"), "block.raw"),
        (("turntable", mesh, "--out", "film.txt"), "film.txt"),
        (("turntable", mesh, "--out", "one.png", "--frames", 3), "--frames: a picture has none"),
        (("turntable", mesh, "--out", "film.gif", "--block", 64), "--block: shapes the texture of"),
        (("turntable", tmp_path / "no.glb", "--out", "film.gif"), "no such file"),
        (("bake", texture, tmp_path / "empty.obj", "--out", "a.glb"), "no triangles"),
        (("bake", tmp_path, mesh, "--out", "a.glb"), "no model.safetensors"),
        (("train", style, "--out", tmp_path / "r", "--block", 4), "--block 4"),
        (("train", style, "--out", tmp_path / "r", "--preview-every", 0), "--preview-every"),
        (("train", style, "--out", tmp_path / "r", "--density-prior"), "--density-prior"),
        (("train", style, "--out", tmp_path / "r", "--memory-budget", "1MB"), "at least"),
        (("train", style, "--out", tmp_path / "r", "--mesh", style), "expected a mesh"),
    ):
        assert line in vnca("texture", *arguments).complaint


def test_help_names_the_subcommands_and_their_options(vnca: Vnca) -> None:
    assert "turntable" in vnca("texture", "--help").out
    for name, option in (
        ("train", "--slice.oblique"),
        ("bake", "--animate"),
        ("volume", "--block"),
        ("turntable", "--model"),
    ):
        outcome = vnca("texture", name, "--help-all")
        assert outcome.code == 0
        assert option in outcome.out
