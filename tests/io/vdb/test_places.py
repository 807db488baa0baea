"""OpenVDB says where cells are: smoke is read from there, and painted there."""

import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core import AnyArray
from vnca.core.lattice import Lattice
from vnca.core.volume import Volume
from vnca.io import SmokeFormat, read_smoke, write_painted
from vnca.io.smoke_format import on_lattice

Judge = Callable[[list[Path]], list[list[dict[str, Any]]]]
FORM = SmokeFormat(velocity_units="m/s", fps=4)
SAME = ("plain", "moved", "mirrored", "exchanged", "turned", "all")


@pytest.fixture(scope="module")
def turns(openvdb_python: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of files that OpenVDB wrote, of one smoke in the world."""
    folder = tmp_path_factory.mktemp("turns")
    script = Path(__file__).with_name("openvdb_turns.py")
    subprocess.run([openvdb_python, script, folder], check=True)
    return folder


def laid(path: Path) -> Volume:
    alone = read_smoke(path, FORM)
    return on_lattice(alone, Lattice.of(alone.index_to_world, "it"), "it")


@pytest.mark.parametrize("name", SAME)
def test_one_smoke_is_read_from_every_grid_of_openvdb(turns: Path, name: str) -> None:
    plain, smoke = laid(turns / "plain.vdb"), laid(turns / f"{name}.vdb")
    assert smoke.box == plain.box
    np.testing.assert_allclose(smoke.index_to_world, np.diag([0.25, 0.25, 0.25, 1]), atol=1e-9)
    np.testing.assert_array_equal(smoke.density > 0, plain.density > 0)
    np.testing.assert_allclose(smoke.density, plain.density, atol=1e-6)
    assert smoke.velocity is not None
    where = np.argwhere(smoke.density > 0)
    x, y, z = 0.25 * (where + smoke.origin).T
    # A cell is a quarter of a metre, and a frame a quarter of a second.
    expected = np.stack([1 + x, 2 - z, 3 + y], axis=-1)
    np.testing.assert_allclose(smoke.velocity[tuple(where.T)], expected, atol=1e-5)


def places(grid: dict[str, Any]) -> Iterator[tuple[AnyArray, AnyArray]]:
    """Where in the world each active cell is, as OpenVDB has it, and its value."""
    cells = np.argwhere(grid["active"]) + grid["box"].lower
    matrix = np.array(grid["matrix"])
    return zip(
        cells @ matrix[:3, :3].T + matrix[:3, 3], grid["values"][grid["active"]], strict=True
    )


@pytest.mark.parametrize("common", [False, True])
def test_what_is_painted_at_a_place_is_there_for_openvdb(
    turns: Path, judge: Judge, tmp_path: Path, common: bool
) -> None:
    """Also in a grid whose cells are not those that were painted on, in the lattice of another."""
    lattice = Lattice(laid(turns / "plain.vdb").index_to_world)
    names = (*SAME, "slanted") if common else SAME
    for name in names:
        source = turns / f"{name}.vdb"
        smoke = read_smoke(source, FORM, lattice=lattice)
        at = np.moveaxis(np.indices(smoke.density.shape), 0, -1) + smoke.origin
        colour = (0.5 + 0.05 * at).astype(np.float32)
        density = (smoke.density * (1 + 0.02 * at[..., 2])).astype(np.float32)
        write_painted(
            tmp_path / f"{name}.vdb",
            source,
            FORM,
            density=density,
            colour=colour,
            box=smoke.box,
            lattice=lattice,
        )
    found = judge([folder / f"{name}.vdb" for folder in (turns, tmp_path) for name in names])
    for before, after in zip(found[: len(names)], found[len(names) :], strict=True):
        (old, _), (colour, new, _) = before, after
        assert (old["name"], new["name"], colour["name"]) == ("density", "density", "Cd")
        for grid in (new, colour):
            np.testing.assert_array_equal(grid["matrix"], old["matrix"])
        assert new["active_voxels"] == old["active_voxels"]
        coloured = {tuple(place.round(6)): value for place, value in places(colour)}
        assert len(coloured) > old["active_voxels"]  # it goes on around the smoke
        for place, _ in places(old):
            value = coloured[tuple(place.round(6))]
            np.testing.assert_allclose(value, 0.5 + 0.05 * place / 0.25, atol=1e-4)
        for (place, was), (_, is_now) in zip(places(old), places(new), strict=True):
            # In a slanted grid, the outermost cells have a part of what lies beside the smoke.
            near = 0.03 if common else 1e-5
            assert is_now / was == pytest.approx(1 + 0.02 * place[2] / 0.25, abs=near)
