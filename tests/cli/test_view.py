"""`vnca view`: a site that is written, and a page that is served."""

import json
import threading
import urllib.request
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from vnca.recipe import SILENT
from vnca.recipe.viewing import ViewRun
from vnca.recipe.viewing import run as show
from vnca.rule import conditioning
from vnca.rule.conditioning import Conditioning
from vnca.rule.library import style_names
from vnca.rule.model import MODEL_NAME, Model
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
        show(ViewRun(model="ink", sequence=str(smoke)), SILENT, opened)
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


def test_fields_that_a_rule_is_conditioned_on_are_brought_along(
    vnca: Vnca, model: Path, smoke: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(conditioning, "_KNOWN", dict(conditioning._KNOWN))
    conditioning.register_conditioning(Conditioning.of_field("temperature", scale=300))
    made = Model.load(model)
    config = replace(made.rule.config, conditioning=("density", "temperature"))
    hidden = made.rule.hidden[:, :-5]
    replace(made, rule=replace(made.rule, config=config, hidden=hidden)).save(model / MODEL_NAME)
    site = tmp_path / "site"
    told = vnca("view", model, smoke, "--export", site)
    assert told.code == 0, told.err
    file = SmokeFile(site / "smoke.bin")
    assert [(field.name, field.width) for field in file.fields] == [("temperature", 1)]
    first = next(file.volumes())
    assert first.named_fields["temperature"].values.max() > 0
    assert "a plume that is simulated has no temperature" in vnca("view", model).complaint


def test_a_training_is_watched_while_it_runs(
    vnca: Vnca,
    frame: Path,
    style: Path,
    tiny: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from vnca.cli import train

    seen: dict[str, Any] = {}

    def opened(address: str) -> None:
        for name in ("show.json", "run.json"):
            with urllib.request.urlopen(address + name) as answer:
                seen[name] = json.load(answer)
        with urllib.request.urlopen(address + seen["show.json"]["rules"][0]["model"]) as answer:
            seen["model"] = answer.read()

    monkeypatch.setattr(train.webbrowser, "open", opened)
    run = tmp_path / "watched"
    told = vnca("train", frame, style, "--out", run, *tiny, "--view")
    assert told.code == 0, told.err
    assert "the training can be watched at http://127.0.0.1:" in told.err
    assert seen["show.json"]["run"]
    assert seen["show.json"]["rules"][0]["name"] == "watched"
    assert seen["run.json"]["iteration"] == 0
    assert len(seen["model"]) > 1000
    # Afterwards, in its folder: the frame of the training is found, and the curves.
    page: list[dict[str, Any]] = []

    def afterwards(address: str) -> None:
        with urllib.request.urlopen(address + "run.json") as answer:
            page.append(json.load(answer))
        with urllib.request.urlopen(address + "rules/0.safetensors") as answer:
            assert answer.read() == (run / MODEL_NAME).read_bytes()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        show(ViewRun(model=str(run)), SILENT, afterwards)
    assert page[0]["iteration"] == page[0]["iterations"] == 2
    assert page[0]["curves"]["total"]
