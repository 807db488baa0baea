"""Whatever can be written comes back: any grids, types, packings, transforms and metadata."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.core import AnyArray
from vnca.io.vdb import VALUE_TYPES, Grid, Metadata, Tiles, Transform, Tree, open_vdb, write_vdb
from vnca.io.vdb.layout import LEAF_CELLS, LEAF_EDGE, LOWER_EDGE, UPPER_EDGE, ValueType
from vnca.io.vdb.metadata import STATISTICS

Draw = Callable[..., Any]

COMPUTED = {*STATISTICS, "name", "is_saved_as_half_float"}
NODES = 2**31 // UPPER_EDGE  # of the root, from the middle to the end of the index range

texts = st.text(max_size=12)  # hypothesis leaves out surrogates, which no file can hold
names = texts.filter(lambda name: "\x1e" not in name)
whole = st.integers(-(2**63), 2**63 - 1)
vectors = st.integers(2, 4).flatmap(
    lambda n: (
        st.tuples(*[st.integers(-(2**31), 2**31 - 1)] * n) | st.tuples(*[st.floats(width=64)] * n)
    )
)
metadata = st.dictionaries(
    texts.filter(lambda name: name not in COMPUTED),
    texts | st.booleans() | whole | st.floats() | vectors,
    max_size=4,
)
sizes = st.floats(1e-6, 1e6) | st.floats(-1e6, -1e-6)
places = st.floats(-1e6, 1e6)


@st.composite
def transforms(draw: Draw) -> Transform:
    matrix = np.diag(
        [*draw(st.one_of(st.tuples(sizes, sizes, sizes), sizes.map(lambda s: [s] * 3))), 1]
    )
    if draw(st.booleans()):
        matrix[:3, 3] = draw(st.tuples(places, places, places))
    if draw(st.booleans()):  # sheared, and still invertible
        matrix[0, 1:3] = draw(st.tuples(places, places))
    return Transform.from_matrix(matrix)


def values_of(kind: ValueType, count: int, half: bool, random: np.random.Generator) -> AnyArray:
    """`[count]`, or `[count, 3]`, with all there is of numbers, of those that half floats have."""
    shape = (count, 3)[: 1 + (kind.components == 3)]
    if kind.dtype.kind != "f":
        raw = random.integers(0, 256, (*shape, kind.dtype.itemsize), np.uint8)
        return (raw % 2 == 1 if kind.name == "bool" else raw.view(kind.dtype))[..., 0]
    special = np.array([0, -0.0, np.inf, -np.inf, np.nan, 1e-7], np.float16)
    halves = random.integers(0, 2**16, shape, np.uint16).view(np.float16)
    values = np.where(random.random(shape) < 0.2, random.choice(special, shape), halves)
    values[np.isnan(values)] = np.nan  # conversion may change which one it is
    if half or kind.name == "half":
        return values.astype(kind.dtype)
    with np.errstate(all="ignore"):
        return (values.astype(kind.dtype) * random.choice([1, np.pi, 1e30], shape)).astype(
            kind.dtype
        )


@st.composite
def trees(draw: Draw, kind: ValueType, half: bool) -> Tree:
    """Leaves and tiles of every level anywhere in the index range, none upon another."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    leaves, tiles = [], []
    for node in draw(st.sets(st.tuples(*[st.integers(-NODES, NODES - 1)] * 3), max_size=2)):
        upper = np.array(node, np.int64) * UPPER_EDGE
        if draw(st.booleans()):
            tiles.append((upper, UPPER_EDGE))
            continue
        for slot in draw(st.sets(st.integers(0, 32**3 - 1), max_size=3)):
            lower = upper + np.array(np.unravel_index(slot, (32,) * 3)) * LOWER_EDGE
            if draw(st.booleans()):
                tiles.append((lower, LOWER_EDGE))
                continue
            for place in draw(st.sets(st.integers(0, 16**3 - 1), max_size=4)):
                origin = lower + np.array(np.unravel_index(place, (16,) * 3)) * LEAF_EDGE
                if draw(st.booleans()):
                    tiles.append((origin, LEAF_EDGE))
                else:
                    leaves.append(origin)
    shares = draw(st.sampled_from([0, 0.1, 0.5, 1]))
    background = values_of(kind, 1, half, random)[0]
    active = random.random((len(leaves), LEAF_CELLS)) < shares
    values = values_of(kind, active.size, half, random)
    values = values.reshape(*active.shape, *values.shape[1:])
    if draw(st.booleans()):
        values[~active] = background
    return Tree(
        np.asarray(background),
        np.array(leaves, np.int32).reshape(-1, 3),
        active,
        values,
        Tiles(
            np.array([origin for origin, _ in tiles], np.int32).reshape(-1, 3),
            np.array([edge for _, edge in tiles], np.int32),
            values_of(kind, len(tiles), half, random),
            random.random(len(tiles)) < 0.5,
        ),
    )


