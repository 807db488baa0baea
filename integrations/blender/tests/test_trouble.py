# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes wrong: each a clear message, nothing lost, and Blender stays free."""

import os
import signal
import stat
import sys
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import bpy
import pytest

from conftest import NAME, add_domain


def said(operator: Any, **options: object) -> str:
    """The error that an operator reports."""
    with pytest.raises(RuntimeError) as caught:
        operator(**options)
    return str(caught.value).strip().removeprefix("Error: ")


def begin(scene: bpy.types.Scene) -> Any:
    """Painting at work, as a button begins it; a window's timer would call `poll`."""
    operators, work, source, versions = (
        import_module(f"{NAME}.{name}")
        for name in ("operators", "work", "scene.source", "versions")
    )
    out = versions.PAINTING.next_version(versions.folder_of(scene), goes_on=False)
    smoke = source.smoke_of(scene, out)
    look = source.look_of(scene.vnca)
    work.current = work.begin_painting(operators.paint_job(scene, "paint", smoke, look, out))
    return work.current


def ends_within_a_second(job: Any) -> None:
    """For the artist; the process has a little longer to write down what it has."""
    start = time.monotonic()
    assert bpy.ops.vnca.cancel() == {"FINISHED"}
    assert job.state == "cancelled"
    assert not bpy.ops.vnca.cancel.poll()
    assert time.monotonic() - start < 1
    while job.poll():
        assert time.monotonic() - start < import_module(f"{NAME}.job").PATIENCE + 5
        time.sleep(0.02)
    assert job.state == "cancelled"


def until(job: Any, what: str, seconds: float = 60, *, least: int = 0) -> None:
    start = time.monotonic()
    while job.poll() and not (job.what == what and job.done >= least):
        assert time.monotonic() - start < seconds
        time.sleep(0.02)


@pytest.mark.parametrize("moment", ["at once", "starting", "painting", "after a frame"])
def test_cancelling_takes_less_than_a_second_at_any_moment(
    moment: str, scene: bpy.types.Scene, plume: bpy.types.Object
) -> None:
    scene.vnca.refine = 8
    job = begin(scene)
    if moment == "starting":
        time.sleep(0.3)
    elif moment != "at once":
        until(job, "painting", least=int(moment == "after a frame"))
    ends_within_a_second(job)
    with pytest.raises(ProcessLookupError):
        os.kill(job.pid, 0)
    # And one can begin anew.
    scene.vnca.refine = 1
    assert bpy.ops.vnca.paint() == {"FINISHED"}


def test_a_cancelled_painting_is_gone_on_with(
    scene: bpy.types.Scene, plume: bpy.types.Object, folder: Path
) -> None:
    versions = import_module(f"{NAME}.versions")
    scene.vnca.refine = 5
    job = begin(scene)
    until(job, "painting")
    job.cancel()
    while job.poll():
        time.sleep(0.02)
    (version,) = (folder / "out" / "Plume embers").iterdir()
    assert versions.can_go_on_painting(scene)
    assert bpy.ops.vnca.paint(goes_on=True) == {"FINISHED"}
    assert not versions.can_go_on_painting(scene)
    assert [path.name for path in sorted((version / "painted").iterdir())] == [
        "plume_0006.vdb",
        "plume_0007.vdb",
    ]


def test_nothing_is_gone_on_with_where_nothing_was_cancelled(
    scene: bpy.types.Scene, plume: bpy.types.Object
) -> None:
    assert "there is no painting to go on with" in said(bpy.ops.vnca.paint, goes_on=True)


def test_a_killed_worker_is_a_message(scene: bpy.types.Scene, plume: bpy.types.Object) -> None:
    scene.vnca.refine = 6
    job = begin(scene)
    time.sleep(0.5)
    os.kill(job.pid, signal.SIGKILL)
    while job.poll():
        time.sleep(0.02)
    assert job.state == "failed"
    assert "ended unexpectedly (signal 9)" in job.message
    assert bpy.ops.vnca.log() == {"FINISHED"}
    assert "vnca log" in bpy.data.texts


def test_another_file_ends_the_work(scene: bpy.types.Scene, plume: bpy.types.Object) -> None:
    scene.vnca.refine = 6
    job = begin(scene)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert job.state == "cancelled"
    with pytest.raises(ProcessLookupError):
        os.kill(job.pid, 0)


def test_a_worker_does_not_outlive_blender(scene: bpy.types.Scene, plume: bpy.types.Object) -> None:
    scene.vnca.refine = 8
    job = begin(scene)
    until(job, "painting")
    job._process.stdin.close()  # as the system does when Blender crashes
    assert job._process.wait(timeout=10) != 0


