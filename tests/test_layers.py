"""Imports go strictly downwards, and only some layers may know torch."""

import ast
from pathlib import Path

import pytest

import vnca

ROOT = Path(vnca.__file__).parent
RANKS = {
    "core": 0,
    "engine": 1, "simulation": 1, "ranks": 1,
    "rule": 2,
    "io": 3, "rendering": 3, "features": 3,
    "direction": 3.5,
    "losses": 4, "painting": 4,
    "meshes": 5,
    "training": 6,
    "metrics": 7, "bench": 7, "viewer": 7,
    "peers": 7,
    "recipe": 8,
    "comparison": 9, "farm": 9,
    "cli": 10, "__main__": 11,
}  # fmt: skip
WITHOUT_TORCH = {"core", "ranks", "rule", "io", "simulation", "direction", "painting"}
WITH_TORCH = {
    "engine": ("tensors.py", "reference/", "triton/", "native/autograd.py"),
    "rendering": ("view.py", "march.py", "native.py", "colour.py"),
}
"""In layers of which the rest is to be had without."""
SOURCES = sorted(p for p in ROOT.rglob("*.py") if p != ROOT / "__init__.py")


def layer(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported_names(path: Path) -> set[str]:
    """Every module imported anywhere in the file, also inside functions."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add(node.module or "")
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return names


def imported_layers(path: Path) -> set[str]:
    parts = [name.split(".") for name in imported_names(path)]
    return {p[1] for p in parts if p[0] == "vnca" and len(p) > 1 and p[1] in RANKS}


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_downwards(path: Path) -> None:
    here = layer(path)
    assert here in RANKS, f"{here} has no rank: add it to the design and to this table"
    for there in imported_layers(path) - {here}:
        assert RANKS[there] < RANKS[here], f"{path.name} ({here}) imports {there}"


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_core_layers_do_not_import_torch(path: Path) -> None:
    here = layer(path)
    where = path.relative_to(ROOT).as_posix().removeprefix(f"{here}/")
    if here in WITHOUT_TORCH or not where.startswith(WITH_TORCH.get(here, "")):
        assert not any(name.split(".")[0] == "torch" for name in imported_names(path))


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_stay_small(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 400


def test_a_folder_has_no_more_files_than_a_reader_can_know() -> None:
    for folder in {path.parent for path in SOURCES}:
        files = list(folder.glob("*.py"))
        assert len(files) <= 15, f"{folder.name} has {len(files)} files"
