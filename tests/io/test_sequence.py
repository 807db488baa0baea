from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vnca.core.errors import OptionError, SequenceError
from vnca.io.sequence import find_frames, format_frames, frames_beside, parse_frames


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


NEGATIVE = ("s.-0002.vdb", "s.-0001.vdb", "s.0000.vdb", "s.0001.vdb")


@pytest.mark.parametrize("name", ["", "s.%04d.vdb", "s.####.vdb", "s.$F4.vdb", "s.%d.vdb", "s.*"])
def test_numbers_below_zero_come_first(tmp_path: Path, name: str) -> None:
    make(tmp_path, *NEGATIVE)
    assert numbers(tmp_path / name) == [-2, -1, 0, 1]
    assert numbers(tmp_path / name, "-1-1x2") == [-1, 1]
    assert find_frames(tmp_path / name, "-3--1").gaps == (-3,)
    assert find_frames(tmp_path / name)[0].path == tmp_path / "s.-0002.vdb"


def test_a_minus_may_count_as_one_of_the_digits_as_printf_has_it(tmp_path: Path) -> None:
    make(tmp_path, "s_-010.vdb", "s_-009.vdb", "s_0001.vdb")
    assert numbers(tmp_path / "s_%04d.vdb") == [-10, -9, 1]


@pytest.mark.parametrize(
    ("before", "sign"),
    [
        *(("smoke-", 1), ("smoke2-", 1), ("2026-11-", 1), ("smoke(b)-", 1), ("fumée-", 1)),
        *(("smoke.-", -1), ("smoke_-", -1), ("smoke--", -1), ("smoke -", -1), ("-", -1)),
    ],
)
def test_what_stands_before_a_dash_tells_whether_it_is_a_minus(
    tmp_path: Path, before: str, sign: int
) -> None:
    make(tmp_path, *(f"{before}{number:04d}.vdb" for number in (1, 2, 10)))
    expected = sorted(sign * number for number in (1, 2, 10))
    assert numbers(tmp_path) == numbers(tmp_path / "*.vdb") == expected
    assert numbers(tmp_path / f"{before}0010.vdb") == [10 * sign]
    kept = before if sign == 1 else before[:-1]
    assert numbers(tmp_path / f"{kept}$F4.vdb") == expected


def test_a_pattern_that_ends_in_a_letter_finds_a_minus_beside_frame_0(tmp_path: Path) -> None:
    make(tmp_path, *(f"s{number}.vdb" for number in ("-0002", "-0001", "0001")))
    assert numbers(tmp_path / "s$F4.vdb") == [1]
    make(tmp_path, "s0000.vdb")
    assert numbers(tmp_path / "s$F4.vdb") == [-2, -1, 0, 1]
    assert numbers(tmp_path / "s-$F4.vdb") == [1, 2]
    with pytest.raises(SequenceError, match=r"choose one of s%04d\.vdb, s-%04d\.vdb"):
        find_frames(tmp_path)
    make(tmp_path, "s-0000.vdb")  # No number is written so: a sequence of its own.
    assert numbers(tmp_path / "s$F4.vdb") == [0, 1]


def test_a_pattern_does_not_take_a_separator_for_a_minus(tmp_path: Path) -> None:
    make(tmp_path, "s-0001.vdb", "s-0002.vdb")
    with pytest.raises(SequenceError, match=r"no file matches; .* holds s-0001\.vdb"):
        find_frames(tmp_path / "s%04d.vdb")


SUB_FRAMES = ("s.10.25.vdb", "s.10.5.vdb", "s.10.75.vdb", "s.10.vdb", "s.11.vdb")


@pytest.mark.parametrize("name", ["", "s.*.vdb"])
def test_sub_frames_are_left_out_only_where_whole_frames_are_asked_for(
    tmp_path: Path, name: str
) -> None:
    make(tmp_path, *SUB_FRAMES)
    whole = (
        r"s\.10\.25\.vdb and 2 more are sub-frames.* whole frames with `frames` 10-11, or number"
    )
    with pytest.raises(SequenceError, match=whole):
        find_frames(tmp_path / name)
    sequence = find_frames(tmp_path / name, "10-11")
    assert [frame.number for frame in sequence] == [10, 11]
    assert [path.name for path in sequence.sub_frames] == list(SUB_FRAMES[:3])
    assert find_frames(tmp_path / "s.$F.vdb") == sequence


