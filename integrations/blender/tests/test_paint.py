# SPDX-License-Identifier: GPL-3.0-or-later
"""Painting: the volume that shows it, where and when the smoke was, and how it looks."""

from importlib import import_module
from pathlib import Path

import bpy
import numpy as np
import pytest

from conftest import NAME, add_domain

EMITTER = np.array([1.8, -0.5, 1.2])


def paint(scene: bpy.types.Scene, **settings: object) -> bpy.types.Object:
    for name, value in settings.items():
        setattr(scene.vnca, name, value)
    assert bpy.ops.vnca.paint() == {"FINISHED"}
    bpy.context.view_layer.update()
    return scene.vnca.result


def file_at(scene: bpy.types.Scene, painted: bpy.types.Object, frame: int) -> str:
    scene.frame_set(frame)
    painted.data.grids.load()
    return Path(painted.data.grids.frame_filepath).name


def stored(painted: bpy.types.Object, number: int) -> "dict[str, np.ndarray]":
    """Densities, colours and places in the world of the active cells of a painted file."""
    import vnca

    first = Path(bpy.path.abspath(painted.data.filepath))
    path = next(path for path in first.parent.glob("*.vdb") if int(path.stem[-4:]) == number)
    with vnca.open_vdb(path) as file:
        density, colour = file.read("density"), file.read("Cd")
        box = density.active_box()
        cells = np.argwhere(density.to_dense(box)[1]) + box.lower
        matrix = np.array(painted.matrix_world) @ density.transform.index_to_world
        values, active = density.to_dense(box)
        return {
            "density": values[active],
            "colour": colour.to_dense(box)[0][active],
            "place": cells @ matrix[:3, :3].T + matrix[:3, 3],
        }


def middle(found: "dict[str, np.ndarray]") -> np.ndarray:
    weight = found["density"].astype(float)
    return (weight[:, None] * found["place"]).sum(0) / weight.sum()


def use_cycles(scene: bpy.types.Scene, size: int, samples: int) -> None:
    """Cycles on the processor, before nothing, and linear numbers in its files."""
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.seed = "CPU", samples, 1
    scene.cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.film_transparent = True
    scene.render.image_settings.file_format = "OPEN_EXR"


