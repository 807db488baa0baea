"""Other methods as a user runs them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core.volume import Volume
from vnca.io import SmokeFormat, read_smoke
from vnca.io.painted import read_colour
from vnca.io.provenance import read_provenance
from vnca.io.vdb import Grid, Transform, write_vdb

Vnca = Callable[..., Any]
QUICK: dict[str, tuple[object, ...]] = {
    "aurand": ("--octaves", 1),
    "aurand-forward": ("--patch", 16),
    "lnst": ("--spreading", 1),
    "tnst": ("--octaves", 1, "--views", 2),
}
ALL = ("--iterations", 2, "--features", "efficientnet", "--enlarged", 2)


@pytest.mark.parametrize("method", list(QUICK))
def test_a_method_paints_a_sequence_that_other_tools_read(
    vnca: Vnca, made_smoke: Path, style: Path, tmp_path: Path, method: str
) -> None:
    out = tmp_path / "painted"
    outcome = vnca("peers", "run", method, made_smoke, style, "-o", out, *ALL, *QUICK[method])
    assert outcome.code == 0, outcome.err
    names = sorted(path.name for path in out.glob("*.vdb"))
    assert names == [f"ball_{number:04d}.vdb" for number in (1, 2, 3)]
    before = read_smoke(made_smoke / names[1], SmokeFormat())
    after = read_smoke(out / names[1], SmokeFormat())
    assert np.allclose(after.index_to_world, before.index_to_world)
    there = after.density_field.dense(before.box)
    assert not np.array_equal(there, before.density)
    assert 0.3 < there.sum() / before.density.sum() < 3
    assert after.velocity is not None
    colour = read_colour(out / names[1], SmokeFormat(), grid="Cd", box=before.box)
    assert colour is not None
    assert colour[before.density > 0].min() == 1
    told = read_provenance(out / names[1])
    assert told is not None
    assert told.facts["model"] == method
    record = json.loads((out / "peers.json").read_text())
    assert record["method"] == method
    assert record["seconds_per_frame"] > 0
    assert record["settings"]["iterations"] == 2
    film = tmp_path / "film.gif"
    rendered = vnca("render", out, "--out", film, "--rows", 32, "--columns", 32)
    assert rendered.code == 0, rendered.err
    assert film.stat().st_size > 0


def test_what_is_there_is_not_replaced_unless_asked(
    vnca: Vnca, made_smoke: Path, style: Path, tmp_path: Path
) -> None:
    call = ("peers", "run", "aurand", made_smoke, style, "-o", tmp_path / "a", *ALL, "-f", "1")
    call = (*call, "--octaves", 1)
    assert vnca(*call).code == 0
    kept = (tmp_path / "a" / "ball_0001.vdb").read_bytes()
    assert "holds painted frames already" in vnca(*call).complaint
    assert vnca(*call, "--overwrite").code == 0
    assert (tmp_path / "a" / "ball_0001.vdb").read_bytes() == kept
    assert (
        "is the folder of the input" in vnca(*call[:5], "-o", made_smoke, "--overwrite").complaint
    )


def test_smoke_without_velocity_is_refused_by_name(
    vnca: Vnca, tiny_smoke: Volume, style: Path, tmp_path: Path
) -> None:
    density = tiny_smoke.density
    place = Transform.from_matrix(tiny_smoke.index_to_world)
    grid = Grid.from_dense("density", density, density > 0, (0, 0, 0), transform=place)
    write_vdb(tmp_path / "still_0001.vdb", [grid])
    outcome = vnca("peers", "run", "tnst", tmp_path, style, "-o", tmp_path / "out", *ALL)
    assert "still_0001.vdb" in outcome.complaint
    assert "velocity" in outcome.complaint
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (("--alpha", "1"), "--alpha"),
        (("--views", "3"), "--views"),
        (("--iterations", "-1"), "--iterations"),
    ],
)
def test_options_are_refused_by_name(
    vnca: Vnca, made_smoke: Path, style: Path, tmp_path: Path, wrong: tuple[str, ...], named: str
) -> None:
    call = ("peers", "run", "aurand", made_smoke, style, "-o", tmp_path / "out", *wrong)
    assert named in vnca(*call).complaint


def test_an_unknown_method_names_those_there_are(vnca: Vnca, style: Path, tmp_path: Path) -> None:
    complaint = vnca("peers", "run", "guo", tmp_path, style, "-o", tmp_path / "out").complaint
    for name in QUICK:
        assert name in complaint


def test_the_list_tells_what_cannot_be_run_and_why(vnca: Vnca) -> None:
    listed = vnca("peers", "list").out
    for name in (*QUICK, "guo"):
        assert f"\n{name} " in f"\n{listed}"
    assert "not run" in listed
