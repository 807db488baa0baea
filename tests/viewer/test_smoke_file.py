"""Sequences as the page reads them."""

import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vnca.core.errors import FileFormatError, SequenceError
from vnca.core.volume import Volume
from vnca.io.smoke_format import on_one_lattice
from vnca.recipe.sequence import region_of
from vnca.viewer.smoke_file import SmokeFile, write_smoke_file


@pytest.fixture
def written(tiny_smoke: Volume, tmp_path: Path) -> tuple[Path, list[Volume]]:
    x, y, z = tiny_smoke.origin
    moved = [replace(tiny_smoke, origin=(x, y, z + n), frame=n) for n in (1, 2, 5)]
    laid, region = region_of(moved)
    write_smoke_file(tmp_path / "smoke.bin", laid, region, name="ball", fps=12)
    return tmp_path / "smoke.bin", laid


def test_a_sequence_comes_back_but_for_rounding(written: tuple[Path, list[Volume]]) -> None:
    path, given = written
    file = SmokeFile(path)
    assert (file.header["name"], file.header["fps"]) == ("ball", 12)
    found = [*file.volumes()]
    assert [smoke.frame for smoke in found] == [1, 2, 5]
    for ours, theirs in zip(given, found, strict=True):
        box = theirs.box
        density, stored = (each.density_field.dense(box) for each in (ours, theirs))
        np.testing.assert_allclose(stored, density, atol=0.005 * density.max())
        np.testing.assert_array_equal(stored > 0, density > 2e-6)
        assert ours.velocity_field is not None
        assert theirs.velocity_field is not None
        motion, told = (
            each.velocity_field.dense(box) * (density > 0)[..., None] for each in (ours, theirs)
        )  # pyright: ignore
        np.testing.assert_allclose(told, motion, atol=0.01 * np.abs(motion).max())
        np.testing.assert_array_equal(theirs.index_to_world, ours.index_to_world)


def test_smoke_without_velocity_is_a_quarter_as_large(tiny_smoke: Volume, tmp_path: Path) -> None:
    laid, region = region_of([replace(tiny_smoke, velocity=None)])
    write_smoke_file(tmp_path / "still.bin", laid, region, name="still", fps=24)
    (found,) = SmokeFile(tmp_path / "still.bin").volumes()
    assert found.velocity_field is None


def test_fields_come_back_near_the_smoke(tiny_smoke: Volume, tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    shape = tiny_smoke.density.shape
    told = {
        "temperature": random.uniform(280, 900, shape).astype(np.float32),
        "wind": random.normal(size=(*shape, 3)).astype(np.float32),
        "nothing": np.zeros(shape, np.float32),
    }
    given = [replace(tiny_smoke, fields=told, frame=1), replace(tiny_smoke, frame=2)]
    laid, region = region_of(given)
    write_smoke_file(tmp_path / "warm.bin", laid, region, name="warm", fps=24)
    found, without = SmokeFile(tmp_path / "warm.bin").volumes()
    box, smoke = found.box, found.density_field.dense(found.box) > 0
    for name, field in laid[0].named_fields.items():
        theirs, ours = found.named_fields[name].dense(box)[smoke], field.dense(box)[smoke]
        np.testing.assert_allclose(theirs, ours, atol=2e-5 * max(np.abs(ours).max(), 1))
        assert not without.named_fields[name].values.any()
    assert found.velocity_field is not None


def test_nothing_to_show_is_said(tiny_smoke: Volume, tmp_path: Path) -> None:
    laid, region = region_of([tiny_smoke])
    empty = replace(tiny_smoke, density=np.zeros_like(tiny_smoke.density), frame=3)
    with pytest.raises(SequenceError, match="void: there is no smoke in any frame"):
        write_smoke_file(
            tmp_path / "a.bin", [*on_one_lattice([empty])], region, name="void", fps=24
        )
    assert not (tmp_path / "a.bin").exists()
    del laid


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda data: b"RIFF" + data[4:], "not a sequence"),
        (lambda data: data[:10], "not a sequence"),
        (lambda data: data[:40], "damaged header"),
        (lambda data: data[:-200], "frame 5"),
        (lambda data: data[:-300] + bytes(300), "frame 5"),
    ],
)
def test_damaged_files_are_refused(
    written: tuple[Path, list[Volume]], damage: Callable[[bytes], bytes], reason: str
) -> None:
    path, _ = written
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(FileFormatError, match=reason):
        [*SmokeFile(path).volumes()]


def test_a_stream_that_holds_more_than_it_says_is_refused(
    written: tuple[Path, list[Volume]],
) -> None:
    path, _ = written
    file = SmokeFile(path)
    first = file.frames[0]
    begin = path.stat().st_size - sum(frame.length for frame in file.frames)
    data = bytearray(path.read_bytes())
    stream = zlib.compress(bytes(10**5), 9)
    assert len(stream) <= first.length
    data[begin : begin + len(stream)] = stream
    path.write_bytes(data)
    with pytest.raises(FileFormatError, match="frame 1 is damaged"):
        next(SmokeFile(path).volumes())
