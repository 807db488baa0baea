"""`vnca view`: a site that is written, and a page that is served."""

import json
import threading
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from vnca.recipe import SILENT
from vnca.recipe.viewing import ViewRun, run
from vnca.rule.model import MODEL_NAME, style_names
from vnca.viewer.smoke_file import SmokeFile

Vnca = Callable[..., Any]


def test_a_site_has_the_rules_and_the_sequence(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path
) -> None:
    site = tmp_path / "site"
    told = vnca("view", model, smoke, "--frames", "1-2", "--export", site)
    assert told.code == 0
    assert f"site: {site}" in told.err
    show = json.loads((site / "show.json").read_text())
    assert [rule["name"] for rule in show["rules"]] == ["run", *sorted_first("stained_glass")]
    assert (site / show["rules"][0]["model"]).read_bytes() == (model / MODEL_NAME).read_bytes()
    assert (site / show["rules"][1]["thumbnail"]).read_bytes()[:4] == b"RIFF"
    file = SmokeFile(site / show["smoke"])
    assert [frame.number for frame in file.frames] == [1, 2]
    assert not show["run"]
    for name in ("index.html", "viewer.js", "viewer.css"):
        assert (site / name).exists()
    # Once more, of another style: the folder is written anew.
    assert vnca("view", "frost", smoke, "--export", site).code == 0
    assert json.loads((site / "show.json").read_text())["rules"][0]["name"] == "frost"


def sorted_first(name: str) -> list[str]:
    return [name, *(other for other in style_names() if other != name)]


def test_without_a_sequence_a_plume_is_simulated(
    vnca: Vnca, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from vnca.recipe import viewing

    monkeypatch.setattr(viewing, "_RESOLUTION", 16)
    monkeypatch.setattr(viewing, "_FRAMES", 3)
    assert vnca("view", "--export", tmp_path / "site").code == 0
    show = json.loads((tmp_path / "site/show.json").read_text())
    assert show["title"] == "a plume"
    assert show["rules"][0]["name"] == "stained_glass"


def test_the_page_is_served_until_it_is_closed(smoke: Path) -> None:
    there = threading.Event()
    addresses: list[str] = []

    def opened(address: str) -> None:
        addresses.append(address)
        with urllib.request.urlopen(address + "show.json") as answer:
            assert json.load(answer)["rules"][0]["name"] == "ink"
        with urllib.request.urlopen(address) as answer:
            assert b"viewer.js" in answer.read()
        there.set()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(ViewRun(model="ink", sequence=str(smoke)), SILENT, opened)
    assert there.is_set()
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(addresses[0])


def test_mistakes_are_one_line(vnca: Vnca, smoke: Path, tmp_path: Path) -> None:
    assert "nothing.safetensors" in vnca("view", tmp_path / "nothing.safetensors").complaint
    assert "--page-fps 0" in vnca("view", "ink", smoke, "--page-fps", 0).complaint
    assert "--port 99999" in vnca("view", "ink", smoke, "--port", 99999).complaint
    file = tmp_path / "file"
    file.write_text("mine")
    assert str(file) in vnca("view", "ink", smoke, "--export", file).complaint
    assert file.read_text() == "mine"
