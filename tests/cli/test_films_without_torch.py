"""Films with light where torch is not installed: the very files that are made where it is."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.cli.bare import TRAINING_ONLY, without_training

Vnca = Callable[..., Any]
SIZE = ("--rows", 32, "--columns", 40)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("film.webp", ("--background", "#203040", "--light", 1.5, "--ambient", 0.3)),
        ("turn.gif", ("--frames", 2, "--turntable", 3, "--field-of-view", 0)),
        ("frame_##.png", ("--transparent", "--light", 0, "--azimuth", 30)),
        ("strip.png", ("--strip", 2,)),
        ("blurred.webp", ("--shutter", 0.5, "--turn", 20)),
    ],
)  # fmt: skip
def test_a_sequence_is_rendered_the_same_without_torch(
    vnca: Vnca, smoke: Path, tmp_path: Path, name: str, options: tuple[object, ...]
) -> None:
    made = vnca("render", smoke, "--out", tmp_path / "with" / name, *SIZE, *options)
    assert made.code == 0, made.err
    bare = without_training("render", smoke, "--out", tmp_path / "bare" / name, *SIZE, *options)
    assert bare.returncode == 0, bare.stderr
    require_equal(tmp_path / "bare", tmp_path / "with")


def test_a_preview_is_made_without_torch(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path
) -> None:
    quick = ("--warmup", 2, "--steps-per-frame", 1, *SIZE)
    for folder, run in (("with", vnca), ("bare", without_training)):
        to = tmp_path / folder
        run("stylize", model, smoke, "--out", to, *quick, "--preview", to / "film.webp")
    require_equal(tmp_path / "bare", tmp_path / "with")


@pytest.mark.parametrize(
    ("absent", "film"), [(("torch",), "film.mp4"), (TRAINING_ONLY, "film.webp")]
)
def test_a_style_of_the_library_paints_and_films_without_torch(
    smoke: Path, tmp_path: Path, absent: tuple[str, ...], film: str
) -> None:
    out = tmp_path / "all"
    job = ("paint", smoke, "--style", "ink", "-o", out, "-r", 1, "--frames", "1-2", *SIZE)
    done = without_training(*job, packages=absent)
    assert done.returncode == 0, done.stderr
    assert f"film: {out / film}" in done.stderr.replace("  ", " ")
    assert (out / film).stat().st_size > 300
    assert len(list((out / "painted").glob("*.vdb"))) == 2
    assert len(list(out.glob("film.*"))) == 1


def test_with_neither_torch_nor_the_native_core_one_line_says_so(
    smoke: Path, tmp_path: Path
) -> None:
    film = tmp_path / "out" / "film.gif"
    done = without_training("render", smoke, "--out", film, absent="vnca.engine.native._native")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert "films need the native core or torch" in done.stderr
    assert "pip install 'vnca[train]'" in done.stderr
    assert not film.exists()


def require_equal(one: Path, other: Path) -> None:
    names = sorted(path.name for path in one.iterdir())
    assert names
    assert names == sorted(path.name for path in other.iterdir())
    for name in names:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name
