import dataclasses
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tyro

from vnca.cli import COMMANDS, bench, peers, textures
from vnca.cli.help import COMMON, SHORT

Vnca = Callable[..., Any]
INSIDE = {"bench": bench.COMMANDS, "peers": peers.COMMANDS, "texture": textures.COMMANDS}
CALLS = [
    [name, *inside]
    for name in COMMANDS
    for inside in ([[one] for one in INSIDE[name]] if name in INSIDE else [[]])
]
SCREEN = 50
"""Lines."""


def listed(text: str) -> set[str]:
    """The options that begin an entry, each by its first long form."""
    entries = re.findall(r"(?:│ |^  )(-.*?)(?:  | │|$)", text, re.MULTILINE)
    found = {re.findall(r"--[a-z][\w.-]*", entry)[0] for entry in entries}
    return found - {"--help", "--help-all", "--json-progress"}


@pytest.mark.parametrize("call", CALLS, ids=" ".join)
def test_help_fits_a_screen_and_help_all_shows_what_is_read(
    vnca: Vnca, monkeypatch: pytest.MonkeyPatch, call: list[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    short, long = vnca(*call, "--help"), vnca(*call, "--help-all")
    assert (short.code, long.code, short.err, long.err) == (0, 0, "", "")
    assert len(short.out.splitlines()) <= SCREEN
    assert max(map(len, long.out.splitlines())) <= 80
    assert "None" not in long.out
    real = tyro.cli

    def shown(options: Any, **keywords: Any) -> None:
        real(options, **{**keywords, "args": ["--help"]})

    with monkeypatch.context() as patch:
        patch.setattr(tyro, "cli", shown)
        # tyro prints its own help, and parse takes its leaving for a mistake.
        understood = listed(vnca(*call).out)
    assert listed(long.out) == understood
    common = {f"--{name}" for name in COMMON.get(" ".join(call), ())}
    assert listed(short.out) == (common or understood)
    assert common <= understood


def test_help_groups_options_and_tells_defaults_of_the_preset(vnca: Vnca) -> None:
    draft, standard = (
        vnca("train", "-p", name, "--help-all").out for name in ("draft", "standard")
    )
    assert re.search(r"--iterations INT .*\(default: 160\)", draft)
    assert not re.search(r"--iterations INT .*\(default: 160\)", standard)
    assert "\nHow the smoke is looked at while training:\n  --view.size INT" in draft
    assert "--texture FLOAT" in draft
    assert "--density-prior, --no-density-prior" in draft
    assert "-o, --out PATH" in draft


def test_going_on_with_a_training_has_a_help_of_its_own(vnca: Vnca) -> None:
    text = vnca("train", "--resume", "run", "--help").out
    inputs = {"--frame", "--more-frames", "--style", "--more-styles"}
    assert listed(text) == {"--resume", "--memory-budget", *inputs}


def test_short_forms_are_the_long_ones(vnca: Vnca, tmp_path: Path) -> None:
    for words in (
        ["-o", tmp_path, "-f", "2", "-s", "5"],
        [f"-o={tmp_path}", "--frames", "2", "--seed=5"],
    ):
        outcome = vnca("simulate", "plume", "--resolution", "16", *words)
        assert outcome.code == 0, outcome.err
        assert len(list(tmp_path.glob("plume_*.vdb"))) == 2
    assert len(set(SHORT.values())) == len(SHORT)
    assert "--preset" in vnca("simulate", "plume", "-o", tmp_path, "-p", "draft").complaint


@dataclasses.dataclass
class Odd:
    """What it is."""

    first: int | None = None
    """Goes with `other_one`, not with `elsewhere`."""
    other_one: float = 2.0
    """Of `vnca info`."""


def test_options_that_are_spoken_of_are_written_as_options() -> None:
    from vnca.cli.help import help_text

    text = help_text("odd", Odd, all_of_them=True)
    assert "  --first INT             Goes with --other-one, not with `elsewhere`.\n" in text
    assert "  --other-one FLOAT       Of `vnca info`. (default: 2)\n" in text