def pixels_of(path: Path) -> np.ndarray:
    """Numbers of a picture, linear RGBA."""
    image = bpy.data.images.load(str(path), check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    columns, rows = image.size
    pixels = np.array(image.pixels[:]).reshape(rows, columns, 4)[::-1]
    bpy.data.images.remove(image)
    return pixels


def rendered(
    scene: bpy.types.Scene, painted: bpy.types.Object, size: int = 64, *, shown: float = 0.9
) -> np.ndarray:
    """Linear RGBA of Cycles, seen from the front without perspective; some of it that opaque."""
    use_cycles(scene, size, samples=8)
    found = stored(painted, painted.data.frame_offset + 1)["place"]
    lower, upper = found.min(0), found.max(0)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", float(max(upper - lower)) * 1.1
    x, y, z = (lower + upper) / 2
    camera.location, camera.rotation_euler = (x, y - 20, z), (np.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.filepath = str(Path(bpy.app.tempdir) / "seen.exr")
    bpy.ops.render.render(write_still=True)
    bpy.data.objects.remove(camera)
    pixels = pixels_of(Path(scene.render.filepath))
    assert pixels[..., 3].max() > shown, "nothing is seen"
    return pixels


def glowing(painted: bpy.types.Object, number: int) -> np.ndarray:
    """RGBA of a frame from the front, cell by cell: what vnca takes for the painting."""
    import vnca

    first = Path(bpy.path.abspath(painted.data.filepath))
    path = next(path for path in first.parent.glob("*.vdb") if int(path.stem[-4:]) == number)
    with vnca.open_vdb(path) as file:
        grid = file.read("density")
        box = grid.active_box()
        sigma = file.metadata["vnca_extinction"].value * grid.transform.voxel_size[0]
        depth = sigma * grid.to_dense(box)[0].astype(float)
        colour = file.read("Cd").to_dense(box)[0].astype(float)
    weight = np.exp(depth - np.cumsum(depth, 1)) * (1 - np.exp(-depth))
    seen = (weight[..., None] * colour).sum(1)
    return np.concatenate([seen, weight.sum(1)[..., None]], 2)


def interpolated(view: np.ndarray) -> np.ndarray:
    """A view of cells as Cycles shows it: the mean over a cell of what lies between the middles."""
    blurred = np.pad(view, ((1, 1), (1, 1), (0, 0)))
    for axis in (0, 1):
        before, after = (np.roll(blurred, step, axis) for step in (1, -1))
        blurred = (before + 6 * blurred + after) / 8
    blurred = blurred[1:-1, 1:-1]
    opaque = blurred[..., 3:]
    colour = np.divide(blurred[..., :3], opaque, out=np.zeros_like(view[..., :3]), where=opaque > 0)
    return np.concatenate([colour * view[..., 3:], view[..., 3:]], 2)


def assert_alike(one: np.ndarray, other: np.ndarray) -> None:
    """Two renderings of the same: Cycles' samples differ, and more so in Blender 5."""
    apart = abs(one - other)
    assert apart.mean() < 0.01
    assert np.quantile(apart, 0.99) < 0.1


def test_cycles_shows_the_colours_of_the_painting_where_it_glows(
    scene: bpy.types.Scene, plume: bpy.types.Object
) -> None:
    painted = paint(scene, glow=1.0)
    scene.frame_set(11)
    seen, told = rendered(scene, painted), interpolated(glowing(painted, 6))
    seen, told = (view[view[..., 3] > 0.98][:, :3] for view in (seen, told))
    assert len(seen) > 200
    assert seen.mean(0) == pytest.approx(told.mean(0), abs=0.04)
    assert (seen.std(0) > 0.7 * told.std(0)).all()
    assert np.ptp(seen.mean(0)) > 0.1


def test_opacity_and_glow_do_not_depend_on_the_size_of_the_object(
    scene: bpy.types.Scene, plume: bpy.types.Object
) -> None:
    painted = paint(scene, glow=1.0)
    scene.frame_set(11)
    small = rendered(scene, painted)
    plume.scale = (5, 5, 5)
    bpy.context.view_layer.update()
    large = rendered(scene, painted)
    assert_alike(large, small)


def test_sliders_change_the_picture_at_once(
    scene: bpy.types.Scene, plume: bpy.types.Object
) -> None:
    painted = paint(scene, glow=1.0)
    scene.frame_set(11)
    full = rendered(scene, painted)
    scene.vnca.strength = 0.0
    white = rendered(scene, painted)
    opaque = full[..., 3] > 0.98
    assert white[..., :3] == pytest.approx(white[..., 3:].repeat(3, -1), abs=0.01)
    scene.vnca.strength = 1.0
    # A ball that holds the left half of the smoke.
    ball = bpy.data.objects.new("Ball", None)
    scene.collection.objects.link(ball)
    places = stored(painted, 6)["place"]
    ball.location = places.mean(0) - (1.0, 0, 0)
    scene.vnca.mask_object = ball
    for kind in ("BALL", "BOX"):
        scene.vnca.mask = kind
        bpy.context.view_layer.update()
        half = rendered(scene, painted)
        left, right = opaque.copy(), opaque.copy()
        left[:, 22:], right[:, :38] = False, False
        assert_alike(half[left], full[left])
        assert half[right][:, :3] == pytest.approx(half[right][:, 3:].repeat(3, -1), abs=0.02)
    scene.vnca.mask, scene.vnca.mask_grid = "GRID", "density"
    assert abs(rendered(scene, painted) - full).max() < 1.2
    scene.vnca.mask = "NONE"
    assert_alike(rendered(scene, painted), full)


def thin(painted: bpy.types.Object) -> None:
    """So that one sees through it, and how dense it is."""
    value = painted.active_material.node_tree.nodes["Extinction"].outputs[0]
    value.default_value *= 0.08


def test_outside_a_mask_smoke_is_as_dense_as_it_was(
    scene: bpy.types.Scene, plume: bpy.types.Object
) -> None:
    scene.frame_set(11)
    opacities = []
    far = bpy.data.objects.new("Far", None)
    far.location.x = 50
    scene.collection.objects.link(far)
    scene.vnca.mask_object = far
    for mask, strength in (("NONE", 0.0), ("BALL", 1.0), ("NONE", 1.0)):
        painted = paint(scene, glow=1.0, mask=mask, density_strength=strength)
        assert not list(Path(painted.data.filepath).parents[1].glob("staged"))
        thin(painted)
        seen = rendered(scene, painted, shown=0.2)
        opacities.append(seen[..., 3])
        if mask == "BALL":
            assert seen[..., :3] == pytest.approx(seen[..., 3:].repeat(3, -1), abs=0.01)
    before, masked, everywhere = opacities
    assert abs(masked - before).mean() < 0.01
    assert abs(everywhere - before).mean() > 2 * abs(masked - before).mean()


def test_a_mesh_masks_colour_and_density_of_a_domain(scene: bpy.types.Scene, folder: Path) -> None:
    import vnca

    domain = add_domain(scene, "adaptive", folder / "cache")
    domain.rotation_euler.z = 0.4
    scene.vnca.folder = str(folder / "out")
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.25, location=EMITTER)
    ball = bpy.context.object
    ball.name = "Inside"
    ball.scale.z = 0.5
    painted = paint(scene, mask="MESH", mask_object=ball)
    first = Path(painted.data.filepath)
    with vnca.open_vdb(first.with_name("smoke_0004.vdb")) as file:
        mask = file.read("vnca_mask")
        box = mask.active_box()
        inside = np.argwhere(mask.to_dense(box)[0] > 0) + box.lower
        assert "unpainted" in file.grids
        world = np.array(painted.matrix_world) @ mask.transform.index_to_world
    away = inside @ world[:3, :3].T + world[:3, 3] - EMITTER
    away[:, 2] *= 2
    far = np.linalg.norm(away, axis=1)
    assert len(far) > 20
    assert far.max() < 0.25
    nodes = painted.active_material.node_tree.nodes
    assert nodes["Density as It Was"].outputs[0].default_value == 1
    assert nodes["Mask: grid"].attribute_name == "vnca_mask"
    empty = bpy.data.objects.new("Empty", None)
    scene.vnca.mask_object = empty
    with pytest.raises(RuntimeError, match="Empty: has no faces"):
        bpy.ops.vnca.paint()


def test_painting_again_is_seen(scene: bpy.types.Scene, plume: bpy.types.Object) -> None:
    painted = paint(scene, glow=1.0)
    scene.frame_set(11)
    first = rendered(scene, painted)
    again = paint(scene, density_strength=0.0, seed=7)
    assert again == painted
    second = rendered(scene, painted)
    assert abs(second - first).max() > 0.05
    assert len(painted.data.materials) == 1


def test_a_material_of_the_artist_stays(scene: bpy.types.Scene, plume: bpy.types.Object) -> None:
    painted = paint(scene)
    own = bpy.data.materials.new("Own")
    painted.data.materials[0] = own
    scene.vnca.strength = 0.5
    paint(scene)
    assert painted.active_material == own


@pytest.mark.parametrize("kind", ["plain", "adaptive", "noise"])
def test_caches_of_domains_lie_where_the_smoke_is(
    kind: str, scene: bpy.types.Scene, folder: Path
) -> None:
    domain = add_domain(scene, kind, folder / "cache")
    scene.vnca.folder = str(folder / "out")
    painted = paint(scene)
    found = stored(painted, 4)
    assert painted.data.frame_duration == 2
    assert middle(found)[:2] == pytest.approx(EMITTER[:2], abs=0.05)
    assert middle(found)[2] == pytest.approx(EMITTER[2] + 0.02, abs=0.08)
    assert file_at(scene, painted, 4).endswith("0004.vdb")
    assert {"density", "Cd", "velocity"} <= {grid.name for grid in painted.data.grids}
    # v · 0.1 · 25 / 24 · 0.5 cells a frame, on cells of this length.
    voxel = 3 / (16 if kind == "noise" else 32)
    assert painted.data.velocity_scale == pytest.approx(0.1 * 25 / 24 * 0.5 * voxel, rel=1e-3)
    domain.location.x += 1
    domain.rotation_euler.z = 1.0
    bpy.context.view_layer.update()
    inside = np.array(domain.matrix_world.inverted())
    assert not (folder / "out" / "Domain embers" / "v001" / "staged").exists()
    moved = np.c_[stored(painted, 4)["place"], np.ones(len(found["place"]))] @ inside.T
    assert abs(moved[:, :3]).max() <= 1


def test_an_adaptive_domain_is_painted_as_the_whole_one(
    scene: bpy.types.Scene, folder: Path
) -> None:
    middles = []
    for kind in ("plain", "adaptive"):
        add_domain(scene, kind, folder / kind).name = kind
        scene.vnca.folder = str(folder)
        scene.vnca.result = None
        middles.append(middle(stored(paint(scene), 4)))
    assert middles[0] == pytest.approx(middles[1], abs=0.02)


def test_a_saved_scene_has_relative_paths(scene: bpy.types.Scene, folder: Path) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    add_domain(scene, "plain", folder / "cache", "//cache")
    scene.vnca.folder = "//vnca"
    painted = paint(scene)
    assert painted.data.filepath.startswith("//vnca")
    assert (
        folder / "vnca" / "Domain embers" / "v001" / "painted" / "fluid_data_0004.vdb"
    ).is_file()


def test_smoke_of_a_linked_scene_is_painted(scene: bpy.types.Scene, folder: Path) -> None:
    (folder / "far").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "far" / "far.blend"))
    add_domain(scene, "plain", folder / "far" / "cache", "//cache")
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_homefile(use_empty=True)
    here = bpy.context.scene
    with bpy.data.libraries.load(str(folder / "far" / "far.blend"), link=True) as (there, ours):
        ours.objects = there.objects
    (domain,) = ours.objects
    here.collection.objects.link(domain)
    here.vnca.source, here.vnca.folder, here.vnca.refine = domain, str(folder / "out"), 1
    here.vnca.style = "embers"
    here.frame_start, here.frame_end = 1, 10
    painted = paint(here)
    assert painted.library is None
    assert middle(stored(painted, 4))[:2] == pytest.approx(EMITTER[:2], abs=0.05)
    assert not domain.hide_render