def test_a_worker_that_has_not_begun_has_nothing_to_wait_for(
    scene: bpy.types.Scene, plume: bpy.types.Object
) -> None:
    job = begin(scene)
    start = time.monotonic()
    job._process.stdin.close()
    assert job._process.wait(timeout=60) == 143
    assert time.monotonic() - start < 4  # it would be ended after 5


def test_what_vnca_refuses_is_its_message(
    scene: bpy.types.Scene, plume: bpy.types.Object, folder: Path
) -> None:
    (folder / "smoke" / "plume_0007.vdb").write_bytes(b"no smoke")
    assert "plume_0007.vdb" in said(bpy.ops.vnca.paint)
    assert scene.vnca.result is None


def test_a_folder_that_cannot_be_written_is_named(
    scene: bpy.types.Scene, plume: bpy.types.Object, folder: Path
) -> None:
    (folder / "out").write_text("a file in the way")
    assert "out" in said(bpy.ops.vnca.paint)


def test_a_cache_that_is_read_only_is_painted(
    scene: bpy.types.Scene, plume: bpy.types.Object, folder: Path
) -> None:
    for path in (folder / "smoke").glob("*.vdb"):
        path.chmod(stat.S_IREAD)
    (folder / "smoke").chmod(stat.S_IREAD | stat.S_IEXEC)
    assert bpy.ops.vnca.paint() == {"FINISHED"}
    assert len(list((folder / "smoke").iterdir())) == 2


def test_a_scene_that_is_not_saved_has_no_folder(
    scene: bpy.types.Scene, plume: bpy.types.Object
) -> None:
    scene.vnca.folder = "//vnca"
    assert "Save the scene first" in said(bpy.ops.vnca.paint)


def test_frames_that_were_removed_are_told(
    scene: bpy.types.Scene, plume: bpy.types.Object, folder: Path
) -> None:
    for path in (folder / "smoke").glob("*.vdb"):
        path.unlink()
    assert "there is no such file" in said(bpy.ops.vnca.paint)


def test_a_frame_without_a_file_has_no_preview(
    scene: bpy.types.Scene, plume: bpy.types.Object
) -> None:
    scene.frame_set(20)
    assert "no file for the frame 20; there are 6 to 7" in said(bpy.ops.vnca.preview)
    scene.frame_start, scene.frame_end = 20, 30
    assert "no files for the frames 20 to 30" in said(bpy.ops.vnca.paint)


def test_a_domain_that_is_not_baked_says_so(scene: bpy.types.Scene, folder: Path) -> None:
    domain = add_domain(scene, "plain", folder / "cache")
    settings = domain.modifiers[0].domain_settings
    scene.vnca.folder = str(folder / "out")
    for path in (folder / "cache" / "data").iterdir():
        path.unlink()
    assert "nothing is baked" in said(bpy.ops.vnca.paint)
    settings.cache_data_format = "UNI"
    assert "not OpenVDB" in said(bpy.ops.vnca.paint)
    settings.cache_data_format, settings.cache_directory = "OPENVDB", "//cache"
    assert "save the scene first" in said(bpy.ops.vnca.paint)


def test_nothing_chosen_is_a_message(scene: bpy.types.Scene) -> None:
    assert "Choose the smoke" in said(bpy.ops.vnca.paint)
    assert "neither a domain of gas nor a volume" in said(bpy.ops.vnca.use_active)


def test_a_model_that_is_not_there_is_a_message(
    scene: bpy.types.Scene, plume: bpy.types.Object, folder: Path
) -> None:
    scene.vnca.way = "MODEL"
    assert "Choose a model" in said(bpy.ops.vnca.paint)
    scene.vnca.model = str(folder / "gone.safetensors")
    assert "there is no such model" in said(bpy.ops.vnca.paint)
    scene.vnca.way = "PICTURE"
    scene.vnca.model = ""
    assert "Train first" in said(bpy.ops.vnca.paint)


def test_training_says_what_it_needs(
    scene: bpy.types.Scene,
    plume: bpy.types.Object,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene.vnca.way = "PICTURE"
    assert "Choose a picture" in said(bpy.ops.vnca.train)
    scene.vnca.picture = str(folder / "gone.png")
    assert "there is no such picture" in said(bpy.ops.vnca.train)
    Path(scene.vnca.picture).write_bytes(b"")
    monkeypatch.setenv("PATH", str(folder))
    assert "Training needs Python with vnca and torch" in said(bpy.ops.vnca.train)
    preferences = bpy.context.preferences.addons[NAME].preferences
    preferences.python = str(folder)
    try:
        assert "no Python environment" in said(bpy.ops.vnca.train)
        # Blender's own Python, which has no torch.
        preferences.python = sys.executable
        complaint = said(bpy.ops.vnca.check_training)
        assert "torch" in complaint
        assert "pip install" in complaint
    finally:
        preferences.python = ""
