"""Files whose grids do not say, or say wrongly, where they begin and end."""

import struct
import time
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core.errors import FileFormatError, GridError
from vnca.io.vdb import VALUE_TYPES, Grid, open_vdb, write_vdb
from vnca.io.vdb.layout import Cursor
from vnca.io.vdb.metadata import read_metadata

Builder = Callable[..., Grid]
Offsets = tuple[int, int, int]
Judge = Callable[[list[Path]], list[list[dict[str, Any]]]]
Agreement = Callable[[Grid, dict[str, Any]], None]

HAS_OFFSETS_AT, BEHIND_IDENTIFIER = 20, 57
DATA = Path(__file__).parents[2] / "data"
HERE = [DATA / "no_offsets.vdb", DATA / "half_offsets.vdb"]


def with_offsets(
    data: bytes, changed: Callable[[Offsets, bool], Offsets], *, claims: bool = True
) -> bytes:
    """A file with other offsets; `changed` is given those of a grid, and whether it is the last.

    Args:
        data: A file with true ones.
        changed: Gives the new ones.
        claims: Whether the file claims to have offsets.
    """
    cursor = Cursor(BytesIO(data), 0, len(data), "test")
    cursor.take(BEHIND_IDENTIFIER)
    read_metadata(cursor)
    content = bytearray(data)
    content[HAS_OFFSETS_AT] = claims
    count = cursor.unpack("I")
    for number in range(count):
        for _ in range(3):
            cursor.string()
        at = cursor.position
        offsets = cursor.unpack("3q")
        struct.pack_into("<3q", content, at, *changed(offsets, number == count - 1))
        cursor.seek(offsets[2])
    return bytes(content)


def streamed(data: bytes) -> bytes:
    return with_offsets(data, lambda offsets, is_last: (0, 0, 0), claims=False)


# What writers leave behind; OpenVDB reads all of these.
KINDS: dict[str, Callable[[bytes], bytes]] = {
    "streamed": streamed,
    "stale": lambda data: with_offsets(data, lambda o, last: (o[2], 7, -1), claims=False),
    "leaves where the grid is": lambda data: with_offsets(data, lambda o, last: (o[0], o[0], o[2])),
    "leaves nowhere": lambda data: with_offsets(data, lambda o, last: (o[0], 0, o[2])),
    "last without an end": lambda data: with_offsets(
        data, lambda o, last: (o[0], o[1], 0 if last else o[2])
    ),
    "last ends early": lambda data: with_offsets(
        data, lambda o, last: (o[0], o[1], o[1] if last else o[2])
    ),
    "last ends beyond": lambda data: with_offsets(
        data, lambda o, last: (o[0], o[1], o[2] + 1000 * last)
    ),
    "more behind": lambda data: data + b"more" * 50,
    "streamed, more behind": lambda data: streamed(data) + b"more" * 50,
}
# Those that OpenVDB has no need to read, and only the order of the grids tells.
EMPTY = {"empty": lambda data: with_offsets(data, lambda o, last: (0, 0, 0))}


@pytest.fixture
def all_types(tiled_grid: Builder, random_grid: Builder, tmp_path: Path) -> list[Path]:
    """Files of grids of every type, one a packing."""
    grids = [
        *(tiled_grid(name) for name in VALUE_TYPES),
        random_grid("float", name="halves", half=True, background=2),
        random_grid("vec3s", name="half vectors", half=True),
    ]
    paths = []
    for packing in ("none", "zip", "blosc"):
        paths.append(tmp_path / f"{packing}.vdb")
        write_vdb(paths[-1], grids, {"title": packing}, packing)
    return paths