def test_the_preview_is_a_picture_and_changes_nothing(
    scene: bpy.types.Scene, plume: bpy.types.Object, folder: Path
) -> None:
    scene.frame_set(12)
    assert bpy.ops.vnca.preview() == {"FINISHED"}
    job = import_module(f"{NAME}.work").current
    image = bpy.data.images.load(job.picture)
    assert max(image.size) == 256
    assert np.array(image.pixels[:]).std() > 0.05
    assert scene.vnca.result is None
    assert not (folder / "out").exists()


def test_up_is_up(scene: bpy.types.Scene, plume: bpy.types.Object) -> None:
    source = import_module(f"{NAME}.scene.source")
    assert source.smoke_of(scene, Path()).up_axis == "z"
    plume.rotation_euler.x = np.pi / 2
    bpy.context.view_layer.update()
    assert source.smoke_of(scene, Path()).up_axis == "y"


@pytest.mark.skipif(bpy.app.version < (5, 0, 0), reason="Blender 5 brought nodes for grids")
def test_geometry_nodes_mix_grids(scene: bpy.types.Scene, plume: bpy.types.Object) -> None:
    painted = paint(scene, glow=1.0)
    scene.frame_set(11)
    full = rendered(scene, painted)
    assert bpy.ops.vnca.mix() == {"FINISHED"}
    assert_alike(rendered(scene, painted), full)
    scene.vnca.strength = 0.0
    assert painted.active_material.node_tree.nodes["Strength"].outputs[0].default_value == 1
    white = rendered(scene, painted)
    assert white[..., :3] == pytest.approx(white[..., 3:].repeat(3, -1), abs=0.01)
    # Half of it is what the material makes of half of it.
    scene.vnca.strength = 0.5
    half = rendered(scene, painted)
    painted.modifiers.clear()
    scene.vnca.strength = 0.25
    scene.vnca.strength = 0.5
    assert_alike(rendered(scene, painted), half)


def test_undo_takes_the_painting_back(scene: bpy.types.Scene, plume: bpy.types.Object) -> None:
    bpy.ops.ed.undo_push(message="before")
    painted = paint(scene)
    name = painted.name
    bpy.ops.ed.undo_push(message="painted")
    bpy.ops.ed.undo()
    assert name not in bpy.data.objects
    bpy.ops.ed.redo()
    assert name in bpy.data.objects
