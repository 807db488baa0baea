from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vnca.core.errors import FileFormatError
from vnca.core.volume import Volume
from vnca.io import SmokeFormat, read_smoke
from vnca.io.painted import write_painted, write_smoke
from vnca.io.provenance import Provenance, as_told, read_provenance, velocity_of
from vnca.io.vdb import Metadata, open_vdb, write_vdb

PLAIN = SmokeFormat()
MANTAFLOW = SmokeFormat("smoke", velocity_units="mantaflow", time_scale=0.4, staggered=True)
PAINTED = Provenance(
    2.5,
    0.75,
    "z",
    {"model": "night", "refine": 2, "strength": 0.5},
    velocity_of(MANTAFLOW),
)


@pytest.fixture
def smoke(tmp_path: Path, tiny_smoke: Volume) -> Path:
    write_smoke(tmp_path / "s.vdb", tiny_smoke)
    return tmp_path / "s.vdb"


def paint(source: Path, target: Path, provenance: Provenance | None) -> None:
    volume = read_smoke(source, PLAIN)
    colour = np.ones((*volume.density.shape, 3), np.float32)
    write_painted(
        target,
        source,
        PLAIN,
        density=volume.density,
        colour=colour,
        box=volume.box,
        provenance=provenance,
    )


def test_a_painting_tells_what_was_told_of_it(smoke: Path, tmp_path: Path) -> None:
    assert read_provenance(smoke) is None
    paint(smoke, tmp_path / "painted.vdb", PAINTED)
    assert read_provenance(tmp_path / "painted.vdb") == PAINTED
    assert read_provenance(tmp_path / "smoke.npz") is None


def test_names_that_are_no_text_and_long_seeds_are_told_too(smoke: Path, tmp_path: Path) -> None:
    strange = Provenance(1.0, 1.0, "z", {"style": "caf\udce9.png", "seed": 2**70})
    paint(smoke, tmp_path / "painted.vdb", strange)
    told = read_provenance(tmp_path / "painted.vdb")
    assert told is not None
    assert told.facts == {"style": "caf\\udce9.png", "seed": str(2**70)}


def test_a_velocity_is_read_as_it_was_unless_something_else_is_asked_for() -> None:
    assert velocity_of(PLAIN) == {}
    assert PAINTED.velocity == {
        "velocity_units": "mantaflow",
        "time_scale": 0.4,
        "staggered": True,
    }
    told = as_told(SmokeFormat("smoke"), PAINTED)
    assert told == replace(MANTAFLOW, up_axis="z")
    asked = SmokeFormat(velocity_scale=0.8, up_axis="y")
    assert as_told(asked, PAINTED) == asked


@pytest.mark.parametrize(
    "text", ["{", "3", "[]x", '{"fps": "fast"}', '{"up_axis": "y"}', '["fps"]', "null"]
)
def test_a_velocity_that_makes_no_sense_is_refused(smoke: Path, tmp_path: Path, text: str) -> None:
    paint(smoke, tmp_path / "painted.vdb", PAINTED)
    with open_vdb(tmp_path / "painted.vdb") as file:
        metadata = Metadata.of({n: entry.value for n, entry in file.metadata.items()})
        metadata |= Metadata.of({"vnca_velocity": text})
        write_vdb(tmp_path / "odd.vdb", list(file.grids.values()), metadata=metadata)
    with pytest.raises(FileFormatError, match="vnca_velocity"):
        read_provenance(tmp_path / "odd.vdb")


def test_another_gamma_changes_the_extinction_in_proportion() -> None:
    assert PAINTED.seen_with(None) == 2.5
    assert PAINTED.seen_with(1.5) == 5


def test_what_is_painted_again_tells_of_the_last_painting_alone(
    smoke: Path, tmp_path: Path
) -> None:
    once, again, bare = (tmp_path / f"{name}.vdb" for name in ("once", "again", "bare"))
    with open_vdb(smoke) as file:
        write_vdb(tmp_path / "shot.vdb", list(file.grids.values()), metadata={"shot": "a 10"})
    paint(tmp_path / "shot.vdb", once, PAINTED)
    paint(once, again, Provenance(1.0, 1.0, "y", {"seed": 4}))
    paint(again, bare, None)
    assert read_provenance(again) == Provenance(1.0, 1.0, "y", {"seed": 4})
    with open_vdb(bare) as file:
        assert {name: entry.value for name, entry in file.metadata.items()} == {"shot": "a 10"}


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("vnca_extinction", 0.0),
        ("vnca_extinction", float("nan")),
        ("vnca_extinction", "thick"),
        ("vnca_gamma", -1.0),
        ("vnca_gamma", True),
        ("vnca_up_axis", "x"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(
    smoke: Path, tmp_path: Path, entry: str, value: object
) -> None:
    path = tmp_path / "painted.vdb"
    with open_vdb(smoke) as file:
        told = {name: each.value for name, each in PAINTED.metadata.items()}
        write_vdb(path, list(file.grids.values()), metadata={**told, entry: value})
    with pytest.raises(FileFormatError, match=rf"painted\.vdb: .*{entry}"):
        read_provenance(path)
