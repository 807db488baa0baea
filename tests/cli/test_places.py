"""Wherever a file's cells lie, and however they are counted: smoke is where it is in the world."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import as_file, files
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from vnca.core import AnyArray, Index
from vnca.core.lattice import Lattice
from vnca.core.volume import Volume
from vnca.features.vgg import VGG16
from vnca.io import SmokeFormat, read_smoke, smoke_box, write_painted, write_smoke
from vnca.io.picture import fit, read_image
from vnca.io.vdb import Grid, Transform, open_vdb, write_vdb
from vnca.losses.appearance import AppearanceConfig
from vnca.painting import StylizeConfig, stylize
from vnca.recipe import SILENT, Silent
from vnca.recipe.sequence import read_alone
from vnca.rule import Rule, RuleConfig, Scales
from vnca.rule.model import Model
from vnca.training.config import SmokeConfig, ViewConfig
from vnca.training.trainers import smoke_trainer

Vnca = Callable[..., Any]
DATA = Path(__file__).parents[1] / "data"
QUICK = ("--warmup", 4, "--steps-per-frame", 2)
FPS = 20.0
TURNS = [
    np.diag(signs)[list(order)]
    for order in permutations(range(3))
    for signs in product((1, -1), repeat=3)
]
# For each axis of a world with y up, ours.
WORLD = {"z": [0, 1, 2], "y": [1, 2, 0]}
steps = st.tuples(*[st.integers(-40, 40)] * 3)


def written(
    path: Path, smoke: Volume, turn: AnyArray, step: Index, up: str, units: str
) -> SmokeFormat:
    """A file of the same smoke whose cell f is ours `turn @ f + step`, in a world with `up` up.

    Cell by cell, by the definition of a transform. Returns how to read it.
    """
    cells = np.argwhere(smoke.density > 0)
    theirs = (cells + smoke.origin - step) @ turn  # the inverse of a turn is its transpose
    lower = theirs.min(axis=0)
    shape = tuple(theirs.max(axis=0) - lower + 1)
    density, active = np.zeros(shape, np.float32), np.zeros(shape, bool)
    velocity = np.zeros((*shape, 3), np.float32)
    ours, there = tuple(cells.T), tuple((theirs - lower).T)
    density[there], active[there] = smoke.density[ours], True
    assert smoke.velocity is not None
    moving = smoke.velocity[ours]
    if units == "m/s":
        velocity[there] = (moving @ smoke.index_to_world[:3, :3].T * FPS)[:, WORLD[up]]
    else:
        velocity[there] = moving @ turn
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, step
    matrix = smoke.index_to_world @ matrix
    matrix[:3] = matrix[WORLD[up]]
    origin = tuple(lower.tolist())
    grids = [
        Grid.from_dense(name, values, active, origin, transform=Transform.from_matrix(matrix))
        for name, values in (("density", density), ("velocity", velocity))
    ]
    write_vdb(path, grids)
    return SmokeFormat(up_axis=up, velocity_units=units, fps=FPS)  # type: ignore[arg-type]


def colours(path: Path, form: SmokeFormat) -> Mapping[tuple[int, ...], AnyArray]:
    """What a painted file has at each place of our world, in hundredths: density and colour."""
    with open_vdb(path) as file:
        density, colour = (file.grids[name].read() for name in ("density", "Cd"))
        box = density.active_box()
        values, active = density.to_dense(box)
        matrix = density.transform.index_to_world
        assert colour.transform == density.transform
    shown = np.concatenate([values[..., None], colour.to_dense(box)[0]], axis=-1)[active]
    places = (np.argwhere(active) + box.lower) @ matrix[:3, :3].T + matrix[:3, 3]
    if form.up_axis == "y":
        places = places[:, [2, 0, 1]]
    keys = map(tuple, np.rint(100 * places).astype(int).tolist())
    return dict(zip(keys, shown, strict=True))


def rule(position_prior: bool = False) -> Rule:
    config = RuleConfig(channels=5, hidden=8, position_prior=position_prior)
    start = Rule.initial(config, Scales(density=0.9, velocity=0.4), seed=3)
    output = np.random.default_rng(4).normal(0, 0.02, start.output.shape).astype(np.float32)
    return dataclasses.replace(start, output=output)


def paint(source: Path, form: SmokeFormat, target: Path) -> None:
    """A frame as a sequence, painted as `vnca stylize` does."""
    smoke = read_alone(source, form, SILENT)
    config = StylizeConfig(warmup=6, steps_per_frame=2)
    (painting,) = stylize([smoke], rule(), config, box=smoke.box)
    lattice = Lattice(smoke.index_to_world)
    write_painted(
        target,
        source,
        form,
        density=painting.density,
        colour=painting.colour,
        box=smoke.box,
        lattice=lattice,
    )


@settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.sampled_from(TURNS), steps, st.sampled_from("zy"), st.sampled_from(["m/s", "cells/frame"])
)
def test_smoke_is_read_and_painted_alike_however_its_cells_are_counted(
    tiny_smoke: Volume, tmp_path: Path, turn: AnyArray, step: Index, up: str, units: str
) -> None:
    plain = written(tmp_path / "plain.vdb", tiny_smoke, np.eye(3, dtype=int), (0, 0, 0), "z", units)
    form = written(tmp_path / "other.vdb", tiny_smoke, turn, step, up, units)
    expected, got = (
        read_alone(tmp_path / name, f, SILENT)
        for name, f in (("plain.vdb", plain), ("other.vdb", form))
    )
    np.testing.assert_array_equal(got.density, expected.density)
    np.testing.assert_allclose(got.velocity, expected.velocity, rtol=1e-5, atol=1e-6)  # type: ignore[arg-type]
    np.testing.assert_allclose(got.index_to_world, expected.index_to_world, atol=1e-9)
    lattice = Lattice(expected.index_to_world)
    assert got.box == expected.box == smoke_box(tmp_path / "other.vdb", form, lattice=lattice)
    seen = []
    for name, f in (("plain.vdb", plain), ("other.vdb", form)):
        paint(tmp_path / name, f, tmp_path / "painted.vdb")
        seen.append(colours(tmp_path / "painted.vdb", f))
    assert seen[0].keys() == seen[1].keys()
    pairs = np.array([(seen[0][place], seen[1][place]) for place in seen[0]])
    assert pairs[:, 0].std(axis=0).min() > 1e-3
    np.testing.assert_allclose(pairs[:, 1], pairs[:, 0], atol=2e-4)


class Notes(Silent):
    """A watch that keeps what it is told."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def note(self, line: str) -> None:
        self.lines.append(line)


