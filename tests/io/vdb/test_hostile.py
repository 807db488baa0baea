"""Truncated, corrupt and hostile files end in one clear line, never in a crash."""

import random
import struct
import time
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest

from vnca.core import Box
from vnca.core.errors import FileFormatError, GridError
from vnca.io.vdb import Grid, open_vdb, write_vdb

Builder = Callable[..., Grid]


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("hostile") / "bad.vdb"


def survives(path: Path, data: bytes) -> bool:
    """Whether the file reads; else it must end in one line that names it."""
    path.write_bytes(data)
    message = None
    try:
        with open_vdb(path) as file:
            for header in file.grids.values():
                grid = header.read()
                grid.active_box()
                grid.to_dense(Box((-8, 120, -8), (9, 130, 9)))
                assert header.box is None or header.box.shape
    except (FileFormatError, GridError) as error:
        message = str(error)
    assert message is None or (str(path) in message and "\n" not in message)
    return message is None


@pytest.fixture
def small_files(random_grid: Builder, tiled_grid: Builder, tmp_path: Path) -> list[bytes]:
    grids = [
        tiled_grid("float", background=1),
        random_grid("vec3s", half=True),
        tiled_grid("bool"),
        random_grid("int32"),
    ]
    files = []
    for compression in ("blosc", "zip", "none"):
        write_vdb(tmp_path / "a.vdb", grids, {"title": "x"}, compression)
        files.append((tmp_path / "a.vdb").read_bytes())
    # The same without offsets, whose grids are found by their trees alone.
    return files + [data[:20] + b"\0" + data[21:] for data in files]


def test_a_file_cut_anywhere_is_an_error(small_files: list[bytes], scratch: Path) -> None:
    assert survives(scratch, small_files[0])
    size = len(small_files[0])
    for length in [*range(1, 700, 3), *range(700, size, 997), size - 1]:
        assert not survives(scratch, small_files[0][:length])


