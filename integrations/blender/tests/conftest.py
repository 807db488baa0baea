# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension as an artist has it: its zip installed into a clean profile of Blender.

VNCA_ZIP names the zip. `make blender` runs these tests with the Python that has `bpy`.
"""

import os
import shutil
import tempfile
from pathlib import Path

_PROFILE = tempfile.mkdtemp(prefix="vnca-profile-")
os.environ["BLENDER_USER_RESOURCES"] = _PROFILE  # before bpy is imported

import bpy
import pytest

HERE = Path(__file__).parent
CACHES = HERE / "data"
PLUME = HERE.parent.parent.parent / "tests" / "data" / "painting"
NAME = "bl_ext.user_default.vnca"


def pytest_unconfigure() -> None:
    shutil.rmtree(_PROFILE, ignore_errors=True)


@pytest.fixture(scope="session", autouse=True)
def installed() -> str:
    """The name under which the extension is enabled."""
    done = bpy.ops.extensions.package_install_files(
        filepath=os.environ["VNCA_ZIP"], repo="user_default", enable_on_install=True
    )
    assert done == {"FINISHED"}
    return NAME


@pytest.fixture
def scene(installed: str) -> bpy.types.Scene:
    """An empty scene that is not saved."""
    bpy.ops.wm.read_homefile(use_empty=True)
    made = bpy.context.scene
    made.frame_start, made.frame_end = 1, 30
    made.vnca.refine = 1
    made.vnca.style = "embers"
    return made


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a space, an umlaut and a word in Chinese."""
    made = tmp_path / "Rauch für 煙"
    made.mkdir()
    return made


@pytest.fixture
def plume(scene: bpy.types.Scene, folder: Path) -> bpy.types.Object:
    """Two frames, 6 and 7, imported so that they are seen at 11 and 12; chosen in the scene."""
    (folder / "smoke").mkdir()
    for path in PLUME.glob("plume_*.vdb"):
        shutil.copy(path, folder / "smoke")
    volume = bpy.data.volumes.new("Plume")
    volume.filepath = str(folder / "smoke" / "plume_0006.vdb")
    volume.is_sequence = True
    volume.frame_start, volume.frame_offset, volume.frame_duration = 11, 5, 2
    made = bpy.data.objects.new("Plume", volume)
    scene.collection.objects.link(made)
    scene.vnca.source = made
    scene.vnca.folder = str(folder / "out")
    return made


def add_domain(
    scene: bpy.types.Scene, kind: str, folder: Path, directory: str = ""
) -> bpy.types.Object:
    """A domain, chosen in the scene, and its cache of `data/`.

    Args:
        scene: Where to.
        kind: Which cache.
        folder: Where it is put.
        directory: What the domain calls that; the folder unless given.
    """
    bpy.ops.mesh.primitive_cube_add(size=2, location=(1.5, -0.5, 2.0))
    made = bpy.context.object
    made.name, made.scale = "Domain", (1, 1, 1.5)
    modifier = made.modifiers.new("Fluid", "FLUID")
    # Never evaluated: the solver in the package bpy is broken.
    modifier.show_viewport = modifier.show_render = False
    modifier.fluid_type = "DOMAIN"
    domain = modifier.domain_settings
    domain.domain_type, domain.cache_type, domain.cache_data_format = "GAS", "ALL", "OPENVDB"
    domain.time_scale, domain.use_noise = 0.5, (CACHES / kind / "noise").is_dir()
    domain.cache_directory = directory or str(folder)
    scene.vnca.source = made
    bpy.context.view_layer.update()
    # Last, since a domain whose settings change clears its cache.
    shutil.copytree(CACHES / kind, folder, dirs_exist_ok=True)
    return made
