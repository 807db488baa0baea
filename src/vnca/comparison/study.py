"""A blind study: a page that asks people, and what their answers come to.

The page shows two methods at a time, unlabelled and in random order, and asks the paper's three
questions of every pair. Answers stay on the machine of whoever gives them until the file is saved
and sent. No result is claimed without people.

Reference: the VNCA paper, section 4.3 (the questions); Wilson 1927 (intervals of a share).
"""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from importlib.resources import files
from itertools import combinations
from pathlib import Path
from typing import Any

from vnca.comparison.report import as_data, picture_data
from vnca.core import FloatArray
from vnca.core.errors import FileFormatError, OptionError
from vnca.core.files import existing_file

QUESTIONS: Mapping[str, str] = {
    "stylization": "Which image has the texture pattern that best matches the reference image?",
    "consistency": "Which video has a smoother transition between frames?",
    "motion": "Which video is most plausible as a natural smoke sequence?",
}
"""As the paper asked them; the first of pictures, the others of films."""
FORMAT = "smoke-study-1"
_Z = 1.959964  # two-sided 95 %


def page(
    names: Sequence[str],
    films: Sequence[Path],
    stills: Sequence[FloatArray],
    picture: FloatArray,
    *,
    seed: int,
) -> str:
    """The page, in one file. It knows methods by codes that do not tell their names.

    Args:
        names: Of the methods.
        films: One of each.
        stills: A grey picture `[r, c]` of each.
        picture: The reference, likewise.
        seed: Makes the codes.

    Raises:
        OptionError: If there are fewer than two methods.
    """
    if len(names) < 2:
        raise OptionError("`study`: at least two methods are needed to choose between")
    codes = codes_of(names, seed)
    shown = {
        code: {"film": as_data(film, "video/mp4"), "still": picture_data(still)}
        for code, film, still in zip(codes, films, stills, strict=False)
    }
    data = {
        "format": FORMAT,
        "study": _digest("".join(codes)),
        "questions": QUESTIONS,
        "pairs": [list(pair) for pair in combinations(sorted(codes), 2)],
        "shown": shown,
        "reference": picture_data(picture),
    }
    template = files("vnca.comparison").joinpath("study.html").read_text(encoding="utf-8")
    # A closing tag inside a script would end it.
    return template.replace("{{data}}", json.dumps(data).replace("</", "<\\/"))


def codes_of(names: Sequence[str], seed: int) -> list[str]:
    """What each method is called on the page."""
    return [_digest(f"{seed}/{name}")[:8] for name in names]


def _digest(text: str) -> str:
    return blake2b(text.encode(), digest_size=8).hexdigest()


@dataclass(frozen=True)
class Preference:
    """How often a method was preferred.

    Attributes:
        question: Of which.
        method: Which.
        chosen: How often it was chosen.
        asked: Of how many pairs it was in.
        low: The lower end of the 95 % interval of the share.
        high: Its upper end.
    """

    question: str
    method: str
    chosen: int
    asked: int
    low: float
    high: float

    @property
    def share(self) -> float:
        """Chosen over asked."""
        return self.chosen / self.asked


def evaluate(
    paths: Iterable[Path], names: Sequence[str], seed: int
) -> tuple[int, list[Preference]]:
    """How many people answered, and what each method's share is.

    Args:
        paths: Files that the page saved; a person who saved several counts once, by the last.
        names: The methods.
        seed: As the page was made with.

    Raises:
        FileFormatError: If a file holds no answers of this study.
    """
    codes = dict(zip(codes_of(names, seed), names, strict=True))
    study = _digest("".join(codes))
    people: dict[str, list[tuple[str, str, str]]] = {}
    for path in paths:
        person, answers = _read(path, study, codes)
        people[person] = answers
    counts: dict[tuple[str, str], list[int]] = {}
    for answers in people.values():
        for question, chosen, other in answers:
            for code, won in ((chosen, 1), (other, 0)):
                count = counts.setdefault((question, codes[code]), [0, 0])
                count[0] += won
                count[1] += 1
    return len(people), [
        Preference(question, name, count[0], count[1], *wilson(count[0], count[1]))
        for question in QUESTIONS
        for name in names
        if (count := counts.get((question, name)))
    ]


def wilson(chosen: int, asked: int) -> tuple[float, float]:
    """The 95 % interval of a share, by Wilson's score; it does not leave 0 to 1."""
    share, z = chosen / asked, _Z
    middle = share + z * z / (2 * asked)
    reach = z * math.sqrt(share * (1 - share) / asked + z * z / (4 * asked * asked))
    scale = 1 + z * z / asked
    # Not by rounding short of where it ends exactly.
    low = (middle - reach) / scale if chosen else 0.0
    high = (middle + reach) / scale if chosen < asked else 1.0
    return low, high


def _read(
    path: Path, study: str, codes: Mapping[str, str]
) -> tuple[str, list[tuple[str, str, str]]]:
    """Who answered, and each answer: question, chosen, the other."""
    try:
        told: Any = json.loads(existing_file(path).read_text(encoding="utf-8"))
        if told["format"] != FORMAT:
            raise ValueError("it is of another format")
        if told["study"] != study:
            raise ValueError("it is of another study: other methods, or another seed")
        answers = [(a["question"], a["chosen"], a["other"]) for a in told["answers"]]
        person = str(told["person"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileFormatError(f"{path}: no answers of this study ({error})") from error
    for question, chosen, other in answers:
        if question not in QUESTIONS or chosen not in codes or other not in codes:
            raise FileFormatError(f"{path}: an answer speaks of what this study does not have")
    return person, answers


def told(people: int, preferences: Iterable[Preference]) -> str:
    """The result in lines: how often each method was preferred, with 95 % intervals."""
    lines = [f"{people} people"]
    question = ""
    for found in preferences:
        if found.question != question:
            question = found.question
            lines.append(f"\n{QUESTIONS[question]}")
        lines.append(
            f"  {found.method:18}{found.share:6.1%}  ({found.low:.1%} to {found.high:.1%}; "
            f"{found.chosen} of {found.asked})"
        )
    lines.append("\nAnswers of one person hang together: the intervals take them as independent.")
    return "\n".join(lines)