@pytest.mark.parametrize("kind", KINDS | EMPTY)
def test_whatever_offsets_say_grids_read_and_copy_the_same(
    kind: str, all_types: list[Path], tmp_path: Path
) -> None:
    other, copy = tmp_path / "other.vdb", tmp_path / "copy.vdb"
    for path in all_types:
        other.write_bytes((KINDS | EMPTY)[kind](path.read_bytes()))
        with open_vdb(path) as file, open_vdb(other) as changed:
            assert changed.names == file.names
            assert changed.metadata == file.metadata
            for name, header in changed.grids.items():
                assert header.is_readable
                for ours, theirs in zip(header.read().tree, file.read(name).tree, strict=True):
                    np.testing.assert_equal(ours, theirs)
            write_vdb(copy, list(changed.grids.values()), changed.metadata)
        assert copy.read_bytes() == path.read_bytes()


def test_openvdb_reads_such_files_alike(
    written_by_openvdb: Path, judge: Judge, assert_agrees: Agreement, tmp_path: Path
) -> None:
    paths = []
    for kind, change in KINDS.items():
        for name in ("half_Vec3SGrid", "bool", "several"):
            paths.append(tmp_path / f"{name}, {kind}.vdb")
            paths[-1].write_bytes(change((written_by_openvdb / f"{name}.vdb").read_bytes()))
    for path, judged in zip(paths, judge(paths), strict=True):
        with open_vdb(path) as file:
            headers = sorted(file.grids.values(), key=lambda header: header.grid_name)
            # Of a stream OpenVDB gives the grids in the file's order, else by name.
            judged.sort(key=lambda grid: grid["name"])
            for header, expected in zip(headers, judged, strict=True):
                assert_agrees(header.read(), expected)


def test_grids_that_share_a_tree_are_copied_alike_whatever_offsets_say(
    written_by_openvdb: Path, tmp_path: Path
) -> None:
    original, other = written_by_openvdb / "several.vdb", tmp_path / "other.vdb"
    copies = set()
    for change in (bytes, *KINDS.values()):
        other.write_bytes(change(original.read_bytes()))
        with open_vdb(other) as file:
            write_vdb(tmp_path / "copy.vdb", list(file.grids.values()), file.metadata)
        copies.add((tmp_path / "copy.vdb").read_bytes())
    assert len(copies) == 1


def test_files_of_other_writers_read_and_copy_as_in_openvdb(
    judge: Judge, assert_agrees: Agreement, tmp_path: Path
) -> None:
    copies = [tmp_path / path.name for path in HERE]
    for path, copy in zip(HERE, copies, strict=True):
        with open_vdb(path) as file:
            write_vdb(copy, list(file.grids.values()), file.metadata)
    for path, (judged,) in zip([*HERE, *copies], judge([*HERE, *copies]), strict=True):
        with open_vdb(path) as file:
            assert_agrees(file.read("density"), judged)


def test_a_frustum_in_a_stream_is_stepped_over_and_copied(
    written_by_openvdb: Path, judge: Judge, tmp_path: Path
) -> None:
    stream, copy = tmp_path / "stream.vdb", tmp_path / "copy.vdb"
    stream.write_bytes(streamed((written_by_openvdb / "frustum.vdb").read_bytes()))
    with open_vdb(stream) as file:
        assert [header.is_readable for header in file.grids.values()] == [False, True]
        assert file.read("density").active_voxels > 0
        with pytest.raises(GridError, match="'frustum' has a NonlinearFrustumMap"):
            file.read("frustum")
        write_vdb(copy, list(file.grids.values()), file.metadata)
    for old, new in zip(*judge([written_by_openvdb / "frustum.vdb", copy]), strict=True):
        np.testing.assert_array_equal(old["values"], new["values"])
        assert old["matrix"] == new["matrix"]


