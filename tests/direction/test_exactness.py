"""What changes nothing changes nothing, to the bit."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.io import read_smoke, write_smoke

Painted = Callable[..., list[dict[str, Any]]]
MODEL = Path(__file__).parents[1] / "data" / "painting" / "rule.safetensors"
ALL = "box(-9,-9,-9, 99,99,99)"
"""A mask of ones."""


def assert_same(ones: list[Any], others: list[Any], *names: str) -> None:
    assert len(ones) == len(others) == 3
    for one, other in zip(ones, others, strict=True):
        for name in names or ("density", "Cd"):
            np.testing.assert_array_equal(one[name], other[name])


@pytest.mark.parametrize("refine", [1, 2])
def test_strength_0_leaves_density_and_white(
    painted: Painted, smoke: Path, read: Any, refine: int
) -> None:
    (plain, *_) = painted(strength=0, density_strength="1:0 3:0", refine=refine)
    np.testing.assert_array_equal(plain["Cd"], 1)
    if refine == 1:
        source = read(smoke / "ball_0001.vdb")
        for name, values in source.items():
            np.testing.assert_array_equal(plain[name], values)


def test_strength_0_leaves_the_density_of_uneven_voxels(
    painted: Painted, smoke: Path, read: Any
) -> None:
    for path in smoke.glob("*.vdb"):
        volume = read_smoke(path)
        write_smoke(path, replace(volume, index_to_world=np.diag([0.5, 0.6, 0.8, 1.0])))
    (plain, *_) = painted(strength=0, density_strength=0)
    np.testing.assert_array_equal(plain["density"], read(smoke / "ball_0001.vdb")["density"])
    (changed, *_) = painted(strength=0)
    assert (changed["density"] != plain["density"]).mean() > 0.5


@pytest.mark.parametrize(
    "options",
    [
        {"strength": ALL, "density_strength": ALL},
        {"steps_per_frame": f"2 * {ALL}"},
        {"hue": f"1 - {ALL}", "saturation": ALL, "lightness": f"0 * {ALL}", "exposure": "0 * x"},
        {"edge": "0 * height", "silhouette": "free"},
        {"strength": "@everywhere", "masks": {"everywhere": f"advected({ALL})"}},
        {"layers": {MODEL: "height:0..1"}},
        {"layers": {MODEL: "0.3"}},
        {"layers": {MODEL: ALL}},
    ],
    ids=lambda options: " ".join(options),
)
def test_masks_of_ones_and_layers_of_the_same_style_equal_none(
    painted: Painted, options: dict[str, Any]
) -> None:
    assert_same(painted(refine=2), painted(refine=2, **options))


@pytest.mark.parametrize("cell", [0.5, 0.25, 0.125, 0.7])
def test_a_grid_of_ones_equals_none_whatever_its_cells(
    painted: Painted, add_grid: Callable[..., None], cell: float
) -> None:
    plain = painted(refine=2)
    size = round(12 / cell)
    origin = (-round(1 / cell),) * 3
    add_grid("mask", np.ones((size, size, size), np.float32), cell=cell, origin=origin)
    assert_same(plain, painted(refine=2, strength="@mask", density_strength="@mask"))


def test_a_mask_stored_only_where_there_is_smoke_is_enough(
    painted: Painted, add_grid: Callable[..., None], smoke: Path
) -> None:
    plain = painted(refine=2)
    for frame in (1, 2, 3):
        held = read_smoke(smoke / f"ball_{frame:04d}.vdb")
        ones = (held.density > 0).astype(np.float32)
        add_grid("mask", ones, (frame,), origin=held.origin)
    assert_same(plain, painted(refine=2, strength="@mask", density_strength="@mask"))
