"""How the native kernel is left out where its options would not be understood, and metadata."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
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