def test_a_real_frame_cut_anywhere_is_an_error(real_frame: Path, scratch: Path) -> None:
    data = real_frame.read_bytes()
    for length in range(1, len(data), len(data) // 40):
        assert not survives(scratch, data[:length])


def test_flipped_bytes_are_an_error_or_another_valid_file(
    small_files: list[bytes], scratch: Path
) -> None:
    rng = random.Random(0)
    outcomes = set()
    for _ in range(90):
        data = bytearray(rng.choice(small_files))
        for _ in range(rng.choice((1, 2, 5))):
            # Where something is written: most of a small file are empty masks.
            place = rng.choice([k for k in rng.sample(range(len(data)), 30) if data[k]] or [0])
            data[place] = rng.choice((0, 255, 128, rng.randrange(256), data[place] ^ 1))
        outcomes.add(survives(scratch, bytes(data)))
    assert outcomes == {True, False}


def test_flipped_bytes_ahead_of_the_values_are_an_error_or_another_valid_file(
    small_files: list[bytes], scratch: Path
) -> None:
    rng = random.Random(1)
    for _ in range(90):
        data = bytearray(rng.choice(small_files))
        data[rng.randrange(700)] = rng.choice((0, 255, 127, rng.randrange(256)))
        survives(scratch, bytes(data))


def test_flipped_bytes_in_compressed_chunks_are_an_error_or_other_values(
    real_frame: Path, scratch: Path
) -> None:
    rng = random.Random(2)
    original = real_frame.read_bytes()
    with open_vdb(real_frame) as file:
        header = file.grids["density"]
    blocks, end = header.blocks, header.end
    assert blocks is not None
    assert end is not None
    scratch.write_bytes(original)
    for _ in range(90):
        data = bytearray(original)
        for _ in range(3):
            data[rng.randrange(blocks, end)] = rng.randrange(256)
        survives(scratch, bytes(data))


@pytest.mark.parametrize("value", [2**31 - 1, 2**31, 2**32 - 1])
def test_no_length_in_a_file_makes_memory_or_time_run_out(
    value: int, random_grid: Builder, tmp_path: Path, scratch: Path
) -> None:
    write_vdb(tmp_path / "a.vdb", [random_grid("float")], {"title": "x"})
    original = (tmp_path / "a.vdb").read_bytes()
    with open_vdb(tmp_path / "a.vdb") as file:
        header = file.grids["float"]
    assert header.tree_start is not None
    assert header.blocks is not None
    root_counts = header.tree_start + 8
    fields = [57, 61, *range(70, 90), root_counts, root_counts + 4, header.blocks + 65]
    tracemalloc.start()
    for place in fields:
        data = bytearray(original)
        struct.pack_into("<I", data, place, value)
        assert not survives(scratch, bytes(data)) or 70 <= place < 90
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6


def test_a_bomb_is_not_unpacked(tmp_path: Path, random_grid: Builder, scratch: Path) -> None:
    """A chunk that claims, or yields, more than the cells of its node."""
    write_vdb(tmp_path / "a.vdb", [random_grid("float")], compression="zip")
    original = (tmp_path / "a.vdb").read_bytes()
    with open_vdb(tmp_path / "a.vdb") as file:
        header = file.grids["float"]
    assert header.blocks is not None
    assert header.end is not None
    bomb = zlib.compress(bytes(50_000_000))
    first = header.blocks + 65
    (length,) = struct.unpack_from("<q", original, first)
    data = bytearray(
        original[:first] + struct.pack("<q", len(bomb)) + bomb + original[first + 8 + abs(length) :]
    )
    end_at = original.index(struct.pack("<q", header.end))
    struct.pack_into("<q", data, end_at, header.end + len(data) - len(original))
    tracemalloc.start()
    assert not survives(scratch, bytes(data))
    assert tracemalloc.get_traced_memory()[1] < 5_000_000
    tracemalloc.stop()


def file_of(*grids: tuple[bytes, bytes, bytes]) -> bytes:
    """A file of grids of these names, types and contents; nothing in them is checked here."""
    data = bytearray(struct.pack("<q3I?36sII", 0x56444220, 224, 10, 0, True, b"", 0, len(grids)))
    for name, type_name, content in grids:
        data += b"".join(struct.pack("<I", len(s)) + s for s in (name, type_name, b""))
        start = len(data) + 24
        end = start + len(content)
        data += struct.pack("<3q", start, end, end) + content
    return bytes(data)


def head(*numbers: float, map_type: bytes = b"ScaleMap") -> bytes:
    """Compression, metadata and transform of a grid."""
    transform = struct.pack(f"<{len(numbers)}d", *numbers)
    return struct.pack("<3I", 2, 0, len(map_type)) + map_type + transform


UNIT = head(*[1.0] * 15)


def test_many_grids_of_one_name_open_at_once(scratch: Path) -> None:
    """Finding a free name for each by counting up took a time that grew as their square."""
    data = file_of(*[(b"a", b"Tree_float_5_4_3", UNIT)] * 8_000)
    begin = time.process_time()
    scratch.write_bytes(data)
    with open_vdb(scratch) as file:
        assert file.names[7_999] == "a[7999]"
    assert time.process_time() - begin < 5


def test_a_long_type_name_is_read_at_once(scratch: Path) -> None:
    """Searched with a regular expression it took minutes."""
    scratch.write_bytes(file_of((b"a", b"Tree" + b"_1" * 100_000 + b"!", UNIT)))
    begin = time.process_time()
    with open_vdb(scratch) as file, pytest.raises(FileFormatError, match="cannot read values"):
        file.read("a")
    assert time.process_time() - begin < 5


def test_tiles_upon_each_other_are_refused(scratch: Path) -> None:
    """Each would fill the same cells of an array again."""
    tile = struct.pack("<3if?", 0, 0, 0, 1, True)
    tree = struct.pack("<ifII", 1, 0, 2, 0) + 2 * tile
    assert not survives(scratch, file_of((b"a", b"Tree_float_5_4_3", UNIT + tree)))
    tree = struct.pack("<ifII", 1, 0, 1, 0) + tile
    assert survives(scratch, file_of((b"a", b"Tree_float_5_4_3", UNIT + tree)))


@pytest.mark.parametrize("size", [0, 1e-40, 1e40, float("nan"), float("inf")])
def test_transforms_that_leave_the_range_of_numbers_are_refused(size: float, scratch: Path) -> None:
    assert not survives(scratch, file_of((b"a", b"Tree_float_5_4_3", head(*[size] * 15))))


def test_a_message_neither_grows_with_a_file_nor_drives_the_terminal(scratch: Path) -> None:
    scratch.write_bytes(file_of((b"a", b"\x1b[31m\n" + b"x" * 100_000, UNIT)))
    with open_vdb(scratch) as file, pytest.raises(FileFormatError) as caught:
        file.read("a")
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 3000


@pytest.mark.parametrize("content", [b"", b"v", b" BDV", b"%PNG" * 50])
def test_what_is_no_vdb_file_is_called_so(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.vdb").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"a\.vdb.*(not a VDB file|empty)"):
        open_vdb(tmp_path / "a.vdb")
