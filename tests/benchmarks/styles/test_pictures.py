import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pictures import draw
from PIL import Image

SCRIPT = Path(__file__).parents[3] / "benchmarks" / "styles" / "pictures.py"
NAMES = ("stained_glass", "circuit")  # One of surfaces, one of lines.


def call(*arguments: object) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, str(SCRIPT), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_another_process_draws_the_same(tmp_path: Path) -> None:
    done = call(tmp_path, "--side", 64, "--only", *NAMES)
    assert done.returncode == 0, done.stderr
    for name in NAMES:
        np.testing.assert_array_equal(Image.open(tmp_path / f"{name}.png"), draw(name, 64))


@pytest.mark.parametrize("name", NAMES)
def test_has_lights_and_darks_and_no_seam(name: str) -> None:
    pixels = np.asarray(draw(name, 64), np.float64)
    assert pixels.shape == (64, 64, 3)
    dark, bright = np.quantile(pixels.max(2), (0.1, 0.9))
    assert bright - dark > 80
    for axis in (0, 1):
        steps = np.abs(np.diff(pixels, axis=axis, append=np.take(pixels, [0], axis)))
        across = np.take(steps, -1, axis).mean()
        assert across < 1.6 * steps.mean()


def test_what_a_user_can_mend_is_told_in_a_line(tmp_path: Path) -> None:
    done = call(tmp_path, "--side", 8, "--only", "ink")
    assert done.returncode == 2
    assert done.stderr.splitlines() == ["ink: a side of 8 pixels, but 64 are the fewest"]
