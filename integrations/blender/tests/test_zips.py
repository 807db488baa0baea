# SPDX-License-Identifier: GPL-3.0-or-later
"""The zips of all platforms, without the platforms: what they list, hold, and would import."""

import ast
import json
import os
import re
import sys
import zipfile
from pathlib import Path

import pytest
import tomllib

REPOSITORY = Path(os.environ["VNCA_ZIP"]).parent
ZIPS = sorted(REPOSITORY.glob("vnca-*.zip"))
RUNS_ON = {
    "linux-x64": r"manylinux\w+_x86_64|linux_x86_64",
    "windows-x64": "win_amd64",
    "macos-arm64": r"macosx_1[12]_0_(arm64|universal2)",
    "macos-x64": r"macosx_10_\d+_(x86_64|universal2)",
}
COMPILED = {"linux": ".so", "windows": ".pyd", "macos": ".so"}
BEGINNINGS = (
    *("worker/__main__.py", "worker/picture.py", "worker/staging.py", "vnca/cli/paint.py"),
    *(
        "vnca/cli/info.py",
        "vnca/recipe/paint.py",
        "vnca/recipe/painting.py",
        "vnca/engine/numpy.py",
    ),
)
"""What runs to paint; all that these import, on and on, has to be inside."""
_DEPENDS = r"TYPE_CHECKING|version_info|platform"
"""Conditions under which a module may be imported that need not be there."""
BROUGHT = {*sys.stdlib_module_names, "numpy"}
"""What Blender brings."""


def imported(path: Path, package: str) -> set[str]:
    """Modules that a module needs to be imported: not what functions or `try` import."""
    found: set[str] = set()
    waiting: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join([*(above if node.level else []), *filter(None, [node.module])])
            found |= {base} | {f"{base}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.If) and re.search(_DEPENDS, ast.unparse(node.test)):
            continue
        elif not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda, ast.Try)):
            waiting += ast.iter_child_nodes(node)
    return found


def home_of(name: str, roots: list[Path], ending: str) -> Path | None:
    """The file of a module, compiled or not; None if it is nowhere."""
    for root in roots:
        path = root.joinpath(*name.split("."))
        like = sorted(path.parent.glob(f"{path.name}.*"))
        compiled = [file for file in like if file.name.endswith(ending)]
        for file in (path / "__init__.py", path.with_suffix(".py"), *compiled):
            if file.is_file():
                return file
    return None


def platform_of(path: Path) -> tuple[str, str]:
    found = re.fullmatch(r"vnca-[\d.]+-(\w+-\w+)-py(\d)(\d+)\.zip", path.name)
    assert found is not None
    return found[1], f"{found[2]}.{found[3]}"


def test_there_is_one_for_each_platform_and_python() -> None:
    there = {platform_of(path) for path in ZIPS}
    assert there == {(name, python) for name in RUNS_ON for python in ("3.11", "3.13")}


@pytest.mark.parametrize("path", ZIPS, ids=lambda path: path.stem)
def test_manifest_and_wheels_fit_platform_and_python(path: Path) -> None:
    name, python = platform_of(path)
    minor = int(python.partition(".")[2])
    with zipfile.ZipFile(path) as file:
        manifest = tomllib.loads(file.read("blender_manifest.toml").decode())
        names = file.namelist()
        assert manifest["platforms"] == [name]
        first, beyond = manifest["blender_version_min"], manifest.get("blender_version_max")
        assert (first, beyond) == (("4.2.0", "5.1.0") if python == "3.11" else ("5.1.0", None))
        assert len(manifest["tagline"]) <= 64
        assert not manifest["tagline"].endswith(".")
        assert all(len(reason) <= 64 for reason in manifest["permissions"].values())
        wheels = [one.removeprefix("./") for one in manifest["wheels"]]
        assert sorted(wheels) == sorted(one for one in names if one.endswith(".whl"))
        assert {"LICENSE", "__init__.py", "worker/__main__.py"} <= set(names)
        assert not [one for one in names if "__pycache__" in one or "tests/" in one]
        for wheel in wheels:
            *_, tag, abi, where = Path(wheel).stem.split("-")
            fits = [re.fullmatch(RUNS_ON[name], one) for one in where.split(".")]
            assert where == "any" or any(fits), wheel
            oldest = max(int(one) for one in re.findall(r"cp3(\d+)", tag) or ["0"])
            assert abi in ("none", f"cp3{minor}") or (abi == "abi3" and oldest <= minor), wheel
            with file.open(wheel) as stream, zipfile.ZipFile(stream) as packed:
                assert packed.testzip() is None
                built = [one for one in packed.namelist() if one.endswith((".so", ".pyd"))]
                ending = COMPILED[name.partition("-")[0]]
                assert all(one.endswith(ending) for one in built), wheel
                assert (abi == "none" and where == "any") == (not built), wheel


@pytest.mark.parametrize("path", ZIPS, ids=lambda path: path.stem)
def test_what_painting_imports_is_inside(path: Path, tmp_path: Path) -> None:
    ending = COMPILED[platform_of(path)[0].partition("-")[0]]
    with zipfile.ZipFile(path) as file:
        file.extractall(tmp_path)
    for wheel in (tmp_path / "wheels").iterdir():
        with zipfile.ZipFile(wheel) as packed:
            packed.extractall(tmp_path)
    roots = [tmp_path, tmp_path / "worker"]
    waiting, seen, compiled = [tmp_path / name for name in BEGINNINGS], set(), set()
    while waiting:
        file = waiting.pop()
        if file in seen:
            continue
        seen.add(file)
        if file.suffix != ".py":
            compiled.add(file.relative_to(tmp_path).parts[0])
            continue
        package = ".".join(file.parent.relative_to(tmp_path).parts)
        for name in imported(file, package):
            if name.partition(".")[0] in BROUGHT:
                continue
            home = home_of(name, roots, ending)
            # `from a.b import c`: where c is no module it is in a.b.
            known = home or home_of(name.rpartition(".")[0], roots, ending)
            assert known is not None, f"{file.relative_to(tmp_path)}: {name}"
            if home is not None:
                waiting.append(home)
    assert len(seen) > 100
    assert "blosc" in compiled


def test_the_index_lists_them_with_their_hashes() -> None:
    import hashlib

    told = json.loads((REPOSITORY / "index.json").read_text())
    listed = {Path(one["archive_url"]).name: one for one in told["data"]}
    assert set(listed) == {path.name for path in ZIPS}
    for path in ZIPS:
        one = listed[path.name]
        assert one["archive_hash"] == "sha256:" + hashlib.sha256(path.read_bytes()).hexdigest()
        assert one["archive_size"] == path.stat().st_size
        assert one["platforms"] == [platform_of(path)[0]]
