"""What is written once is not written again: no eight lines of code stand twice.

Names and numbers aside, in what functions do; as they are, everywhere else.
"""

import ast
import keyword
import re
from collections.abc import Iterator
from pathlib import Path

import vnca

ROOT = Path(vnca.__file__).parent
EXAMPLES = Path(__file__).parents[1] / "examples"
RUN = 8


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
    """Where runs of lines begin that stand in another place as well, each with that place.

    Runs that overlap are one list of things alike.
    """
    seen: dict[tuple[str, ...], tuple[str, int]] = {}
    found = []
    for name, lines in sources.items():
        for at in range(len(lines) - RUN + 1):
            run = tuple(code for _, code in lines[at : at + RUN])
            first, begins = seen.setdefault(run, (name, at))
            if first != name or at >= begins + RUN:
                number = sources[first][begins][0]
                found.append(f"{name}:{lines[at][0]} is {first}:{number}")
    return found


def steps(text: str) -> Iterator[tuple[int, str]]:
    """The shape of the lines of functions by number: without names, numbers and texts.

    What is passed on under its own name (`size=size,`) has to be said by each, as signatures have;
    lists of values and what has a text in it are data.
    """
    inside: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            inside.update(range(node.body[0].lineno, (node.end_lineno or 0) + 1))
    for number, line in python_lines(text):
        passed_on = re.fullmatch(r"(\w+)=(self\.|options\.|asked\.)?\1,", line)
        if number in inside and not passed_on and not re.search(r"[\"']", line):
            shape = re.sub(r"\b\d[\w.]*", "0", line)
            yield number, re.sub(r"[^\W\d]\w*", _unnamed, shape)


def _unnamed(word: re.Match[str]) -> str:
    return word[0] if keyword.iskeyword(word[0]) else "name"


def test_no_run_of_lines_stands_twice() -> None:
    exact, shapes = {}, {}
    for path in sorted((*ROOT.rglob("*"), *EXAMPLES.rglob("*.py"))):
        if path.suffix in (".py", ".cpp", ".hpp"):
            name, text = str(path), path.read_text()
            exact[name] = list((python_lines if path.suffix == ".py" else cpp_lines)(text))
            if path.suffix == ".py":
                shapes[name] = list(steps(text))
    assert len(exact) > 120
    assert not repeated(exact)
    assert not repeated(shapes)


def test_a_run_that_stands_twice_is_found() -> None:
    code = "\n".join(f"a{number} = {number}" for number in range(RUN))
    lines = [*python_lines(f'"""What it is."""\n\n{code}\n# again\n\n{code}\n')]
    assert repeated({"a.py": lines}) == ["a.py:13 is a.py:3"]
    assert not repeated({"a.py": lines[: 2 * RUN - 1]})


def test_other_names_and_numbers_hide_no_run_in_functions() -> None:
    body = [f"    {'abc'[n % 3]} = {'xyz'[n % 2]} * {n}" + " + 1" * (n % 4) for n in range(RUN)]
    other = [line.replace("a", "other").replace("1", "2") for line in body]
    text = "\n".join(["def one(x, y, z):", *body, "", "def two(x, y, z):", *other])
    assert repeated({"a.py": list(steps(text))})
    assert not repeated({"a.py": list(steps(text.replace(other[3], "    pass")))})
