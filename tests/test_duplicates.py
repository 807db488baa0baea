"""What is written once is not written again: no eight lines of code stand twice."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import vnca

ROOT = Path(vnca.__file__).parent
RUN = 8
FOLDERS = (
    "bench", "core", "engine", "io", "losses", "meshes", "metrics", "rule", "simulation",
)  # fmt: skip


def python_lines(text: str) -> Iterator[tuple[int, str]]:
    """Lines of code by number: no imports, docstrings and comments, and no signatures.

    What a function takes has to be said by each.
    """
    left_out: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            left_out.update(range(node.lineno, (node.end_lineno or 0) + 1))
        elif isinstance(node, ast.FunctionDef):
            left_out.update(range(node.lineno, node.body[0].lineno))
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            left_out.update(range(node.lineno, (node.end_lineno or 0) + 1))
    for number, line in enumerate(text.splitlines(), 1):
        code = line.strip()
        if code and number not in left_out and not code.startswith("#"):
            yield number, code


def cpp_lines(text: str) -> Iterator[tuple[int, str]]:
    """Lines of code by number, without includes and comments."""
    for number, line in enumerate(text.splitlines(), 1):
        code = re.sub(r"\s*//.*$", "", line.strip())
        if code and not code.startswith("#include"):
            yield number, code


def repeated(sources: dict[str, list[tuple[int, str]]]) -> list[str]:
    """Where runs of lines begin that stand in another place as well, each with that place."""
    seen: dict[tuple[str, ...], str] = {}
    found = []
    for name, lines in sources.items():
        for at in range(len(lines) - RUN + 1):
            where = f"{name}:{lines[at][0]}"
            first = seen.setdefault(tuple(code for _, code in lines[at : at + RUN]), where)
            if first != where:
                found.append(f"{where} is {first}")
    return found


def test_no_run_of_lines_stands_twice() -> None:
    sources = {}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".cpp", ".hpp"):
                read = python_lines if path.suffix == ".py" else cpp_lines
                sources[str(path.relative_to(ROOT))] = list(read(path.read_text()))
    assert len(sources) > 80
    assert not repeated(sources)


def test_a_run_that_stands_twice_is_found() -> None:
    code = "\n".join(f"a{number} = {number}" for number in range(RUN))
    lines = [*python_lines(f'"""What it is."""\n\n{code}\n# again\n\n{code}\n')]
    assert repeated({"a.py": lines}) == ["a.py:13 is a.py:3"]
    assert not repeated({"a.py": lines[: 2 * RUN - 1]})
