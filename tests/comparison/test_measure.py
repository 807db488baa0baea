"""All contenders are judged alike, by what can be told of a painting."""

from pathlib import Path

import numpy as np
import pytest

from vnca.comparison import CompareRun, Contender
from vnca.comparison.measure import Bench, bench, measure
from vnca.comparison.report import as_json, report, table
from vnca.core.errors import OptionError, SequenceError
from vnca.core.field import Field
from vnca.core.volume import Volume
from vnca.io import SmokeFormat, read_smoke, write_painted, write_smoke
from vnca.io.provenance import Provenance
from vnca.io.sequence import FrameSequence, find_frames
from vnca.recipe import SILENT
from vnca.recipe.sequence import sequence_region, volumes
from vnca.simulation import simulate

FRAMES = 9


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> FrameSequence:
    folder = tmp_path_factory.mktemp("smoke")
    for volume in simulate("plume", resolution=24, frames=10 + FRAMES, seed=0):
        if volume.frame > 10:
            write_smoke(folder / f"plume_{volume.frame:04d}.vdb", volume)
    return find_frames(folder, None)


@pytest.fixture(scope="module")
def judged(sequence: FrameSequence) -> tuple[list[Volume], Bench]:
    region = sequence_region(sequence, SmokeFormat(), SILENT)
    given = list(volumes(sequence, SmokeFormat(), region.lattice))
    rows = np.arange(80)[:, None, None]
    picture = (0.5 + 0.4 * np.sin(rows) * np.ones((80, 80, 3))).astype(np.float32)
    return given, bench(given, region, picture, SmokeFormat(), 96, SILENT)


def painted(
    folder: Path, sequence: FrameSequence, factor: float = 1.0, *, flickers: bool = False
) -> Contender:
    """Smoke with noise of cells in it, which stands still or changes from frame to frame."""
    for at, frame in enumerate(sequence):
        smoke = read_smoke(frame.path, SmokeFormat())
        random = np.random.default_rng(at if flickers else 0)
        noise = np.float32(factor) * (1 + 0.6 * random.choice([-1.0, 1.0], (64, 64, 64)))
        x, y, z = (slice(low, high) for low, high in zip(*smoke.box, strict=True))
        density = smoke.density * noise[x, y, z].astype(np.float32)
        write_painted(
            folder / frame.path.name,
            frame.path,
            SmokeFormat(),
            density=Field.from_dense(density, smoke.origin),
            colour=np.ones((*smoke.density.shape, 3), np.float32),
            box=smoke.box,
            provenance=Provenance(3.0, 3.0, "z", {}),
        )
    return Contender("made", folder, True)


def test_flicker_costs_coherence_and_nothing_else(
    sequence: FrameSequence, judged: tuple[list[Volume], Bench], tmp_path: Path
) -> None:
    given, tools = judged
    steady = measure(painted(tmp_path / "a", sequence), given, sequence, tools)
    noisy = measure(painted(tmp_path / "b", sequence, flickers=True), given, sequence, tools)
    assert steady.short is not None
    assert noisy.short is not None
    assert noisy.short > 1.1 * steady.short
    assert noisy.long is not None
    for name, value in steady.front.items():
        assert noisy.front[name] == pytest.approx(value, rel=0.35)
    assert steady.moved == pytest.approx(0.6, abs=0.05)
    assert abs(steady.mass) < 0.1
    assert len(steady.film) == FRAMES
    assert steady.film[0].shape == (96, 96)
    assert steady.spread is not None
    assert 0 < steady.spread < 1


def test_mass_that_is_taken_away_is_told(
    sequence: FrameSequence, judged: tuple[list[Volume], Bench], tmp_path: Path
) -> None:
    given, tools = judged
    result = measure(painted(tmp_path, sequence, factor=0.5), given, sequence, tools)
    assert result.mass == pytest.approx(-0.5, abs=0.05)
    text = table([result])
    assert "made" in text
    assert "Mass gained" in text
    assert as_json([result])["made"]["Mass gained"] == result.mass
    film = tmp_path / "made.mp4"
    film.write_bytes(b"film")
    html = report([result], np.ones((8, 8), np.float32), [film], {"title": "A & B"})
    assert "A &amp; B" in html
    assert "data:video/mp4;base64,ZmlsbQ==" in html


def test_a_frame_that_is_missing_is_named(
    sequence: FrameSequence, judged: tuple[list[Volume], Bench], tmp_path: Path
) -> None:
    given, tools = judged
    contender = painted(tmp_path, sequence)
    (tmp_path / sequence[3].path.name).unlink()
    with pytest.raises(SequenceError, match=sequence[3].path.name):
        measure(contender, given, sequence, tools)


@pytest.mark.parametrize(
    ("methods", "words"),
    [
        (("guo",), "`methods` guo: expected vnca, aurand"),
        (("tnst", "tnst"), "each of them once"),
        ((), "at least one"),
    ],
)
def test_unknown_methods_are_refused_by_name(methods: tuple[str, ...], words: str) -> None:
    with pytest.raises(OptionError, match=words):
        CompareRun(sequence="smoke", picture=Path("p.png"), out=Path("out"), methods=methods)