@pytest.mark.parametrize("unknown", [b"Tree_quats_5_4_3", b"Tree_float_4_4_3"])
@pytest.mark.parametrize("is_last", [True, False])
def test_behind_an_unknown_kind_in_a_stream_nothing_is_found_and_nothing_is_lost(
    unknown: bytes, is_last: bool, random_grid: Builder, tmp_path: Path
) -> None:
    names = ["density", "odd", "heat", "dust"] if not is_last else ["density", "heat", "odd"]
    grids = [random_grid("float", name=name) for name in names if name != "odd"]
    odd = random_grid("double", name="odd")
    grids.insert(names.index("odd"), odd)
    path, copy = tmp_path / "a.vdb", tmp_path / "copy.vdb"
    write_vdb(path, grids)
    data = path.read_bytes().replace(b"Tree_double_5_4_3", unknown + b"!")
    path.write_bytes(streamed(data))
    with open_vdb(path) as file:
        density = file.read("density")
        box = density.active_box()
        for ours, theirs in zip(density.to_dense(box), grids[0].to_dense(box), strict=True):
            np.testing.assert_array_equal(ours, theirs)
        with pytest.raises(FileFormatError, match="cannot read values of type"):
            file.read("odd")
        if is_last:
            assert (file.names, file.unfound) == (("density", "heat", "odd"), 0)
            write_vdb(copy, list(file.grids.values()))
            # All but the byte where its leaves' values begin, of which OpenVDB makes no use.
            whole = with_offsets(data, lambda o, last: (o[0], o[2] if last else o[1], o[2]))
            assert copy.read_bytes()[BEHIND_IDENTIFIER:] == whole[BEHIND_IDENTIFIER:]
        else:
            assert (file.names, file.unfound) == (("density", "odd"), 2)
            with pytest.raises(GridError, match=r"no grid 'heat'.*2 more that cannot be found"):
                file.read("heat")
            with pytest.raises(GridError, match=r"a\.vdb: grid 'odd' .*without offsets.*again"):
                write_vdb(copy, list(file.grids.values()))
            assert not copy.exists()


def test_an_unknown_kind_that_was_cut_off_is_not_copied_as_if_it_were_whole(
    random_grid: Builder, tmp_path: Path
) -> None:
    path = tmp_path / "a.vdb"
    write_vdb(path, [random_grid("float")])
    data = path.read_bytes().replace(b"Tree_float_5_4_3", b"Tree_quats_5_4_3")
    path.write_bytes(data[:-100])
    with pytest.raises(FileFormatError, match=r"truncated or corrupt: grid 'float' claims bytes"):
        open_vdb(path)


def test_an_end_that_other_grids_rely_on_must_be_that_of_the_tree(
    random_grid: Builder, tmp_path: Path
) -> None:
    """The next grid is where the one before says: bytes between the two are no tree."""
    path = tmp_path / "a.vdb"
    write_vdb(path, [random_grid("float"), random_grid("int32")])
    data = path.read_bytes()
    offsets: list[Offsets] = []
    with_offsets(data, lambda o, last: (offsets.append(o), o)[1])
    end = offsets[0][2]
    longer = data[:end] + bytes(8) + data[end:]
    at = longer.index(struct.pack("<3q", *offsets[0])) + 16
    path.write_bytes(longer[:at] + struct.pack("<q", end + 8) + longer[at + 8 :])
    with open_vdb(path) as file, pytest.raises(FileFormatError, match="8 bytes follow the last"):
        file.read("float")


def test_a_stream_cut_anywhere_is_an_error(all_types: list[Path], tmp_path: Path) -> None:
    path = tmp_path / "cut.vdb"
    for whole in all_types:
        data = streamed(whole.read_bytes())
        for length in range(60, len(data), len(data) // 12):
            path.write_bytes(data[:length])
            with pytest.raises(FileFormatError, match=r"cut\.vdb: "):
                open_vdb(path)


def test_a_stream_of_many_grids_opens_at_once(random_grid: Builder, tmp_path: Path) -> None:
    """Each byte is met once: time grows with the file."""
    grid = Grid.from_dense(
        "a", np.ones((1, 1, 1), np.float32), np.ones((1, 1, 1), bool), (0, 0, 0),
        like=random_grid("float"),
    )  # fmt: skip
    path = tmp_path / "a.vdb"
    write_vdb(path, [grid] * 200)
    path.write_bytes(streamed(path.read_bytes()))
    begin = time.process_time()
    with open_vdb(path) as file:
        assert len(file.grids) == 200
    assert time.process_time() - begin < 5
