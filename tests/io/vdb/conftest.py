"""OpenVDB itself as the judge, and small grids that hold one of everything."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core import Box
from vnca.io.vdb import VALUE_TYPES, Grid, Metadata, Tiles, Transform

HERE = Path(__file__).parent
ROOT = HERE.parents[2]
LOAD_ALL = {"OPENVDB_DISABLE_DELAYED_LOAD": "1"}  # or its memory statistics are of a part


def absent(what: str) -> None:
    """Skip at home, fail in continuous integration, where the judge must be there."""
    if os.environ.get("CI"):
        pytest.fail(f"{what} is missing")
    pytest.skip(f"{what} is missing")


@pytest.fixture(scope="session")
def openvdb_python() -> str:
    python = os.environ.get("VNCA_OPENVDB_PYTHON", "/usr/bin/python3")
    probe = [python, "-c", "import pyopenvdb"]
    if not shutil.which(python) or subprocess.run(probe, capture_output=True).returncode:
        absent("a python with pyopenvdb (VNCA_OPENVDB_PYTHON)")
    return python


@pytest.fixture(scope="session")
def vdb_tool() -> Callable[..., None]:
    """Rewrites a file with OpenVDB: `vdb_tool(source, target, "codec=zip", "bits=16")`."""
    if not shutil.which("vdb_tool"):
        absent("vdb_tool")

    def rewrite(source: Path, target: Path, *options: str) -> None:
        command = ["vdb_tool", "-read", source, "-write", *options, target]
        environment = os.environ | LOAD_ALL
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        assert target.exists(), done.stdout + done.stderr

    return rewrite


@pytest.fixture(scope="session")
def written_by_openvdb(openvdb_python: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of files that OpenVDB wrote, one a variant."""
    folder = tmp_path_factory.mktemp("openvdb")
    subprocess.run([openvdb_python, HERE / "openvdb_writes.py", folder], check=True)
    return folder


Judged = list[dict[str, Any]]


@pytest.fixture(scope="session")
def judge(
    openvdb_python: str, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[list[Path]], list[Judged]]:
    """Reads files with OpenVDB: for each, its grids by name with values and active cells."""

    def read(paths: list[Path]) -> list[Judged]:
        folder = tmp_path_factory.mktemp("judged")
        environment = os.environ | LOAD_ALL
        command = [openvdb_python, HERE / "openvdb_reads.py", folder, *paths]
        subprocess.run(command, check=True, env=environment)
        results = []
        for number in range(len(paths)):
            grids = json.loads((folder / f"{number}.json").read_text())
            with np.load(folder / f"{number}.npz") as arrays:
                for index, grid in enumerate(grids):
                    for part in ("cells", "values", "active"):
                        grid[part] = arrays[f"{index}.{part}"]
                    grid["box"] = Box(*(tuple(corner) for corner in grid["box"]))
            results.append(grids)
        return results

    return read


@pytest.fixture(scope="session")
def assert_agrees() -> Callable[[Grid, dict[str, Any]], None]:
    """Compares a grid as read here with what OpenVDB saw of it, bit by bit."""

    def compare(grid: Grid, judged: dict[str, Any]) -> None:
        values, active = grid.to_dense(judged["box"])
        if len(judged["cells"]):
            i, j, k = (judged["cells"] - judged["box"].lower).T
            values, active = values[i, j, k], active[i, j, k]
        assert values.astype(judged["values"].dtype).tobytes() == judged["values"].tobytes()
        np.testing.assert_array_equal(active, judged["active"])
        lower, upper = judged["bounds"] or ((0, 0, 0), (0, 0, 0))
        assert grid.active_box() == Box(tuple(lower), tuple(upper))
        assert grid.active_voxels == judged["active_voxels"]
        np.testing.assert_allclose(
            grid.transform.index_to_world[:3], judged["matrix"], rtol=1e-12, atol=1e-12
        )
        assert (grid.name, grid.grid_class, grid.is_half) == (
            judged["name"], judged["class"], judged["half"],
        )  # fmt: skip
        np.testing.assert_array_equal(grid.tree.background, judged["background"])

    return compare


@pytest.fixture(scope="session")
def shared_smoke() -> list[Path]:
    folder = Path(os.environ.get("VNCA_SHARED_DATA", ROOT.parent / "shared" / "data"))
    files = sorted((folder / "smoke" / "plume_sphere").glob("*.vdb"))
    if not files:
        pytest.skip(f"no smoke in {folder} (VNCA_SHARED_DATA)")
    return files


@pytest.fixture(scope="session")
def real_frame() -> Path:
    return ROOT / "tests" / "data" / "plume_sphere_0030.vdb"


@pytest.fixture
def random_grid() -> Callable[..., Grid]:
    """Builds a grid of any type: ragged leaves around an origin off the lattice of leaves."""

    def build(
        value_type: str = "float",
        *,
        name: str | None = None,
        half: bool = False,
        background: Any = 0,
        seed: int = 0,
    ) -> Grid:
        rng = np.random.default_rng(seed)
        kind = VALUE_TYPES[value_type]
        shape = (13, 9, 20, 3) if kind.components == 3 else (13, 9, 20)
        values = (rng.normal(size=shape) * 40).astype(kind.dtype)
        active = rng.random(shape[:3]) < 0.3
        active[:8, :6, :8] = True  # part of it in full leaves
        return Grid.from_dense(
            name or value_type, values, active, (-5, 125, -3),
            transform=Transform.uniform(0.1, (1, 2, 3)), half=half, background=background,
        )  # fmt: skip

    return build


@pytest.fixture
def tiled_grid(random_grid: Callable[..., Grid]) -> Callable[..., Grid]:
    """The same with tiles of every level, active and not."""

    def build(value_type: str = "float", **options: Any) -> Grid:
        grid = random_grid(value_type, **options)
        kind = VALUE_TYPES[value_type]
        origins = [
            (8192, 0, 0), (0, -4096, 0), (128, 128, 0), (128, 0, 128), (64, 0, 0), (72, 0, 8),
        ]  # fmt: skip
        values = np.arange(11, 17).repeat(kind.components).reshape(6, kind.components)
        tiles = Tiles(
            np.array(origins, np.int32),
            np.array([4096, 4096, 128, 128, 8, 8], np.int32),
            kind.shaped(values.astype(kind.dtype)),
            np.array([1, 0, 1, 0, 1, 0], bool),
        )
        return Grid(
            grid.name, value_type, grid.transform, grid.tree._replace(tiles=tiles),
            Metadata(), grid.is_half,
        )  # fmt: skip

    return build


if sys.byteorder != "little":
    collect_ignore_glob = ["*"]
