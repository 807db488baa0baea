"""A shot file: what it says, and what is said of it where it is wrong."""

from pathlib import Path

import pytest

import vnca
from vnca.core.errors import FileFormatError, OptionError, TextError
from vnca.direction.shot import Shot
from vnca.recipe.paint import PaintRun

GOOD = """# a shot
sequence = "smoke/ball_####.vdb"
out = "out"
style = "ink"
refine = 1
strength = "smooth 1:0 3:@face"
steps_per_frame = 2
match = "pictures/sea.png"

[masks]
face = 'sphere(0, 0, 0, 1)'
head = 'mesh("head.obj") * @face'

[layers]
embers = "@head"

[film]
rows = 64
"""


def applied(text: str, tmp_path: Path) -> PaintRun:
    path = tmp_path / "shot.toml"
    path.write_text(text)
    return Shot.load(path).applied(PaintRun(sequence="", out=Path()))


def test_a_shot_is_read_and_its_paths_are_meant_from_where_it_lies(tmp_path: Path) -> None:
    run = applied(GOOD, tmp_path)
    assert run.sequence == str(tmp_path / "smoke" / "ball_####.vdb")
    assert run.out == tmp_path / "out"
    assert (run.style, run.refine, run.film.rows) == ("ink", 1, 64)
    direction = run.direction
    assert direction.strength == "smooth 1:0 3:@face"
    assert direction.steps_per_frame == 2
    assert direction.match == tmp_path / "pictures" / "sea.png"
    assert direction.masks == (
        "face=sphere(0, 0, 0, 1)",
        f'head=mesh("{tmp_path}/head.obj") * @face',
    )
    assert direction.layers == ("embers=@head",)


@pytest.mark.parametrize(
    ("before", "after", "place", "why"),
    [
        ("refine = 1", "refine = ", "5:10", "Invalid value"),
        ("refine = 1", "refin = 1", "5:1", "refin: no such option; did you mean refine?"),
        ("refine = 1", "refine = 'a'", "5:11", "expected a whole number"),
        ("[film]\nrows", "[film]\nrwos", "18:8", "film.rwos: no such option"),
        ("rows = 64", "rows = 6", "18:8", "at least 16 pixels"),
        ('"smooth 1:0 3:@face"', '"smooth 1:0 3:"', "6:26", "expected a value, got the end"),
        ('"smooth 1:0 3:@face"', '"3:0 1:1"', "6:17", "frame 1 after frame 3"),
        ('"smooth 1:0 3:@face"', "3", "6:12", "must be from 0 to 1"),
        ("face = 'sphere(0", "face = 'spere(0", "11:9", "'spere' is not known"),
        ("* @face", "* hight", "12:28", "'hight' is not known"),
        ('embers = "@head"', 'embers = "@head *"', "15:18", "expected a value"),
        ('style = "ink"', 'style = "nosuch"', "4:10", "expected one of cafe"),
    ],
)
def test_what_is_wrong_is_told_by_line_and_column(
    tmp_path: Path, before: str, after: str, place: str, why: str
) -> None:
    with pytest.raises((FileFormatError, TextError)) as failed:
        applied(GOOD.replace(before, after), tmp_path)
    message = str(failed.value)
    assert message.startswith(f"{tmp_path}/shot.toml:{place}: "), message
    assert why in message


def test_keys_in_longer_texts_are_no_keys(tmp_path: Path) -> None:
    text = GOOD.replace("'sphere(0, 0, 0, 1)'", "'''\nrefine = sphere(0, 0, 0, 1)'''")
    with pytest.raises(TextError, match=r"shot.toml:11:"):
        applied(text, tmp_path)


def test_a_missing_or_binary_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no such file"):
        Shot.load(tmp_path / "none.toml")
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileFormatError, match="cannot be read as text"):
        Shot.load(tmp_path / "b.toml")


def test_python_paints_a_shot_and_what_is_given_wins(smoke: Path, tmp_path: Path) -> None:
    text = GOOD.partition("match")[0] + "without_film = true\n[masks]\nface = 'height:0..1'\n"
    path = smoke.parent / "shot.toml"
    path.write_text(text)
    files = vnca.paint(path, frames="1-2", strength="0.5 * @face")
    assert [file.name for file in files] == ["ball_0001.vdb", "ball_0002.vdb"]
    assert files[0].parent == tmp_path / "out" / "painted"
    again = vnca.paint(Shot.load(path), out=tmp_path / "again", frames="1-2", style="embers")
    assert again[0].parent == tmp_path / "again" / "painted"
    path.write_text(text.replace('out = "out"', ""))
    with pytest.raises(OptionError, match="`out`"):
        vnca.paint(path)
