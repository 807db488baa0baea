"""Painted files: as they were while smoke was kept in arrays, and at the cost of the smoke."""

import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import numpy as np
import pytest

from vnca.core import Box
from vnca.core.field import Field
from vnca.core.lattice import Lattice
from vnca.core.volume import Volume
from vnca.engine import Compute
from vnca.io import SmokeFormat, read_smoke, write_painted, write_smoke
from vnca.io.sequence import find_frames
from vnca.io.smoke_format import on_lattice
from vnca.io.vdb import open_vdb
from vnca.painting import Painting, Roll, StylizeConfig
from vnca.recipe import SILENT
from vnca.recipe.painting import StylizeRun, run
from vnca.rule import Rule
from vnca.rule.model import Model

KEPT = Path(__file__).parents[1] / "data" / "painting"
PLAIN = SmokeFormat()


def painted(frames: list[Path], rule: Rule, out: Path, box: Box) -> Iterator[Painting]:
    roll = Roll(rule, StylizeConfig(warmup=4), box, Compute("numpy"))
    state = roll.start()
    for path in frames:
        painting = roll.paint(read_smoke(path, PLAIN), state)
        state = painting.state
        write_painted(
            out / path.name,
            path,
            PLAIN,
            density=painting.density_field,
            colour=painting.colour_field,
            box=painting.smoke.box,
        )
        yield painting


def test_a_model_paints_as_it_did(tmp_path: Path) -> None:
    """To the bit on one machine; other processors round sums of products otherwise."""
    frames = [frame.path for frame in find_frames(KEPT / "plume_%04d.vdb")]
    smoke = [read_smoke(path, PLAIN) for path in frames]
    box = smoke[0].box.union(smoke[1].box)
    rule = Model.load(KEPT / "rule.safetensors").rule
    for path, _ in zip(frames, painted(frames, rule, tmp_path, box), strict=True):
        kept = KEPT / path.name.replace("plume", "painted")
        with open_vdb(kept) as before, open_vdb(tmp_path / path.name) as after:
            assert after.names == before.names == ("density", "velocity", "Cd")
            for name in before.names:
                was, now = before.read(name), after.read(name)
                box = was.active_box()
                values, active = was.to_dense(box)
                repeated, are_active = now.to_dense(box)
                # Colours go on for a cell since.
                assert now.active_box() == box.grown(name == "Cd")
                assert now.transform == was.transform
                np.testing.assert_array_equal(are_active[active], True)
                np.testing.assert_allclose(repeated[active], values[active], atol=1e-5)


@pytest.fixture
def plume() -> Volume:
    return read_smoke(KEPT / "plume_0007.vdb", PLAIN)


def twice(plume: Volume, apart: int) -> Volume:
    """The plume, and again so many cells away along each axis."""
    assert plume.velocity_field is not None
    both = []
    for field in (plume.density_field, plume.velocity_field):
        there = field.moved((apart, apart, apart))
        both.append(
            Field(
                np.concatenate([field.bricks, there.bricks]),
                np.concatenate([field.values, there.values]),
                field.box.union(there.box),
            ).in_order()
        )
    return Volume.of_fields(both[0], both[1], plume.index_to_world, plume.frame)


def test_two_plumes_cost_what_two_plumes_cost_however_far_apart(
    plume: Volume, tmp_path: Path
) -> None:
    rule = Model.load(KEPT / "rule.safetensors").rule
    # In a larger box, the velocity that cells are told goes on a little farther.
    rule = replace(rule, config=replace(rule.config, velocity_prior=False))
    peaks = []
    for apart in (48, 2000):
        path = tmp_path / f"{apart}.vdb"
        smoke = twice(plume, apart)
        write_smoke(path, smoke)
        tracemalloc.start()
        (painting,) = painted([path], rule, tmp_path / "out", smoke.box)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        # Each as if it were alone.
        alone = tmp_path / "alone.vdb"
        for place in (0, apart):
            write_smoke(alone, replace(plume, origin=tuple(np.add(plume.origin, place).tolist())))
            (expected,) = painted([alone], rule, tmp_path / "out", smoke.box)
            for ours, theirs in (
                (painting.colour_field, expected.colour),
                (painting.density_field, expected.density),
            ):
                np.testing.assert_allclose(ours.dense(expected.smoke.box), theirs, atol=1e-6)
    assert peaks[1] < 1.1 * peaks[0]


def test_a_far_pair_is_resampled_and_refined_at_its_own_cost(plume: Volume) -> None:
    turned = Lattice(plume.index_to_world @ np.diag([1.25, 1.25, 1.25, 1.0]))
    peaks = []
    for apart in (48, 2000):
        smoke = twice(plume, apart)
        tracemalloc.start()
        coarser = on_lattice(smoke, turned, "the pair").refined(2)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        mass = coarser.density_field.values.sum() * (1.25 / 2) ** 3
        assert mass == pytest.approx(2 * plume.density.sum(), rel=0.02)
    assert peaks[1] < 1.1 * peaks[0]


def test_a_source_is_opened_once_while_it_is_painted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With `hold` it stays open for longer, and is closed all the same."""
    opened: list[str] = []
    files: list[IO[Any]] = []
    real = Path.open

    def counted(self: Path, *arguments: Any, **keywords: Any) -> IO[Any]:
        file = real(self, *arguments, **keywords)
        if self.parent == KEPT and self.suffix == ".vdb":
            opened.append(self.name)
            files.append(file)
        return file

    for on_error in ("stop", "hold"):
        options = StylizeRun(
            model=KEPT / "rule.safetensors",
            sequence=str(KEPT / "plume_%04d.vdb"),
            out=tmp_path / on_error,
            on_error=on_error,
            config=StylizeConfig(warmup=2, steps_per_frame=2),
        )
        painting = run(options, SILENT)  # looks at all frames before the first is painted
        with monkeypatch.context() as patch:
            patch.setattr(Path, "open", counted)
            written = list(painting)
        assert sorted(opened) == sorted(frame.name for frame in KEPT.glob("plume_*.vdb"))
        assert len(written) == len(opened) > 1
        assert all(file.closed for file in files)
        opened.clear()