@pytest.mark.parametrize("name", ["s.10.%d.vdb", "s.10.*.vdb", "s.$FF.vdb"])
def test_sub_frames_are_no_frames(tmp_path: Path, name: str) -> None:
    make(tmp_path, *SUB_FRAMES)
    with pytest.raises(SequenceError, match="sub-frames"):
        find_frames(tmp_path / name, "5")


@pytest.mark.parametrize(
    "names",
    [
        ("s.10.0625.vdb", "s.10.125.vdb", "s.10.1875.vdb"),
        ("s.10.333333.vdb", "s.10.666667.vdb"),
        ("s.10.5.vdb",),
    ],
)
def test_fractions_of_any_length_are_sub_frames(tmp_path: Path, names: tuple[str, ...]) -> None:
    make(tmp_path, "s.10.vdb", *names)
    assert [path.name for path in find_frames(tmp_path, "10").sub_frames] == list(names)


ONLY = ("s.10.25.vdb", "s.10.5.vdb", "s.10.75.vdb")


@pytest.mark.parametrize(
    "names",
    [
        ONLY,
        (*ONLY, "s.11.25.vdb", "s.11.5.vdb", "s.11.75.vdb"),
        (*ONLY, "s.11.5.vdb"),
        ("s.10.5.vdb", "s.11.5.vdb", "s.12.5.vdb"),
        ("s.0010.5.vdb", "s.0011.5.vdb"),
        ("s.-10.5.vdb", "s.-9.5.vdb"),
        ("s.10.0.vdb", "s.10.5.vdb", "s.11.0.vdb"),
        ("s.10.00.vdb", "s.10.25.vdb", "s.10.50.vdb", "s.10.75.vdb"),
        ("s.10.000.vdb", "s.10.250.vdb", "s.10.500.vdb", "s.10.750.vdb"),
        ("s.10.333333.vdb", "s.10.666667.vdb", "s.11.333333.vdb", "s.11.666667.vdb"),
        tuple(f"s.10.{step}.vdb" for step in ("125", "25", "375", "5", "625", "75", "875")),
    ],
    ids=len,
)
def test_sub_frames_without_whole_ones_are_no_frames_either(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    make(tmp_path, *names)
    more = f" and {len(names) - 1} more"
    for pattern in ("", "s.*.vdb"):
        for frames in (None, "5-25"):
            with pytest.raises(SequenceError) as caught:
                find_frames(tmp_path / pattern, frames)
            assert str(caught.value) == (
                f"{tmp_path / pattern}: {sorted(names)[0]}{more} are sub-frames, and only whole "
                "frames can be used; number them all in a row (docs/guide/stylize.md)"
            )
    shot = names[0].rpartition(".vdb")[0].rpartition(".")[0]
    with pytest.raises(SequenceError, match="are sub-frames"):
        find_frames(tmp_path / f"{shot}.%d.vdb")
    assert frames_beside(tmp_path / names[0]) == []


def test_sub_frames_of_a_frame_that_is_missing_are_left_out_too(tmp_path: Path) -> None:
    make(tmp_path, "s.10.vdb", "s.10.25.vdb", "s.11.25.vdb", "s.12.vdb")
    sequence = find_frames(tmp_path, "10-12")
    assert [frame.number for frame in sequence] == [10, 12]
    assert [path.name for path in sequence.sub_frames] == ["s.10.25.vdb", "s.11.25.vdb"]


def test_shots_that_could_be_sub_frames_are_told_as_both(tmp_path: Path) -> None:
    tenths = [f"s.{frame}.{tenth}.vdb" for frame in (10, 11) for tenth in range(1, 10)]
    make(tmp_path, *tenths)
    line = r"one of s\.10\.%d\.vdb, s\.11\.%d\.vdb; if these are sub-frames, number "
    with pytest.raises(SequenceError, match=line):
        find_frames(tmp_path)
    assert numbers(tmp_path / "s.10.%d.vdb") == [*range(1, 10)]


@pytest.mark.parametrize(
    "names",
    [
        ("s.10.5.vdb",),
        ("s.10.1.vdb", "s.10.3.vdb", "s.10.5.vdb"),
        ("s.10.5.vdb", "s.10.10.vdb", "s.10.15.vdb"),
        ("s.10.0025.vdb", "s.10.0050.vdb", "s.10.0075.vdb"),
        ("s.v02.25.vdb", "s.v02.50.vdb", "s.v02.75.vdb", "s.v02.100.vdb"),
        ("shot.10.0001.vdb", "shot.10.0002.vdb"),
        ("s.v02.0010.vdb", "s.v02.0011.vdb"),
        ("s.10.5.vdb", "s.10.6.vdb"),
    ],
)
def test_a_number_in_the_name_is_no_frame(tmp_path: Path, names: tuple[str, ...]) -> None:
    make(tmp_path, *names)
    assert [frame.path.name for frame in find_frames(tmp_path)] == list(names)
    assert find_frames(tmp_path).sub_frames == ()


def test_padded_or_running_numbers_are_frames_also_beside_a_file_of_the_shot(
    tmp_path: Path,
) -> None:
    make(tmp_path, "shot.10.vdb", "shot.10.0001.vdb", "shot.10.0002.vdb")
    assert numbers(tmp_path / "shot.10.%04d.vdb") == [1, 2]
    make(tmp_path / "running", "shot.10.vdb", *(f"shot.10.{number}.vdb" for number in (9, 10, 11)))
    assert numbers(tmp_path / "running" / "shot.10.%d.vdb") == [9, 10, 11]


def test_a_link_to_nothing_is_a_frame_that_is_missing(tmp_path: Path) -> None:
    make(tmp_path, "s_1.vdb", "s_2.vdb")
    (tmp_path / "s_3.vdb").symlink_to(tmp_path / "gone.vdb")
    (tmp_path / "s_4.vdb").mkdir()
    for name in ("", "s_*.vdb"):
        assert numbers(tmp_path / name) == [1, 2, 3]
    assert numbers(tmp_path / "s_3.vdb") == [3]


def test_a_file_knows_the_frames_of_its_own_sequence(tmp_path: Path) -> None:
    make(tmp_path, "a_2.vdb", "a_1.vdb", "b_7.vdb", "mask.vdb")
    assert [frame.number for frame in frames_beside(tmp_path / "a_2.vdb")] == [1, 2]
    assert frames_beside(tmp_path / "mask.vdb") == []


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
    with pytest.raises(SequenceError, match="choose some with `frames`"):
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
        ("-3", (-3,)),
        ("-2-2", (-2, -1, 0, 1, 2)),
        ("-2--1,3", (-2, -1, 3)),
        ("-5 - -1 x 2", (-5, -3, -1)),
    ],
)
def test_ranges_mean_what_they_say(text: str, expected: tuple[int, ...]) -> None:
    assert parse_frames(text) == expected


@pytest.mark.parametrize(
    "text", ["", ",", "a", "3-", "5-3", "1-9x0", "1-5x", "1..5", "1-2-3", "1-99999999", "²"]
)
def test_ranges_that_mean_nothing_are_refused_in_one_line(text: str) -> None:
    with pytest.raises(OptionError, match=r"^frames: [^\n]*$"):
        parse_frames(text)


@settings(deadline=None)
@given(st.sets(st.integers(-500, 500), min_size=1))
def test_formatted_frames_are_read_back(frames: set[int]) -> None:
    assert parse_frames(format_frames(frames)) == tuple(sorted(frames))


@settings(deadline=None)
@given(st.integers(-(10**6), 10**6), st.integers(0, 1000), st.integers(1, 50))
def test_a_stepped_range_starts_at_its_first_and_never_passes_its_last(
    first: int, length: int, step: int
) -> None:
    assert parse_frames(f"{first}-{first + length}x{step}") == tuple(
        range(first, first + length + 1, step)
    )
