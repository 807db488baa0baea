"""What a wheel holds, and where the native kernel is left out; `make wheels` tries whole ones."""

import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from email.message import Message
from email.parser import Parser
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CMAKE = shutil.which("cmake") or shutil.which("cmake", path=str(Path(sys.executable).parent))


def configured(folder: Path, *options: str, **environment: str) -> str:
    """What CMake says; nothing is compiled but its own probes."""
    assert CMAKE is not None
    packages = subprocess.run(
        [sys.executable, "-m", "nanobind", "--cmake_dir"], capture_output=True, text=True
    )
    words = (CMAKE, "-S", ROOT, "-B", folder, f"-Dnanobind_DIR={packages.stdout.strip()}")
    done = subprocess.run(
        [*map(str, words), f"-DPython_EXECUTABLE={sys.executable}", *options],
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
    )
    assert done.returncode == 0, done.stderr
    return " ".join(done.stderr.split())


@pytest.mark.skipif(CMAKE is None, reason="no CMake")
def test_compilers_with_microsofts_options_build_no_kernel(tmp_path: Path) -> None:
    # As CMake has it where cl or clang-cl is the compiler.
    assert "vnca is installed without it" in configured(tmp_path, "-DMSVC=1")
    assert not list(tmp_path.glob("**/operations.dir"))


@pytest.mark.skipif(CMAKE is None or shutil.which("clang++") is None, reason="no Clang")
def test_clang_builds_it(tmp_path: Path) -> None:
    said = configured(tmp_path, CC="clang", CXX="clang++")
    assert "installed without" not in said
    assert list(tmp_path.glob("**/operations.dir"))
    cache = (tmp_path / "CMakeCache.txt").read_text()
    assert "clang++" in next(line for line in cache.splitlines() if "CMAKE_CXX_COMPILER:" in line)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[zipfile.ZipFile]:
    """The wheel without its kernel, which takes minutes to compile."""
    folder = tmp_path_factory.mktemp("wheel")
    words = ("-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation")
    for setting in ("wheel.cmake=false", "wheel.py-api=py3"):
        words += ("--config-settings", setting)
    done = subprocess.run(
        [sys.executable, *words, "--wheel-dir", folder, ROOT], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    (path,) = folder.glob("vnca-*.whl")
    with zipfile.ZipFile(path) as file:
        yield file


def metadata(wheel: zipfile.ZipFile) -> Message:
    (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    return Parser().parsestr(wheel.read(name).decode())


def test_a_wheel_has_the_whole_package_but_the_sources_of_the_kernel(
    wheel: zipfile.ZipFile,
) -> None:
    sources = ROOT / "src"
    wanted = {path.relative_to(sources).as_posix() for path in sources.rglob("*") if path.is_file()}
    wanted = {name for name in wanted if not name.endswith((".cpp", ".hpp", ".pyc", ".so"))}
    assert {name for name in wheel.namelist() if name.startswith("vnca/")} == wanted
    assert {"vnca/data/styles/ink.safetensors", "vnca/viewer/page/index.html"} <= wanted
    (others,) = {name.partition("/")[0] for name in wheel.namelist()} - {"vnca"}
    assert others == f"vnca-{PROJECT['version']}.dist-info"
    assert f"{others}/licenses/LICENSE" in wheel.namelist()
    (entry,) = (name for name in wheel.namelist() if name.endswith("entry_points.txt"))
    assert "vnca=vnca.cli:main" in wheel.read(entry).decode().replace(" ", "")


def test_its_metadata_are_those_of_the_project(wheel: zipfile.ZipFile) -> None:
    told = metadata(wheel)
    assert (told["Name"], told["Version"]) == ("vnca", PROJECT["version"])
    assert told["Requires-Python"] == PROJECT["requires-python"]
    assert told["License-Expression"] == PROJECT["license"]
    assert told["Description-Content-Type"] == "text/markdown"
    assert told.get_payload() == (ROOT / "README.md").read_text(encoding="utf-8")
    needed = told.get_all("Requires-Dist", [])
    core = [each for each in needed if "extra ==" not in each]
    names = sorted(each.replace("(", "").split(">")[0].strip() for each in core)
    assert names == ["blosc", "numpy", "pillow", "safetensors", "tomli", "tyro"]
    assert set(told.get_all("Provides-Extra", [])) == set(PROJECT["optional-dependencies"])
    assert not [each for each in needed if "@" in each]  # an address no index would take
