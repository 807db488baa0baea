"""Painting by tiles as a user asks for it: the files of a painting of wholes."""

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core.volume import Volume
from vnca.engine import native
from vnca.io.vdb import Transform, open_vdb, write_vdb
from vnca.painting.tiles.roll import TiledRoll
from vnca.recipe import painting

Vnca = Callable[..., Any]
QUICK = ("--warmup", 4, "--steps-per-frame", 2)
needs_native = pytest.mark.skipif(
    native.unavailable() is not None, reason="other backends round by how many cells there are"
)


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture
def paint(vnca: Vnca, model: Path, smoke: Path, tmp_path: Path) -> Callable[..., dict[str, bytes]]:
    def run(name: str, *options: object) -> dict[str, bytes]:
        outcome = vnca("stylize", model, smoke, "--out", tmp_path / name, *QUICK, *options)
        assert outcome.code == 0, outcome.err
        return files(tmp_path / name)

    return run


@needs_native
@pytest.mark.parametrize(
    "options",
    [
        (),
        ("--refine", 2, "--colour-grid", "Cd", "color"),
        ("--edge", 1, "--fire", "@temperature:0..300->900..2000", "--keep-mass"),
    ],
    ids=["plain", "finer", "burning"],
)
def test_files_of_tiles_are_those_of_wholes(paint: Any, options: tuple[object, ...]) -> None:
    whole = paint("whole", *options)
    assert paint("tiled", "--tile", 8, "--halo", 2, *options) == whole


@needs_native
def test_a_chunk_is_painted_by_tiles_too(paint: Any) -> None:
    whole, chunk = paint("whole"), paint("tiled", "--tile", 8, "--halo", 2, "--chunk", "2-3")
    assert len(chunk) == 2
    assert chunk == {name: whole[name] for name in chunk}


@needs_native
def test_resampled_smoke_is_painted_by_tiles_too(paint: Any, smoke: Path) -> None:
    """Where the cells of a frame are others than those of the first one."""
    path = smoke / "ball_0002.vdb"
    with open_vdb(path) as file:
        grids = [file.read(name) for name in file.names]
    for grid in grids:
        grid.transform = Transform.from_matrix(np.diag([0.12, 0.12, 0.12, 1.0]))
    write_vdb(path, grids)
    whole = paint("whole")
    assert paint("tiled", "--tile", 16) == whole


@needs_native
def test_mantaflows_files_are_painted_by_tiles_too(
    vnca: Vnca, model: Path, tiny_smoke: Volume, tmp_path: Path
) -> None:
    density, velocity = (np.moveaxis(a, 0, 2) for a in (tiny_smoke.density, tiny_smoke.velocity))
    for kind, values in (("d", density[..., None]), ("v", velocity)):
        (tmp_path / "flow" / kind).mkdir(parents=True)
        np.savez(tmp_path / "flow" / kind / "001.npz", x=values.astype(np.float32))
    for out, options in (("whole", ()), ("tiled", ("--tile", 8))):
        outcome = vnca(
            *("stylize", model, tmp_path / "flow", "--out", tmp_path / out, *QUICK, *options)
        )
        assert outcome.code == 0, outcome.err
    assert files(tmp_path / "tiled") == files(tmp_path / "whole")


@needs_native
def test_a_painting_by_tiles_goes_on_without_them(
    vnca: Vnca, paint: Any, model: Path, smoke: Path, tmp_path: Path
) -> None:
    whole = paint("whole")
    out = ("stylize", model, smoke, "--out", tmp_path / "out", *QUICK)
    advance, count = TiledRoll.advance, 0

    def interrupted(self: TiledRoll, *arguments: Any) -> Any:
        nonlocal count
        count += 1
        if count == 3:
            raise KeyboardInterrupt
        return advance(self, *arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TiledRoll, "advance", interrupted)
        assert vnca(*out, "--tile", 8).code == 130
    assert sorted(files(tmp_path / "out")) == [
        *(".ball_0001.resume.safetensors", "ball_0001.vdb", "ball_0002.vdb")
    ]
    outcome = vnca(*out, "--resume")
    assert "going on after 2 frames" in outcome.err
    assert files(tmp_path / "out") == whole


@needs_native
def test_sigterm_waits_for_the_frame(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    advance = TiledRoll.advance

    def terminated(self: TiledRoll, *arguments: Any) -> Any:
        os.kill(os.getpid(), signal.SIGTERM)
        return advance(self, *arguments)

    monkeypatch.setattr(TiledRoll, "advance", terminated)
    out = tmp_path / "out"
    outcome = vnca("stylize", model, smoke, "--out", out, *QUICK, "--tile", 16)
    assert outcome.code == 143
    assert sorted(files(out)) == [".ball_0001.resume.safetensors", "ball_0001.vdb"]


@needs_native
def test_large_frames_are_cut_of_themselves(paint: Any, monkeypatch: Any) -> None:
    whole = paint("whole")
    monkeypatch.setattr(painting, "bytes_needed", lambda *_, **__: 10**15)
    assert paint("tiled", "--memory-budget", "2GB") == whole


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--tile", 12), "--tile 12: expected a multiple of 8"),
        (("--tile", 0), "--tile 0: expected a multiple of 8"),
        (("--tile", 8, "--halo", 0), "--halo 0: at least 1 is needed"),
        (("--halo", 2), "--halo: frames are painted as wholes here; give --tile, too"),
        (("--tile", 8, "--guide", "z"), "--tile: with --guide or --pattern-size frames are"),
        (("--memory-budget", "much"), "--memory-budget much: expected auto, or a size"),
    ],
)
def test_tiles_that_cannot_be_are_refused(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path, options: tuple[object, ...], words: str
) -> None:
    outcome = vnca("stylize", model, smoke, "--out", tmp_path / "out", *options)
    assert words in outcome.complaint
    assert not (tmp_path / "out").exists()
