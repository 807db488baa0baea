"""Directions on the command line: keys as words, shots, and what is said where they are wrong."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from vnca.cli.options import spelled_out

Vnca = Callable[..., Any]
SHOT = """sequence = "smoke/ring_####.vdb"
out = "out"
style = "ink"
refine = 1
without_film = true
frames = "1-2"
strength = "1:0 2:@low"

[masks]
low = "height:1..0"
"""


def test_keys_are_one_value_though_the_shell_has_them_apart() -> None:
    for given, meant in (
        (["--strength", "1:0", "24:1", "-o", "x"], ["--strength", "1:0 24:1", "--out", "x"]),
        (["--strength", "smooth", "1:0", "-2:.5"], ["--strength", "smooth 1:0 -2:.5"]),
        (["--strength", "1:0 24:1", "48:0"], ["--strength", "1:0 24:1 48:0"]),
        (["smoke", "C:/x.png", "2:1"], ["smoke", "C:/x.png", "2:1"]),
        (["--strength", "0.5", "1:0"], ["--strength", "0.5", "1:0"]),
    ):
        assert spelled_out(given) == meant


@pytest.fixture
def shot(vnca: Vnca, tmp_path: Path) -> Path:
    made = vnca("simulate", "ring", "--resolution", 16, "--frames", 3, "-o", tmp_path / "smoke")
    assert made.code == 0, made.err
    path = tmp_path / "shot.toml"
    path.write_text(SHOT)
    return path


def test_a_shot_is_painted_and_the_command_line_wins(
    vnca: Vnca, shot: Path, tmp_path: Path
) -> None:
    done = vnca("paint", shot)
    assert done.code == 0, done.err
    assert len(list((tmp_path / "out" / "painted").glob("*.vdb"))) == 2
    again = vnca("paint", shot, "--resume")
    assert "all 2 frames are painted already" in again.err
    other = vnca("paint", shot, "--strength", "1:0", "3:1", "-f", "1-3", "-o", tmp_path / "b")
    assert other.code == 0, other.err
    asked = json.loads((tmp_path / "b" / "paint.json").read_text())
    assert asked["strength"] == "1:0 3:1"
    assert asked["masks"] == ["low=height:1..0"]
    assert len(list((tmp_path / "b" / "painted").glob("*.vdb"))) == 3
    fewer = vnca("paint", shot, "--resume", "--strength", "0.5")
    assert "since --strength is another than when it was begun" in fewer.complaint
    styled = vnca("paint", shot, "--style", "embers", "-o", tmp_path / "c")
    assert styled.code == 0, styled.err


def test_what_is_wrong_in_a_shot_is_pointed_at(vnca: Vnca, shot: Path) -> None:
    shot.write_text(SHOT.replace("2:@low", "2:@low *"))
    failed = vnca("paint", shot)
    assert failed.code == 2
    line, text, caret = failed.err.splitlines()
    assert line.startswith(f"vnca: {shot}:7:25: strength '1:0 2:@low *': at character 13: expected")
    assert (text, caret) == ("  1:0 2:@low *", " " * 14 + "^")
    shot.write_text(SHOT.replace("frames", "frame"))
    assert f"{shot}:6:1: frame: no such option" in vnca("paint", shot).complaint
    shot.write_text(SHOT.replace('style = "ink"', ""))
    assert "picture, --style: expected one of them" in vnca("paint", shot).complaint
    shot.write_text(SHOT.replace("low =", "high ="))
    assert "ring_0001.vdb: no grid 'low'" in vnca("paint", shot).complaint


def test_a_value_that_is_wrong_is_pointed_at(vnca: Vnca, tmp_path: Path) -> None:
    words = ("paint", tmp_path, "--style", "ink", "-o", tmp_path / "o", "--strength", "hight:0..1")
    failed = vnca(*words)
    assert failed.code == 2
    line, text, caret = failed.err.splitlines()
    assert "--strength 'hight:0..1': at character 1: 'hight' is not known" in line
    assert (text, caret) == ("  hight:0..1", "  ^")
    failed = vnca(*words, "--json-progress")
    (event,) = map(json.loads, failed.err.splitlines())
    assert event["event"] == "error"


def test_main_colours_are_listed(vnca: Vnca) -> None:
    style = Path(__file__).parents[2] / "src/vnca/data/styles/frost.safetensors"
    assert "palette     #4274ae #1e4b88" in vnca("info", style).out
    assert "#4274ae #1e4b88" in vnca("styles").out