@st.composite
def grids(draw: Draw) -> Grid:
    kind, half = VALUE_TYPES[draw(st.sampled_from(list(VALUE_TYPES)))], draw(st.booleans())
    tree = draw(trees(kind, half))
    entries = Metadata.of(draw(metadata))
    return Grid(draw(names), kind.name, draw(transforms()), tree, entries, half)


def cells(tree: Tree) -> dict[tuple[int, ...], tuple[AnyArray, AnyArray]]:
    """Values and active cells of leaves and tiles by place; tiles that say nothing are left out."""
    found = {}
    for origin, values, active in zip(
        tree.leaf_origins.tolist(), tree.leaf_values, tree.leaf_active, strict=True
    ):
        found[(*origin, 0)] = values, active
    for origin, edge, values, active in zip(
        tree.tiles.origins.tolist(), tree.tiles.edges.tolist(), *tree.tiles[2:], strict=True
    ):
        if active or not np.array_equal(values, tree.background, equal_nan=True):
            found[(*origin, edge)] = values[None], np.array([active])
    return found


def assert_same(got: Tree, expected: Tree) -> None:
    assert got.background.tobytes() == expected.background.tobytes()
    ours, theirs = cells(got), cells(expected)
    assert ours.keys() == theirs.keys()
    for place, (values, active) in theirs.items():
        np.testing.assert_array_equal(ours[place][1], active)
        assert ours[place][0][active].tobytes() == values[active].tobytes()
        # Of inactive zeros the sign may get lost.
        np.testing.assert_array_equal(ours[place][0], values)


@settings(deadline=None, max_examples=40)
@given(st.lists(grids(), max_size=2), metadata, st.sampled_from(["none", "zip", "blosc"]))
def test_any_grids_come_back_as_they_were(
    tmp_path_factory: pytest.TempPathFactory,
    written: list[Grid],
    about: dict[str, Any],
    compression: str,
) -> None:
    path: Path = tmp_path_factory.getbasetemp() / "round_trip.vdb"
    write_vdb(path, written, about, compression)
    with open_vdb(path) as file:
        assert file.metadata == Metadata.of(about)
        read = [header.read() for header in file.grids.values()]
        for header, grid in zip(file.grids.values(), read, strict=True):
            assert header.box == grid.active_box()
    for got, expected in zip(read, written, strict=True):
        assert (got.name, got.value_type, got.is_half) == (
            expected.name, expected.value_type, expected.is_half,
        )  # fmt: skip
        assert got.transform.map_type == expected.transform.map_type
        numbers = (
            struct.pack(f"{len(t.numbers)}d", *t.numbers)
            for t in (got.transform, expected.transform)
        )
        assert len(set(numbers)) == 1
        assert {n: e for n, e in got.metadata.items() if n not in COMPUTED} == expected.metadata
        assert_same(got.tree, expected.tree)
