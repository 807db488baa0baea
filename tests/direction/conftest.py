"""Small smoke in files, and what it is painted with."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vnca
from vnca.core import AnyArray
from vnca.core.volume import Volume
from vnca.io import write_smoke
from vnca.io.vdb import Grid, Transform, open_vdb, write_vdb

MODEL = Path(__file__).parents[1] / "data" / "painting" / "rule.safetensors"
QUICK = {"warmup": 3, "steps_per_frame": 2}
Grids = Mapping[str, AnyArray]
"""What a painted file holds, by the name of the grid, where the density is active."""


@pytest.fixture
def smoke(tmp_path: Path) -> Path:
    """Three frames of a ball that moves by a cell a frame along x; cells of half a unit."""
    cells = np.stack(np.meshgrid(*[np.arange(13)] * 3, indexing="ij"), axis=-1) - 6
    density = np.clip(6 - np.linalg.norm(cells, axis=-1), 0, 1).astype(np.float32)
    velocity = np.zeros((*density.shape, 3), np.float32)
    velocity[..., 0] = 1
    for frame in (1, 2, 3):
        volume = Volume(density, velocity, (frame, 0, 0), np.diag([0.5, 0.5, 0.5, 1]), frame)
        write_smoke(tmp_path / "smoke" / f"ball_{frame:04d}.vdb", volume)
    return tmp_path / "smoke"


@pytest.fixture
def add_grid(smoke: Path) -> Callable[..., None]:
    """Adds a grid to frames, or writes it to a file of its own."""

    def add(
        name: str,
        values: AnyArray,
        frames: tuple[int, ...] = (1, 2, 3),
        *,
        origin: tuple[int, int, int] = (0, 0, 0),
        cell: float = 0.5,
        to: Path | None = None,
    ) -> None:
        matrix = np.diag([cell, cell, cell, 1.0])
        matrix[:3, 3] = (cell - 0.5) / 2  # the first cell begins where one of the smoke does
        held = values != 0
        grid = Grid.from_dense(name, values, held, origin, transform=Transform.from_matrix(matrix))
        if to is not None:
            write_vdb(to, [grid])
            return
        for frame in frames:
            path = smoke / f"ball_{frame:04d}.vdb"
            with open_vdb(path) as file:
                grids = [*(file.read(each) for each in file.names), grid]
            write_vdb(path, grids)

    return add


@pytest.fixture
def add_vectors(smoke: Path) -> Callable[..., None]:
    """Adds a grid that holds one vector everywhere to frames."""

    def add(name: str, vector: tuple[float, ...], frames: tuple[int, ...] = (1, 2, 3)) -> None:
        values = np.broadcast_to(np.float32(vector), (24, 24, 24, 3)).copy()
        transform = Transform.from_matrix(np.diag([0.5, 0.5, 0.5, 1.0]))
        held = np.ones((24, 24, 24), bool)
        grid = Grid.from_dense(name, values, held, (-2, -2, -2), transform=transform)
        for frame in frames:
            path = smoke / f"ball_{frame:04d}.vdb"
            with open_vdb(path) as file:
                grids = [*(file.read(each) for each in file.names if each != name), grid]
            write_vdb(path, grids)

    return add


@pytest.fixture
def painted(smoke: Path, tmp_path: Path) -> Callable[..., list[Grids]]:
    """Paints the ball as options say."""
    numbers = iter(range(100))

    def paint(model: Any = MODEL, **options: Any) -> list[Grids]:
        out = tmp_path / f"painted{next(numbers)}"
        frames = vnca.stylize(model, smoke, out=out, **{**QUICK, **options})
        return [grids_of(frame.path) for frame in frames if frame.path is not None]

    return paint


def grids_of(path: Path) -> Grids:
    with open_vdb(path) as file:
        density = file.read("density")
        box = density.active_box()
        _, active = density.to_dense(box)
        return {name: file.read(name).to_dense(box)[0][active] for name in file.names}


@pytest.fixture
def read() -> Callable[[Path], Grids]:
    """What a file holds."""
    return grids_of


@pytest.fixture
def model() -> Path:
    return MODEL
