import struct
from pathlib import Path

import numpy as np
import pytest

from vnca.core.errors import GridError
from vnca.io.smoke import read_smoke
from vnca.io.smoke_format import SmokeFormat
from vnca.io.vdb import Grid, Transform, open_vdb, write_vdb
from vnca.io.vdb.cursor import encode_string
from vnca.io.vdb_grids import listed_vectors, velocity_headers


def saved(folder: Path, *names: str) -> Path:
    """A file of grids; a name that ends in `!` is one of vectors."""
    active = np.ones((2, 2, 2), np.bool_)
    write_vdb(
        folder / "s.vdb",
        [
            Grid.from_dense(
                name.removesuffix("!"),
                np.ones((2, 2, 2, 3) if name.endswith("!") else (2, 2, 2), np.float32),
                active,
                (0, 0, 0),
                transform=Transform.uniform(1),
            )
            for name in ("density", *names)
        ],
    )
    return folder / "s.vdb"


def found(path: Path, velocity_grid: str | None = None) -> list[str]:
    with open_vdb(path) as file:
        return [h.name for h in velocity_headers(file, SmokeFormat(velocity_grid=velocity_grid))]


def three(shared: str, axes: str = "xyz") -> list[str]:
    return [shared + axis for axis in axes]


@pytest.mark.parametrize("name", ["velocity", "vel", "v"])
def test_velocity_is_found_in_any_case_and_with_any_separator(tmp_path: Path, name: str) -> None:
    for spelt in (name, name.capitalize(), name.upper()):
        assert found(saved(tmp_path, f"{spelt}!", "Cd!")) == [spelt]
        for separator in (".", "_", ""):
            for axes in ("xyz", "XYZ"):
                parts = three(spelt + separator, axes)
                assert found(saved(tmp_path, *reversed(parts), "fuel")) == parts


def test_exact_names_come_first_in_their_order(tmp_path: Path) -> None:
    assert found(saved(tmp_path, "Velocity!", "vel_x", "vel_y", "vel_z", "v!")) == ["v"]
    assert found(saved(tmp_path, "v!", "vel!", "velocity!")) == ["velocity"]
    assert found(saved(tmp_path, "Velocity!", *three("vel."))) == three("vel.")


@pytest.mark.parametrize(
    "names",
    [
        ("Velocity!", *three("vel_")),
        ("Velocity!", "Vel!"),
        (*three("vel_"), *three("v")),
        (*three("vel"), *three("vel", "XYZ")),
    ],
)
def test_of_two_that_could_be_it_both_are_named_and_either_can_be_chosen(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    path = saved(tmp_path, *names)
    choices = [name.removesuffix("!") for name in names if name[-1] in "!xX"]
    assert len(choices) == 2
    with pytest.raises(GridError, match=f"choose with `velocity_grid` from {', '.join(choices)}$"):
        found(path)
    for choice in choices:
        assert found(path, choice)[0] == choice


def test_a_name_that_is_asked_for_may_be_any(tmp_path: Path) -> None:
    path = saved(tmp_path, "wind!", *three("Gust_", "XYZ"), "velocity!")
    assert found(path, "wind") == found(path, "Wind") == ["wind"]
    assert found(path, "gust") == found(path, "Gust_X") == three("Gust_", "XYZ")
    assert found(path, "none") == []
    with pytest.raises(GridError, match=r"no velocity 'breeze'; choose .* wind \(vec3s\)"):
        found(path, "breeze")


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("vel_x", "vel_z"), "velocity 'vel' lacks the scalar grid vel_y; leave"),
        (("VelocityY",), "velocity 'Velocity' lacks the scalar grid VelocityX, VelocityZ"),
        (("vel.x", "vel.y", "vel.z!"), r"lacks the scalar grid vel\.z"),
    ],
)
def test_a_component_that_is_missing_is_named(
    tmp_path: Path, names: tuple[str, ...], words: str
) -> None:
    with pytest.raises(GridError, match=words):
        found(saved(tmp_path, *names))


class Frustum(Transform):
    """A map of OpenVDB's that is not linear, as a file has it."""

    def encode(self) -> bytes:
        behind = struct.pack("<8d", 0, 0, 0, 1, 1, 1, 0.5, 1) + super().encode()
        return encode_string(b"NonlinearFrustumMap") + behind


@pytest.mark.parametrize("names", [("vel!",), ("Velocity!",), ("vel.x", "vel.y", "vel.z")])
def test_a_velocity_in_a_frustum_is_refused_by_its_name(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    path = saved(tmp_path, *names, "wind!")
    with open_vdb(path) as file:
        grids = [header.read() for header in file.grids.values()]
    for grid in grids[1:-1]:
        grid.transform = Frustum(grid.transform.map_type, grid.transform.numbers)
    write_vdb(path, grids)
    first = names[0].removesuffix("!")
    line = (
        rf"s\.vdb: velocity grid '{first}' has a NonlinearFrustumMap, .*; choose another with "
        "`velocity_grid`, or leave it out with `velocity_grid` none$"
    )
    for asked in (None, first):
        with pytest.raises(GridError, match=line):
            found(path, asked)
        with pytest.raises(GridError, match=line):
            read_smoke(path, SmokeFormat(velocity_grid=asked))
    for chosen, has_velocity in (("wind", True), ("none", False)):
        smoke = read_smoke(path, SmokeFormat(velocity_grid=chosen))
        assert (smoke.velocity is not None) is has_velocity


@pytest.mark.parametrize("name", ["vel", "V", "velocity"])
def test_a_velocity_of_an_unknown_type_is_refused_by_its_name(tmp_path: Path, name: str) -> None:
    path = saved(tmp_path, f"{name}!", "wind!")
    data = path.read_bytes()
    at = data.index(b"Tree_vec3s")
    path.write_bytes(data[:at] + data[at:].replace(b"Tree_vec3s", b"Tree_vec3h", 1))
    line = (
        rf"s\.vdb: grid '{name}' is of type vec3h, which cannot be read as velocity; "
        "choose another with `velocity_grid`, or leave it out with `velocity_grid` none$"
    )
    for asked in (None, name):
        with pytest.raises(GridError, match=line):
            read_smoke(path, SmokeFormat(velocity_grid=asked))
    assert found(path, "wind") == ["wind"]
    assert read_smoke(path, SmokeFormat(velocity_grid="none")).velocity is None


def test_a_velocity_of_a_known_type_is_found_beside_one_of_an_unknown(tmp_path: Path) -> None:
    path = saved(tmp_path, "velocity!", "vel!")
    data = path.read_bytes()
    path.write_bytes(data.replace(b"Tree_vec3s", b"Tree_vec3h", 1))
    assert found(path) == ["vel"]


def test_other_grids_are_no_velocity_but_are_listed(tmp_path: Path) -> None:
    path = saved(tmp_path, "Cd!", *three("wind."), "fuel", "axis_x", "x", "y", "z")
    assert found(path) == []
    with open_vdb(path) as file:
        assert listed_vectors(file) == "Cd (vec3s), wind.x with wind.y and wind.z"
    with open_vdb(saved(tmp_path, "heat")) as file:
        assert listed_vectors(file) == ""
