from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.errors import OptionError, SequenceError
from vnca.io.sequence import find_frames, format_frames, parse_frames


def make(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"x")
    return folder


def numbers(pattern: str | Path, frames: str | None = None) -> list[int]:
    return [frame.number for frame in find_frames(pattern, frames)]


@pytest.mark.parametrize("name", ["s_%04d.vdb", "s_####.vdb", "s_$F4.vdb", "s_%d.vdb", "s_$F.vdb"])
def test_every_way_to_write_a_frame_number_finds_the_frames(tmp_path: Path, name: str) -> None:
    make(tmp_path, "s_0008.vdb", "s_0009.vdb", "s_0010.vdb", "s_0011.vdb.tmp", "t_0012.vdb")
    sequence = find_frames(tmp_path / name)
    assert [frame.number for frame in sequence] == [8, 9, 10]
    assert sequence[0].path == tmp_path / "s_0008.vdb"
    assert sequence.gaps == ()


def test_frames_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    make(tmp_path, *(f"s.{n}.vdb" for n in (9, 10, 11, 100, 8)))
    assert numbers(tmp_path / "s.$F.vdb") == [8, 9, 10, 11, 100]
    assert numbers(tmp_path) == [8, 9, 10, 11, 100]
    assert numbers(tmp_path / "s.1*.vdb") == [10, 11, 100]


def test_hidden_files_are_no_frames(tmp_path: Path) -> None:
    make(tmp_path, "s_0008.vdb", ".s_0008.unfinished-abcdef12.vdb", "._s_0008.vdb")
    assert numbers(tmp_path) == [8]
    assert numbers(tmp_path / "*") == [8]


def test_padding_may_overflow_but_not_fall_short(tmp_path: Path) -> None:
    make(tmp_path, "s_9999.vdb", "s_10000.vdb", "s_12.vdb")
    assert numbers(tmp_path / "s_%04d.vdb") == [9999, 10000]


def test_missing_frames_inside_a_sequence_are_reported(tmp_path: Path) -> None:
    make(tmp_path, "s_1.vdb", "s_2.vdb", "s_5.vdb")
    assert find_frames(tmp_path).gaps == (3, 4)


def test_missing_frames_of_a_range_are_reported_also_at_its_ends(tmp_path: Path) -> None:
    make(tmp_path, *(f"s_{n:04d}.vdb" for n in (30, 31, 33)))
    sequence = find_frames(tmp_path, "29-34")
    assert [frame.number for frame in sequence] == [30, 31, 33]
    assert sequence.gaps == (29, 32, 34)
    assert find_frames(tmp_path, "31-33x2").gaps == ()
    assert numbers(tmp_path, "31-33x2") == [31, 33]


def test_a_range_without_any_frame_says_which_there_are(tmp_path: Path) -> None:
    make(tmp_path, *(f"s_{n:04d}.vdb" for n in (30, 31, 33)))
    with pytest.raises(SequenceError, match=r"no frame of 1-9; there are 30-31,33"):
        find_frames(tmp_path, "1-9")


def test_a_single_file_is_a_sequence_of_one(tmp_path: Path) -> None:
    make(tmp_path, "cloud.vdb", "smoke_v2_0045.vdb", "odd_%d.vdb")
    assert list(find_frames(tmp_path / "cloud.vdb")) == [(0, tmp_path / "cloud.vdb")]
    assert numbers(tmp_path / "smoke_v2_0045.vdb") == [45]
    assert numbers(tmp_path / "odd_%d.vdb") == [0]


def test_a_folder_with_several_sequences_lists_their_patterns(tmp_path: Path) -> None:
    make(tmp_path, "a_0001.vdb", "a_0002.vdb", "b1.vdb", "b10.vdb", "notes_3.txt", "mask.vdb")
    with pytest.raises(SequenceError, match=r"choose one of a_%04d\.vdb, b%d\.vdb$"):
        find_frames(tmp_path)
    with pytest.raises(SequenceError, match="several sequences"):
        find_frames(tmp_path / "*.vdb")
    assert numbers(tmp_path / "b%d.vdb") == [1, 10]
    assert numbers(tmp_path / "a_*") == [1, 2]


def test_mantaflow_folders_are_read_through_their_densities(tmp_path: Path) -> None:
    make(tmp_path, "d/010.npz", "d/009.npz", "v/009.npz", "v/010.npz", "params.txt")
    assert list(find_frames(tmp_path)) == [
        (9, tmp_path / "d/009.npz"),
        (10, tmp_path / "d/010.npz"),
    ]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("s_%04d.vdb", r"no file matches; .* holds a\.txt, d"),
        ("*.vdb", "no numbered .vdb or .npz file; .* holds a.txt, d$"),
        ("", "no numbered .vdb or .npz file"),
        ("none.vdb", "no such file or folder; .* holds a.txt, d"),
        ("nowhere/s_%d.vdb", "cannot be listed"),
        ("nowhere/s.vdb", "there is no folder"),
        ("d", "no numbered .* holds nothing"),
        ("%d_%d.vdb", "expected one frame number"),
    ],
)
def test_nothing_found_names_the_pattern_and_what_is_there(
    tmp_path: Path, name: str, words: str
) -> None:
    make(tmp_path, "a.txt")
    (tmp_path / "d").mkdir()
    with pytest.raises(SequenceError, match=words) as caught:
        find_frames(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_one_number_with_two_files_is_refused(tmp_path: Path) -> None:
    make(tmp_path, "s_1.vdb", "s_01.vdb")
    with pytest.raises(SequenceError, match=r"frame 1 has two files, s_01\.vdb and s_1\.vdb"):
        find_frames(tmp_path)


def test_numbers_that_are_no_frames_do_not_fill_the_memory(tmp_path: Path) -> None:
    make(tmp_path, "s_1.vdb", "s_20260101120000.vdb")
    with pytest.raises(SequenceError, match="choose some with --frames"):
        find_frames(tmp_path)
    assert numbers(tmp_path, "1-5") == [1]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("30-33", (30, 31, 32, 33)),
        ("30-34x2", (30, 32, 34)),
        ("30-33x2", (30, 32)),
        ("1,4,7-9", (1, 4, 7, 8, 9)),
        (" 7 - 9 , 1,8", (1, 7, 8, 9)),
        ("0007", (7,)),
    ],
)
def test_ranges_mean_what_they_say(text: str, expected: tuple[int, ...]) -> None:
    assert parse_frames(text) == expected


@pytest.mark.parametrize(
    "text", ["", ",", "a", "3-", "-3", "5-3", "1-9x0", "1-5x", "1..5", "1-2-3", "1-99999999", "²"]
)
def test_ranges_that_mean_nothing_are_refused_in_one_line(text: str) -> None:
    with pytest.raises(OptionError, match=r"^frames: [^\n]*$"):
        parse_frames(text)


@settings(deadline=None)
@given(st.sets(st.integers(0, 500), min_size=1))
def test_formatted_frames_are_read_back(frames: set[int]) -> None:
    assert parse_frames(format_frames(frames)) == tuple(sorted(frames))


@settings(deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 1000), st.integers(1, 50))
def test_a_stepped_range_starts_at_its_first_and_never_passes_its_last(
    first: int, length: int, step: int
) -> None:
    assert parse_frames(f"{first}-{first + length}x{step}") == tuple(
        range(first, first + length + 1, step)
    )
