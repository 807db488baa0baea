from pathlib import Path

import pytest
from night import HERE, PIECES, Piece, command, make


def script(path: Path, text: str) -> list[str]:
    path.write_text(f"import pathlib, sys\ntable = pathlib.Path(sys.argv[-1])\n{text}\n")
    return [str(path)]


def test_every_study_is_there_and_called_once() -> None:
    names = [piece.name for piece in PIECES]
    assert len({*names}) == len(names)
    assert all((HERE / f"{piece.script}.py").exists() for piece in PIECES)
    calls = [" ".join(command(p, Path("out"), full=False, smallest=False)) for p in PIECES]
    assert len({*calls}) == len(calls)
    assert all("--seeds 0" in call for call in calls)


def test_a_study_that_is_done_is_not_done_again(tmp_path: Path) -> None:
    piece = Piece("one", "one")
    ran = tmp_path / "ran"
    told = f"table.write_text('found'); open({str(ran)!r}, 'a').write('x')"
    call = script(tmp_path / "one.py", told)
    assert make(piece, call, tmp_path)
    assert make(piece, call, tmp_path)
    assert ran.read_text() == "x"
    assert (tmp_path / "one.csv").read_text() == "found"
    assert make(piece, [*call, "otherwise"], tmp_path)
    assert ran.read_text() == "xx"


@pytest.mark.parametrize("end", ["sys.exit(2)", "raise ValueError"])
def test_what_fails_leaves_no_findings(tmp_path: Path, end: str) -> None:
    call = script(tmp_path / "one.py", f"table.write_text('half'); {end}")
    assert not make(Piece("one", "one"), call, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.py"]