def test_a_rule_learns_the_same_however_cells_are_counted(
    tiny_smoke: Volume, tmp_path: Path
) -> None:
    """Takes a training of two iterations an example, and the network that judges them: seconds."""
    config = SmokeConfig(
        rule=RuleConfig(channels=5, hidden=8),
        view=ViewConfig(size=32),
        appearance=AppearanceConfig(samples=64, layers=("relu1_1", "relu2_1")),
        iterations=2,
        rate_warmup=0,
        shortest_rollout=2,
        longest_rollout=3,
    )
    with as_file(files("vnca.data") / "vangogh_cafe_terrace.webp") as path:
        style = fit(read_image(path), 40, 40)
    vgg, watch = VGG16.load("edges"), Notes()
    # Thicker to the right and with a corner cut off, so that no turn leaves it as it is.
    density = tiny_smoke.density * np.linspace(0.5, 1, 12, dtype=np.float32)[:, None, None]
    density[:6, 6:, :6] = 0
    lopsided = dataclasses.replace(tiny_smoke, density=density)

    def learnt(name: str, scale: float, *how: Any) -> Rule:
        sized = np.diag([scale, scale, scale, 1.0]) @ tiny_smoke.index_to_world
        path = tmp_path / name
        form = written(path, dataclasses.replace(lopsided, index_to_world=sized), *how)
        trainer = smoke_trainer(read_alone(path, form, watch), style, config, vgg)
        assert len(list(trainer.run())) == 2
        assert not watch.lines  # Nothing is resampled.
        return trainer.rule()

    ours = learnt("plain.vdb", 1.0, np.eye(3, dtype=int), (0, 0, 0), "z", "cells/frame")
    assert np.abs(ours.output).max() > 1e-4
    assert ours.place is not None

    @settings(max_examples=8, deadline=None)
    @given(
        st.sampled_from(TURNS), steps, st.floats(0.01, 100), st.sampled_from("zy"),
        st.sampled_from(["m/s", "cells/frame"]),
    )  # fmt: skip
    @example(TURNS[1], (9, -30, 4), 0.1, "z", "m/s")
    @example(TURNS[11], (3, 2, 1), 3.0, "y", "m/s")
    def alike(turn: AnyArray, step: Index, scale: float, up: str, units: str) -> None:
        other = learnt("other.vdb", scale, turn, step, up, units)
        for weights in ("hidden", "bias", "output"):
            np.testing.assert_allclose(getattr(other, weights), getattr(ours, weights), atol=1e-5)
        assert other.place is not None
        assert ours.place is not None
        assert other.place.box == ours.place.box

    alike()


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


