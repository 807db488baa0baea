from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from vnca.automaton.rule import RuleConfig
from vnca.cli import demo
from vnca.cli.demo import Demo
from vnca.cli.simulate import Simulate, write_simulation
from vnca.cli.stylize import Stylize, paint
from vnca.losses.appearance import AppearanceConfig
from vnca.training.config import TrainConfig, ViewConfig

Vnca = Callable[..., Any]

TINY = TrainConfig(
    rule=RuleConfig(channels=6, hidden=8, position_prior=False),
    view=ViewConfig(size=32),
    appearance=AppearanceConfig(samples=64, layers=("stem", "block1")),
    iterations=2,
    shortest_rollout=2,
    longest_rollout=3,
)


def assert_complete(folder: Path, outcome: Any) -> None:
    assert outcome.code == 0, outcome.err
    assert str(folder / "demo.mp4") in outcome.out
    assert str(folder / "demo.png") in outcome.out
    assert (folder / "demo.mp4").stat().st_size > 1000
    with Image.open(folder / "demo.png") as sheet:
        assert sheet.width > 2 * sheet.height
        assert np.asarray(sheet).std() > 5


def test_the_demo_makes_smoke_rule_painting_film_and_sheet(
    vnca: Vnca, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def small(options: Simulate) -> None:
        write_simulation(replace(options, resolution=12))

    def rough(options: Stylize) -> None:
        film = replace(options.film, rows=32, columns=32)
        config = replace(options.config, warmup=2, steps_per_frame=1)
        paint(replace(options, film=film, config=config))

    def config(_: Demo) -> TrainConfig:
        return TINY

    monkeypatch.setattr(demo, "write_simulation", small)
    monkeypatch.setattr(demo, "paint", rough)
    monkeypatch.setattr(demo, "_config", config)
    monkeypatch.setattr(demo, "SHEET_SIZE", 32)
    folder = tmp_path / "demo"
    # Frames that an earlier, longer demo left behind do not get into the contact sheet.
    (folder / "painted").mkdir(parents=True)
    (folder / "painted" / "plume_0040.vdb").write_bytes(b"old")
    assert_complete(folder, vnca("demo", "--quick", "--out", folder))
    assert len(list((folder / "smoke").glob("*.vdb"))) == 24


@pytest.mark.slow
def test_the_quick_demo(vnca: Vnca, tmp_path: Path) -> None:
    assert_complete(tmp_path / "demo", vnca("demo", "--quick", "--out", tmp_path / "demo"))
