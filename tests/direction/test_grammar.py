"""What text of a direction means, and what is said where it means nothing."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vnca.core import Box
from vnca.core.errors import TextError
from vnca.core.volume import Volume
from vnca.direction import Moment
from vnca.direction.grammar import parsed, rebased
from vnca.direction.values import Constant

CELLS = np.array([[0, 0, 0], [1, 2, 3], [3, 3, 3]], np.int32)


def moment(frame: int = 1) -> Moment:
    density = np.arange(64, dtype=np.float32).reshape(4, 4, 4) / 63
    smoke = Volume(density, None, (0, 0, 0), np.diag([0.5, 0.5, 0.5, 1]), frame)
    return Moment(smoke, Box((0, 0, 0), (4, 4, 4)))


def asked(text: str, frame: int = 1) -> list[float]:
    answer = parsed(text, "strength").at(moment(frame), CELLS)
    return np.broadcast_to(answer, len(CELLS)).tolist()


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("0.25", 0.25),
        ("-.5", -0.5),
        ("1e-3", 1e-3),
        ("1 - 0.5 * 0.5", 0.75),
        ("(1 - 0.5) * 0.5", 0.25),
        ("-(1 + 2)", -3),
        ("min(3, 2, 4)", 2),
        ("max(0.1, 0.2)", 0.2),
        ("frame", 1),
        ("frame:0..4", 0.25),
        ("frame:0..4->10..20", 12.5),
        ("frame:4..0", 0.75),
        ("smooth frame:0..4", 0.15625),
        ("frame:2..3", 0),
    ],
)
def test_values_of_no_place_are_numbers(text: str, number: float) -> None:
    answer = parsed(text, "strength").at(moment(), CELLS)
    assert isinstance(answer, float)
    assert answer == pytest.approx(number)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("1:0 5:1", {0: 0, 1: 0, 2: 0.25, 5: 1, 9: 1}),
        ("linear 1:0 5:1", {3: 0.5}),
        ("smooth 1:0 5:1", {1: 0, 2: 0.15625, 3: 0.5, 5: 1}),
        ("hold 1:0 5:1", {4: 0, 5: 1, 6: 1}),
        ("-4:1 -2:0.5 0:0", {-5: 1, -3: 0.75, -1: 0.25}),
        ("1:0 3:1 5:0", {2: 0.5, 4: 0.5}),
        ("0.5 * (1:0 5:1)", {3: 0.25}),
        ("1.5:0 2.5:1", {2: 0.5}),
    ],
)
def test_keys_hold_over_frames(text: str, wanted: dict[int, float]) -> None:
    for frame, number in wanted.items():
        assert asked(text, frame)[0] == pytest.approx(number), frame


def test_what_is_known_of_the_smoke_is_told_place_by_place() -> None:
    assert asked("density") == pytest.approx([0, 27 / 63, 1])
    assert asked("density:0..0.5") == pytest.approx([0, 54 / 63, 1])
    assert asked("x") == pytest.approx([0, 0.5, 1.5])
    assert asked("z") == pytest.approx([0, 1.5, 1.5])
    # From the lower face of the lowest cell to the upper face of the highest.
    assert asked("height") == pytest.approx([0.125, 0.875, 0.875])
    assert asked("speed") == [0, 0, 0]
    assert asked("1:0 3:density", 2) == pytest.approx([0, 13.5 / 63, 0.5])


@pytest.mark.parametrize(
    ("text", "at", "why"),
    [
        ("", 0, "expected a value, got the end"),
        ("@mask *", 7, "expected a value, got the end"),
        ("24:1 1:0", 5, "frame 1 after frame 24"),
        ("1:0 1:1", 4, "frame 1 after frame 1"),
        ("1:0 24", 4, "expected its end, got '24'"),
        ("0.5 1:0", 4, "keys from the beginning"),
        ("hight", 0, "'hight' is not known; expected density"),
        ("1 + hight", 4, "'hight' is not known"),
        ("sphere(0,0)", 0, "sphere lacks 'z'"),
        ("box(0,0,0,1,1,1,sft=2)", 16, "not 'sft'"),
        ("sphere(0,0,0,1,2,3)", 17, "no more"),
        ("sphere(0,0,0,1,x=2)", 15, "given twice"),
        ("@t:3..3", 6, "from one number to another"),
        ("@t:3-4", 4, "two dots"),
        ("smooth @a", 9, "keys or a range"),
        ("(1", 2, "')' for the '(' at character 1"),
        ("1 ? 2", 2, "means nothing here"),
        ("mesh(3)", 5, "a text in quotes"),
        ("sphere('a',0,0,1)", 7, "expected a value"),
        ("min(1)", 0, "two values or more"),
        ("picture('x', azimuth=1, 2)", 24, "name=value"),
        ("(" * 80 + "1", 50, "inside each other"),
        ("height 0..1", 7, "expected its end"),
    ],
)
def test_what_cannot_be_read_is_told_with_the_character(text: str, at: int, why: str) -> None:
    with pytest.raises(TextError, match="`strength`") as failed:
        parsed(text, "strength")
    assert failed.value.at == at
    assert why in str(failed.value)
    shown, caret = failed.value.pointer
    assert caret.endswith("^")
    assert shown[len(caret) - 1 :] == text[at : at + len(shown) - len(caret) + 1]


@given(st.text("0123456789.:@-+*()ab, ='\"<>!", max_size=30))
def test_any_text_is_a_value_or_refused(text: str) -> None:
    try:
        told = list(parsed(text, "strength").parts())
    except TextError as error:
        told = [error.at] if error.at <= len(text) and "\n" not in str(error) else []
    assert told


def test_names_stand_for_masks_before_grids() -> None:
    assert parsed("@one * 2", "strength", {"one": Constant(0.25)}).at(moment(), CELLS) == 0.5
    assert next(parsed("@'a b'", "strength").parts()).name == "a b"  # type: ignore[attr-defined]


def test_paths_are_meant_from_a_folder() -> None:
    text = """max(mesh("head.obj", soft=0.1), picture('/a/b.png'), @"kept") * 2"""
    assert (
        rebased(text, Path("/shots"))
        == 'max(mesh("/shots/head.obj", soft=0.1), picture("/a/b.png"), @"kept") * 2'
    )
