import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import vnca

ROOT = Path(vnca.__file__).parent


def test_importing_is_light() -> None:
    code = "import sys, vnca; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert not loaded & {"torch", "numpy", "scipy", "PIL", "tyro", "jaxtyping", "safetensors"}


@pytest.mark.parametrize("folder", ["benchmarks", "docs", "examples"])
def test_what_is_not_the_command_line_does_without_it(folder: str) -> None:
    # Help is printed by the documentation, and the gallery is made as its readers would.
    callers = {"docs/conf.py", "docs/gallery/workshop.py"}
    top = Path(__file__).parents[1]
    for path in sorted((top / folder).rglob("*.py")):
        if path.relative_to(top).as_posix() not in callers:
            assert "vnca.cli" not in path.read_text(), path


@pytest.mark.parametrize("name", vnca.__all__)
def test_every_name_is_there_and_listed(name: str) -> None:
    assert getattr(vnca, name) is not None
    assert name in dir(vnca)


def test_a_name_is_the_thing_itself() -> None:
    from vnca.core.volume import Volume
    from vnca.painting import stylize
    from vnca.recipe import stylizing
    from vnca.rendering.view import render

    assert vnca.Volume is Volume
    assert vnca.stylize is stylizing.stylize
    assert vnca.render_view is render
    assert vnca.stylize_frames is stylize


def test_no_name_is_hidden_by_a_subpackage() -> None:
    modules = {path.stem for path in ROOT.iterdir()}
    assert not modules & set(vnca.__all__)
    for module in sorted(modules - {"__init__", "__main__", "__pycache__", "data"}):
        importlib.import_module(f"vnca.{module}")
    assert all(not hasattr(getattr(vnca, name), "__path__") for name in vnca.__all__)


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse((ROOT / "__init__.py").read_text())
    (block,) = (
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    seen = {
        alias.asname or alias.name: (node.module, alias.name)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(seen) == sorted(vnca.__all__)
    for name, (module, own) in seen.items():
        assert getattr(vnca, name) is getattr(importlib.import_module(str(module)), own)


def test_other_names_are_refused() -> None:
    with pytest.raises(AttributeError, match=r"vnca.*'draw'"):
        vnca.draw  # type: ignore[attr-defined]  # noqa: B018
