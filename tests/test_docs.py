"""The commands in the README and the documentation are ones that `vnca` takes."""

import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import tyro

from vnca.cli import COMMANDS, main

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
EXAMPLES = ROOT / "examples"
SMOKE = ROOT / "tests" / "data" / "plume_sphere_0030.vdb"
MODEL = ROOT / "tests" / "data" / "painting" / "rule.safetensors"


def blocks() -> Iterator[tuple[str, list[str]]]:
    """The commands in blocks of shell code, as written and as words."""
    for page in PAGES:
        for block in re.findall(r"```sh\n(.*?)```", page.read_text(), re.DOTALL):
            for line in block.replace("\\\n", " ").splitlines():
                if line.startswith("vnca ") and not re.search(r"\$[({a-z]", line):
                    # Of what may be left out, both is to be read; an ellipsis stands for more.
                    # What the shell does with the output is none of ours.
                    plain = re.sub(r"[][…]| > \S+", "", line)
                    yield f"{page.name}: {line}", shlex.split(plain, comments=True)[1:]


def mentions() -> Iterator[tuple[str, list[str]]]:
    """The commands in the running text."""
    for page in PAGES:
        for text in re.findall(r"`vnca ([^`\n]+)`", page.read_text()):
            yield f"{page.name}: {text}", text.split()


class Read(Exception):  # noqa: N818  It is no error.
    """A command was understood, and nothing was begun."""


@pytest.fixture
def only_read(monkeypatch: pytest.MonkeyPatch) -> None:
    real = tyro.cli

    def read(*arguments: Any, **keywords: Any) -> None:
        real(*arguments, **keywords)
        raise Read

    monkeypatch.setattr(tyro, "cli", read)


def test_there_are_commands_to_read() -> None:
    assert len(list(blocks())) > 25
    assert len(list(mentions())) > 25


@pytest.mark.usefixtures("only_read")
@pytest.mark.parametrize(
    "words", [pytest.param(words, id=name) for name, words in blocks() if words != ["demo"]]
)
def test_a_command_of_the_documentation_is_understood(
    words: list[str],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text('base = "draft"\n')  # a preset that a page tells to make
    shutil.copy(EXAMPLES / "shot.toml", tmp_path)
    (tmp_path / "examples").mkdir()
    shutil.copy(EXAMPLES / "shot.toml", tmp_path / "examples")
    try:
        code = main(words)
    except Read:
        return
    pytest.fail(f"exit code {code}: {capsys.readouterr().err}")


@pytest.mark.parametrize("words", [pytest.param(words, id=name) for name, words in mentions()])
def test_a_command_that_is_spoken_of_is_one(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    name = words[0]
    if name in ("--version", "--help"):
        return
    for command in name.strip("{}").split(","):
        assert command in COMMANDS
    options = {word for word in words if word.startswith("--") and word[2:3].isalpha()}
    if not options:
        return
    inside = [word for word in words[1:2] if name in ("texture", "bench") and word.isalpha()]
    with pytest.raises(SystemExit):
        main([name, *inside, "--help-all"])
    shown = capsys.readouterr().out
    for option in options:
        assert option in shown


CHEAP = {
    name: words
    for name, words in blocks()
    if words[0] == "info" or (words[0] == "render" and "--strip" in words)
}


@pytest.mark.parametrize("words", [pytest.param(words, id=name) for name, words in CHEAP.items()])
def test_a_cheap_command_of_the_documentation_runs(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("painted/plume_0030.vdb", "cache/data/fluid_data_0045.vdb", "smoke.0045.vdb"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(SMOKE, path)
    model = tmp_path / "runs" / "painting" / "model.safetensors"
    model.parent.mkdir(parents=True)
    shutil.copy(MODEL, model)
    assert main(words) == 0


WALKS = re.findall(
    r"^\*([^*\n]+)\.\*.*\n\n((?:\d\. .*\n)+)",
    (ROOT / "docs" / "design.md").read_text(),
    re.MULTILINE,
)


def test_there_are_three_walks_through_the_house() -> None:
    assert [name for name, _ in WALKS] == ["The density of a painted frame", "γ", "The weights"]


@pytest.mark.parametrize("steps", [pytest.param(steps, id=name) for name, steps in WALKS])
def test_a_walk_is_short_and_goes_through_files_that_are_there(steps: str) -> None:
    numbered = steps.splitlines()
    assert 1 < len(numbered) <= 8
    for step in numbered:
        path = re.match(r"\d\. `([^`]+)`", step)
        assert path, step
        assert (ROOT / "src" / "vnca" / path[1]).is_file()