def test_standing_smoke_is_painted_alike_while_its_grid_moves(
    vnca: Vnca, model: Path, tmp_path: Path
) -> None:
    seen: dict[str, list[Any]] = {"standing": [], "standing_moved": []}
    for name, frames in seen.items():
        film = tmp_path / f"{name}.gif"
        size = ("--preview", film, "--rows", 32, "--columns", 32)
        done = vnca("stylize", model, DATA / name, "--out", tmp_path / name, *QUICK, *size)
        assert done.code == 0, done.err
        assert "resampled" not in done.err
        frames += [colours(tmp_path / name / f"s_{n:04d}.vdb", SmokeFormat()) for n in (1, 2, 3)]
        frames.append(film.read_bytes())
    assert seen["standing"][3] == seen["standing_moved"][3]
    for still, moved in zip(seen["standing"][:3], seen["standing_moved"][:3], strict=True):
        assert still.keys() == moved.keys()
        for place, shown in still.items():
            np.testing.assert_array_equal(moved[place], shown)
    # A part of a sequence is painted in the same place, wherever its first frame's grid begins.
    for name in seen:
        part = tmp_path / f"{name}_part"
        options = ("--frames", "2-3", "--out", part)
        assert vnca("stylize", model, DATA / name, *options, *QUICK).code == 0
        seen[name] = [colours(part / "s_0002.vdb", SmokeFormat())]
    (still,), (moved,) = seen.values()
    assert all((moved[place] == shown).all() for place, shown in still.items())


def laid(path: Path, smoke: Volume, matrix: AnyArray) -> None:
    """The density of `smoke` interpolated to cells of another transform, written there."""
    inverse = np.linalg.inv(matrix)
    ends = np.array(list(product(*zip(*smoke.box, strict=True)))) - 0.5
    corners = ends @ smoke.index_to_world[:3, :3].T + smoke.index_to_world[:3, 3]
    corners = corners @ inverse[:3, :3].T + inverse[:3, 3]
    lower = np.floor(corners.min(axis=0)).astype(int)
    shape = tuple(np.ceil(corners.max(axis=0)).astype(int) - lower + 1)
    cells = np.moveaxis(np.indices(shape), 0, -1) + lower
    at = cells @ matrix[:3, :3].T + matrix[:3, 3] - smoke.index_to_world[:3, 3]
    at = at @ np.linalg.inv(smoke.index_to_world[:3, :3]).T
    # A ball that fades from its centre: no interpolation needed to know it anywhere.
    centre = np.mean(smoke.box, axis=0) - 0.5
    values = np.clip(5.5 - np.linalg.norm(at - centre, axis=-1), 0, 1).astype(np.float32)
    smoke = Volume(values, None, tuple(lower.tolist()), matrix, 1)  # type: ignore[arg-type]
    write_smoke(path, smoke)


