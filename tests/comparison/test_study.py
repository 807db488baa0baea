"""The blind study: a page that does not tell, and shares with intervals."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.comparison.study import QUESTIONS, codes_of, evaluate, page, told, wilson
from vnca.core.errors import FileFormatError, OptionError

NAMES = ["vnca", "aurand", "tnst"]


@pytest.fixture
def films(tmp_path: Path) -> list[Path]:
    paths = [tmp_path / f"{name}.mp4" for name in NAMES]
    for path in paths:
        path.write_bytes(b"film")
    return paths


def shown(films: list[Path], names: list[str] = NAMES) -> str:
    stills = [np.full((8, 8), 0.1 * at, np.float32) for at in range(len(names))]
    return page(names, films, stills, np.ones((8, 8), np.float32), seed=3)


def told_by(text: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    return json.loads(found[1])


def test_the_page_needs_nothing_else_and_tells_no_names(films: list[Path]) -> None:
    text = shown(films)
    assert "{{" not in text
    assert not re.search(r'(src|href)="(?!data:)[^"]*"', text)
    for name in NAMES:
        assert name not in text
    data = told_by(text)
    assert data["questions"] == QUESTIONS
    assert len(data["pairs"]) == 3
    assert set(data["shown"]) == set(codes_of(NAMES, 3))
    assert codes_of(NAMES, 4) != codes_of(NAMES, 3)


def test_one_method_is_no_choice(films: list[Path]) -> None:
    with pytest.raises(OptionError, match="`study`"):
        shown(films[:1], NAMES[:1])


def answers(path: Path, films: list[Path], person: str, winner: str) -> Path:
    data, code = told_by(shown(films)), dict(zip(NAMES, codes_of(NAMES, 3), strict=True))
    chosen = code[winner]
    listed = [
        {"question": question, "chosen": chosen, "other": other, "left": other}
        for question in QUESTIONS
        for other in code.values()
        if other != chosen
    ]
    told = {"format": data["format"], "study": data["study"], "person": person, "answers": listed}
    path.write_text(json.dumps(told))
    return path


def test_answers_become_shares_and_a_person_counts_once(films: list[Path], tmp_path: Path) -> None:
    paths = [
        answers(tmp_path / "a.json", films, "a", "tnst"),
        answers(tmp_path / "b.json", films, "b", "vnca"),
        answers(tmp_path / "c.json", films, "a", "vnca"),
    ]
    people, found = evaluate(paths, NAMES, 3)
    assert people == 2
    shares = {(one.question, one.method): one.share for one in found}
    assert shares["motion", "vnca"] == 1
    assert shares["motion", "tnst"] == 0
    (vnca,) = [one for one in found if one.method == "vnca" and one.question == "motion"]
    assert (vnca.chosen, vnca.asked) == (4, 4)
    assert vnca.low < 1 == vnca.high
    assert "vnca" in told(people, found)
    assert "100.0%" in told(people, found)


def test_intervals_are_wilsons() -> None:
    # Brown, Cai and DasGupta 2001: 40 of 50 has 67 % to 89 %.
    low, high = wilson(40, 50)
    assert low == pytest.approx(0.6696, abs=1e-3)
    assert high == pytest.approx(0.8876, abs=1e-3)
    assert wilson(0, 10)[0] == 0
    assert wilson(10, 10)[1] == 1


def test_answers_to_another_study_are_refused(films: list[Path], tmp_path: Path) -> None:
    path = answers(tmp_path / "a.json", films, "a", "tnst")
    for names, seed in ((NAMES, 9), (NAMES[:2], 3)):
        with pytest.raises(FileFormatError, match=r"a\.json: no answers of this study"):
            evaluate([path], names, seed)
    path.write_text("{}")
    with pytest.raises(FileFormatError, match=r"a\.json"):
        evaluate([path], NAMES, 3)
