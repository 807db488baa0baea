"""The command line as a user meets it, with smoke, a picture and a model to use it on."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image

from vnca.cli import main
from vnca.core.volume import Volume
from vnca.io import write_smoke
from vnca.io.vdb import Grid, open_vdb, write_vdb
from vnca.rule import Rule, RuleConfig, Scales
from vnca.rule.model import MODEL_NAME, Model

TINY = (
    *("--iterations", "2", "--hidden", "8", "--channels", "6", "--view.size", "32"),
    *("--shortest-rollout", "2", "--longest-rollout", "3", "--appearance.samples", "64"),
    *("--appearance.layers", "stem", "block1", "--device", "cpu"),
    *("--texture", "0"),
)
"""Options of a training that takes a moment."""


class Outcome(NamedTuple):
    code: int
    out: str
    err: str

    @property
    def complaint(self) -> str:
        """The one line that tells of a mistake."""
        assert self.code == 2, self
        assert "Traceback" not in self.err
        (line,) = self.err.splitlines()
        assert line.startswith("vnca: "), line
        return line


Vnca = Callable[..., Outcome]


@pytest.fixture
def vnca(capfd: pytest.CaptureFixture[str]) -> Vnca:
    """Runs the command line in this process: `vnca("info", path)`."""

    def run(*arguments: object) -> Outcome:
        capfd.readouterr()
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as stop:  # tyro's own messages
            code = int(stop.code or 0)
        out, err = capfd.readouterr()
        return Outcome(code, out, err)

    return run


@pytest.fixture
def tiny() -> list[str]:
    return list(TINY)


@pytest.fixture(scope="session")
def made_smoke(tiny_smoke: Volume, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "smoke"
    for number in (1, 2, 3):
        x, y, z = tiny_smoke.origin
        moved = replace(tiny_smoke, origin=(x, y, z + number), frame=number)
        path = folder / f"ball_{number:04d}.vdb"
        write_smoke(path, moved)
        with open_vdb(path) as file:
            density = file.grids["density"].read()
            heat = Grid.from_dense(
                "temperature", 300 * moved.density, moved.density > 0, moved.origin, like=density
            )
            write_vdb(
                path,
                [*file.grids.values(), heat],
                metadata={"shot": f"shot {number}"},
            )
    return folder


@pytest.fixture
def smoke(made_smoke: Path, tmp_path: Path) -> Path:
    """A folder of three frames, `ball_0001.vdb` on, with density, velocity and temperature."""
    return Path(shutil.copytree(made_smoke, tmp_path / "smoke"))


@pytest.fixture
def frame(smoke: Path) -> Path:
    return smoke / "ball_0002.vdb"


@pytest.fixture
def style(tmp_path: Path) -> Path:
    path = tmp_path / "style.png"
    with Image.open(str(files("vnca.data") / "vangogh_cafe_terrace.webp")) as image:
        image.convert("RGB").resize((40, 50)).save(path)
    return path


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """The folder of a run whose model was made up."""
    config = RuleConfig(channels=6, hidden=8, position_prior=False)
    rule = Rule.initial(config, Scales(density=0.9, velocity=0.4, gamma=0.7), seed=3)
    random = np.random.default_rng(4)
    output = random.normal(0, 0.02, rule.output.shape).astype(np.float32)
    training = {"style": "night.png", "preset": "draft", "iterations": 300}
    Model(replace(rule, output=output), training).save(tmp_path / "run" / MODEL_NAME)
    return tmp_path / "run"