def scaled(*sides: float, degrees: float = 0.0, by: Sequence[float] = (0, 0, 0)) -> AnyArray:
    angle, result = np.radians(degrees), np.diag([*sides, 1.0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    result[:2, :2] = turn @ result[:2, :2]
    result[:3, 3] = by
    return result


@pytest.mark.parametrize(
    "other",
    [
        scaled(0.05, 0.05, 0.05),
        scaled(0.15, 0.15, 0.15),
        scaled(0.1, 0.1, 0.1, degrees=30),
        scaled(0.1, 0.1, 0.1, by=(0.04, 0, 0)),
    ],
    ids=["finer", "coarser", "turned", "shifted"],
)
def test_a_frame_with_other_voxels_goes_on_with_the_painting_there_and_that_is_told(
    vnca: Vnca, model: Path, tiny_smoke: Volume, tmp_path: Path, out: Path, other: AnyArray
) -> None:
    folder = tmp_path / "mixed"
    plain = scaled(0.1, 0.1, 0.1)
    for number, matrix in enumerate((plain, other, plain, other), 1):
        laid(folder / f"s_{number}.vdb", tiny_smoke, matrix)
    done = vnca("stylize", model, folder, "--out", out, "--warmup", 40, "--steps-per-frame", 1)
    assert done.code == 0, done.err
    (told,) = (line for line in done.err.splitlines() if "resampled" in line)
    assert "s_2.vdb: its voxels, " in told
    assert "cubes of 0.1; its smoke is resampled to those, as is that of 1 more" in told
    for number in (1, 2, 3, 4):
        name = f"s_{number}.vdb"
        with open_vdb(folder / name) as before, open_vdb(out / name) as after:
            was, is_now, colour = (
                f.grids[n].read()
                for f, n in ((before, "density"), (after, "density"), (after, "Cd"))
            )
            assert is_now.transform == colour.transform == was.transform
            box = was.active_box()
            (old, active), (new, still) = was.to_dense(box), is_now.to_dense(box)
        np.testing.assert_array_equal(still, active)
        ratio = new[active] / old[active]
        assert ratio.min() > 0.499
        assert ratio.max() < 1.501
        assert ratio.std() > 0.01
    # At the same place of the world colours are alike from frame to frame, and not elsewhere.
    shown = [at_centres(out / f"s_{n}.vdb", tiny_smoke) for n in (1, 2, 3)]
    assert min(similarity(shown[1], shown[n]) for n in (0, 2)) > 0.25
    assert similarity(shown[1], shown[0][::-1]) < 0.1


def similarity(one: AnyArray, other: AnyArray) -> float:
    """Correlation of how colours `[n, 3]` differ from their mean."""
    one, other = (colour - colour.mean(axis=0) for colour in (one, other))
    return float((one * other).sum() / np.sqrt((one**2).sum() * (other**2).sum()))


def at_centres(path: Path, smoke: Volume) -> AnyArray:
    """Colours `[n, 3]` of the cells of a painted file that hold centres of dense cells of smoke."""
    cells = np.argwhere(smoke.density == 1) + smoke.origin
    places = cells @ smoke.index_to_world[:3, :3].T + smoke.index_to_world[:3, 3]
    with open_vdb(path) as file:
        grid = file.grids["Cd"].read()
    inverse = np.linalg.inv(grid.transform.index_to_world)
    box = grid.active_box()
    at = np.rint(places @ inverse[:3, :3].T + inverse[:3, 3]).astype(int) - box.lower
    return grid.to_dense(box)[0][tuple(at.T)]


def test_uneven_voxels_are_trained_and_painted_as_cubes_and_keep_their_file(
    vnca: Vnca, tiny: list[str], tiny_smoke: Volume, style: Path, tmp_path: Path, out: Path
) -> None:
    flat, run = tmp_path / "flat" / "s_1.vdb", tmp_path / "run"
    laid(flat, tiny_smoke, scaled(0.1, 0.1, 0.4))
    done = vnca("train", flat, style, "--out", run, *tiny)
    assert done.code == 0, done.err
    words = f"{flat}: its voxels, 0.1 × 0.1 × 0.4, are not the cells of the sequence's lattice"
    assert words in done.err
    rule = Model.load(run).rule
    assert rule.place is not None
    np.testing.assert_allclose(rule.place.lattice.to_world, scaled(0.1, 0.1, 0.1), atol=1e-12)
    assert np.ptp(rule.place.box.shape) <= 5  # a ball, not a disc
    done = vnca("stylize", run, flat, "--out", out, *QUICK, "--refine", 2)
    assert done.code == 0, done.err
    assert words in done.err
    with open_vdb(out / "s_1.vdb") as file:
        density = file.grids["density"].read()
        np.testing.assert_allclose(density.transform.voxel_size, (0.05, 0.05, 0.2))
        values = density.to_dense(density.active_box())[0]
    before = read_smoke(flat, SmokeFormat()).refined(2)
    assert values.sum() == pytest.approx(before.density.sum(), rel=0.2)
    with open_vdb(flat) as old, open_vdb(out / "s_1.vdb") as new:
        assert new.grids["Cd"].transform == density.transform
        assert old.names == ("density",)


def test_sheared_voxels_are_refused_in_one_line_or_left_out(
    vnca: Vnca, model: Path, style: Path, tiny_smoke: Volume, smoke: Path, out: Path
) -> None:
    sheared = smoke / "ball_0002.vdb"
    matrix = scaled(0.1, 0.1, 0.1)
    matrix[0, 1] = 0.03
    write_smoke(sheared, dataclasses.replace(tiny_smoke, index_to_world=matrix))
    words = f"{sheared}: grid 'density': its voxels are sheared (their sides meet at 73, 90, 90 deg"
    assert words in vnca("stylize", model, smoke, "--out", out).complaint
    assert not out.exists()
    assert words in vnca("train", sheared, style, "--out", out / "run").complaint
    done = vnca("stylize", model, smoke, "--out", out, *QUICK, "--on-error", "skip")
    assert done.code == 0
    assert words in done.err
    assert sorted(path.name for path in out.iterdir()) == ["ball_0001.vdb", "ball_0003.vdb"]


def test_flat_voxels_that_take_too_many_cubes_are_refused(
    vnca: Vnca, model: Path, tiny_smoke: Volume, tmp_path: Path, out: Path
) -> None:
    path = tmp_path / "s_1.vdb"
    needles = np.diag([0.0001, 0.0001, 100.0, 1.0])
    write_smoke(path, dataclasses.replace(tiny_smoke, index_to_world=needles))
    outcome = vnca("stylize", model, path, "--out", out)
    told, complaint = outcome.err.splitlines()
    assert outcome.code == 2
    assert "its smoke is resampled" in told
    assert f"{path}: grid 'density': takes " in complaint
    assert "cubic cells as small as the shortest side of the sequence's voxels" in complaint


def test_a_rule_with_positions_paints_elsewhere_with_those_of_the_sequence_and_says_so(
    vnca: Vnca, tiny: list[str], style: Path, smoke: Path, tiny_smoke: Volume, tmp_path: Path
) -> None:
    run, far = tmp_path / "run", tmp_path / "far"
    frame = smoke / "ball_0002.vdb"
    done = vnca("train", frame, style, "--out", run, *tiny, "--position-prior")
    assert done.code == 0, done.err
    x, y, z = tiny_smoke.origin
    write_smoke(far / "s_1.vdb", dataclasses.replace(tiny_smoke, origin=(x + 900, y, z)))
    for sequence, is_told in ((smoke, False), (far, True)):
        done = vnca("stylize", run, sequence, "--out", tmp_path / sequence.name / "out", *QUICK)
        assert done.code == 0, done.err
        assert ("apart from where the rule was trained" in done.err) is is_told
