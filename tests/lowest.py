"""A whole job, small; `make test-lowest` runs it with the lowest versions that are allowed."""

from pathlib import Path

import numpy as np
import pytest
import torch

import vnca
from vnca.engine.triton.step import changing_rows, step_kernels

PICTURE = Path(vnca.__file__).parent / "data" / "rust.webp"
SMALL = {
    "rule": {"channels": 6, "hidden": 16},
    "view": {"size": 32},
    "appearance": {"samples": 64, "layers": ("stem", "block1")},
    "motion": {"size": 32},
    "pool": {"size": 2},
    "iterations": 4,
    "shortest_rollout": 2,
    "longest_rollout": 3,
}


@pytest.fixture(scope="module")
def plume(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("smoke")
    for _ in vnca.simulate("plume", out=folder, resolution=16, frames=8):
        pass
    return folder


def test_it_trains_and_paints(plume: Path, tmp_path: Path) -> None:
    model = vnca.train(
        plume / "plume_0008.vdb", PICTURE, out=tmp_path / "run", texture=0.0, **SMALL
    )
    again = vnca.train(plume / "plume_0008.vdb", PICTURE, texture=0.0, **SMALL)
    np.testing.assert_array_equal(model.rule.hidden, again.rule.hidden)
    painted = [*vnca.stylize(model, plume, out=tmp_path / "painted", frames="7-8")]
    assert all(frame.path is not None and frame.path.exists() for frame in painted)
    assert len(painted) == 2


def test_a_texture_is_trained(tmp_path: Path) -> None:
    small = {k: v for k, v in SMALL.items() if k not in ("view", "motion")}
    model = vnca.texture(PICTURE, block=16, slice={"size": 32, "count": 1}, **small)
    assert np.isfinite(model.rule.hidden).all()


def test_kernels_of_triton_run_in_its_interpreter() -> None:
    """Triton keeps what they are written with in other places from version to version."""
    hashes = torch.arange(300, dtype=torch.int32)
    drawn = {"seed": 1, "step": 2, "probability": 0.5}
    found = step_kernels.changing_rows(hashes, **drawn)
    torch.testing.assert_close(found, changing_rows(hashes, **drawn))
