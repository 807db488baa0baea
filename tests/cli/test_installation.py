"""What `pip install .` brings without extras, and that it paints; needs a package index."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
MOST_BYTES = 60e6

pytestmark = pytest.mark.slow


def run(*command: object, **variables: str) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [str(word) for word in command],
        capture_output=True,
        text=True,
        timeout=600,
        env=os.environ | variables,
    )
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All wheels that `pip install .` would install."""
    folder = tmp_path_factory.mktemp("wheels")
    run(sys.executable, "-m", "pip", "wheel", "--wheel-dir", folder, ROOT)
    return folder


def test_it_is_a_small_download(wheels: Path) -> None:
    sizes = {path.name: path.stat().st_size for path in wheels.iterdir()}
    assert sum(sizes.values()) < MOST_BYTES, sizes
    print(f"{sum(sizes.values()) / 1e6:.1f} MB:", sizes)


@pytest.mark.parametrize("compiler", ["", "/bin/false"], ids=["compiler", "no compiler"])
def test_it_installs_and_paints_with_and_without_a_compiler(
    wheels: Path, compiler: str, model: Path, smoke: Path, tmp_path: Path
) -> None:
    built = wheels
    if compiler:
        built = tmp_path / "built"
        pip_wheel = ("-m", "pip", "wheel", "--no-deps", "--wheel-dir", built)
        run(sys.executable, *pip_wheel, ROOT, CXX=compiler)
    run(sys.executable, "-m", "venv", tmp_path / "venv")
    programs = tmp_path / "venv" / "bin"
    pip_install = ("-m", "pip", "install", "--no-index", "--find-links", wheels)
    run(programs / "python", *pip_install, *built.glob("vnca-*.whl"))
    out = tmp_path / "painted"
    done = run(programs / "vnca", "stylize", model, smoke, "--out", out, "--warmup", 4)
    assert len(list(out.iterdir())) == 3
    assert done.stderr.count("running the slow numpy step") == bool(compiler)
