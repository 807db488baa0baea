"""`vnca styles`, and painting with one."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from vnca.io.vdb import open_vdb
from vnca.rule.library import style_names

Vnca = Callable[..., Any]


def test_styles_are_listed_with_what_they_learned_from(vnca: Vnca) -> None:
    lines = vnca("styles").out.splitlines()
    assert [line.split()[0] for line in lines] == style_names()
    assert all(len(line.split()) > 2 for line in lines)
    listed = json.loads(vnca("styles", "--json").out)
    assert list(listed) == style_names()
    assert "van Gogh" in listed["church"]["title"]


def test_a_sheet_shows_pictures_beside_smoke(vnca: Vnca, tmp_path: Path) -> None:
    sheet = tmp_path / "styles.png"
    vnca("styles", "--sheet", sheet)
    with Image.open(sheet) as image:
        rows = -(-len(style_names()) // 3)
        assert image.height >= rows * 160
        assert image.width >= 6 * 160


def test_a_style_paints_without_training(vnca: Vnca, smoke: Path, tmp_path: Path) -> None:
    out = tmp_path / "all"
    small = ("--rows", 32, "--columns", 32)
    vnca("paint", smoke, "--style", "embers", "-o", out, "-r", 1, *small)
    painted = sorted((out / "painted").glob("*.vdb"))
    assert len(painted) == len(list(smoke.glob("*.vdb")))
    with open_vdb(painted[0]) as file:
        assert {"density", "Cd"} <= set(file.grids)
    assert (out / "film.mp4").exists()
    assert not (out / "run").exists()


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (("--style", "velvet"), "--style velvet: expected one of cafe"),
        ((), "expected one of them"),
        (("picture.png", "--style", "ink"), "expected one of them"),
        (("--style", "ink", "--preset", "standard"), "--preset: ink is a model"),
    ],
)
def test_what_cannot_be_painted_with_is_told(
    vnca: Vnca, smoke: Path, tmp_path: Path, given: tuple[str, ...], told: str
) -> None:
    failed = vnca("paint", smoke, *given, "-o", tmp_path / "all")
    assert failed.code == 2
    assert told in failed.err
    assert len(failed.err.strip().splitlines()) == 1
    assert not (tmp_path / "all").exists()
