from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from vnca.cli import demo
from vnca.cli.demo import Demo
from vnca.core.volume import Volume
from vnca.losses.appearance import AppearanceConfig
from vnca.recipe.simulation import Scene, simulate
from vnca.recipe.stylizing import PaintedFrame, stylize
from vnca.rule import RuleConfig
from vnca.training.config import SmokeConfig, ViewConfig

Vnca = Callable[..., Any]

TINY = SmokeConfig(
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
    def small(scene: Scene, **asked: Any) -> Iterator[Volume]:
        return simulate(scene, **{**asked, "resolution": 12})

    def rough(*inputs: Any, **asked: Any) -> Iterator[PaintedFrame]:
        film = {"rows": 32, "columns": 32}
        return stylize(*inputs, **asked, film=film, warmup=2, steps_per_frame=1)

    def config(_: Demo) -> SmokeConfig:
        return TINY

    monkeypatch.setattr(demo, "simulate", small)
    monkeypatch.setattr(demo, "stylize", rough)
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
