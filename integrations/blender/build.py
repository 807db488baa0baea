# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the extension: a zip for each platform and Python of Blender, and their index.

`python build.py --blender PYTHON --out DIR [--platform NAME …]`. Wheels of vnca are built here,
with the native kernel for this platform and without it for others; pip fetches what vnca needs.
Blender's own program packs, checks and lists the zips: PYTHON has the package `bpy`.
"""

import argparse
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_11_0_arm64",),
    "macos-x64": ("macosx_10_13_x86_64", "macosx_10_9_x86_64"),
}
"""Blender's names, and pip's tags of wheels that run there."""
BLENDERS = {"3.11": ("4.2.0", "5.1.0"), "3.13": ("5.1.0", None)}
"""Pythons, with the Blenders that have them: from this one on, up to that one."""
NEEDED = (
    "blosc",
    "docstring-parser",
    "pillow",
    "safetensors",
    "typeguard",
    "typing-extensions",
    "tyro",
)
"""What vnca needs to paint, but for numpy, which Blender brings."""
LOCK = ROOT / "requirements" / "dev.txt"
OURS = "__pycache__", "*.pyc"


def main() -> None:
    """Build what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blender", required=True, help="a Python that has bpy")
    parser.add_argument("--out", type=Path, required=True, help="folder for zips and index")
    parser.add_argument("--platform", nargs="*", choices=PLATFORMS, default=list(PLATFORMS))
    parser.add_argument("--wheels", type=Path, help="folder of wheels that cibuildwheel made")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for old in options.out.glob("*.zip"):
        old.unlink()
    program = extension_program(options.blender)
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        anywhere = build_wheel(sys.executable, folder / "any", native=False)
        for python, blenders in BLENDERS.items():
            here = None
            if not options.wheels and this_platform() in options.platform:
                here = native_wheel(python, folder / f"native{python}")
            for name in options.platform:
                made = made_wheel(options.wheels, name, python)
                wheel = made or (here if here and name == this_platform() else anywhere)
                source = folder / f"{name}-{python}"
                fill(source, wheel, name, python, blenders)
                path = options.out / f"vnca-{version()}-{name}-py{python.replace('.', '')}.zip"
                words = ("build", "--source-dir", source, "--output-filepath", path)
                run(options.blender, program, *words)
                run(options.blender, program, "validate", path)
                print(f"{path.name}: {path.stat().st_size / 1e6:.1f} MB, {wheel.name}", flush=True)
    run(options.blender, program, "server-generate", "--repo-dir", options.out, "--html")


def fill(
    folder: Path, wheel: Path, name: str, python: str, blenders: tuple[str, str | None]
) -> None:
    """Lay out an extension for one platform and Python.

    Args:
        folder: Where to.
        wheel: Of vnca.
        name: Of the platform, as Blender calls it.
        python: Version of Blender's Python.
        blenders: The first version of Blender that has it, and the first that has no longer.
    """
    shutil.copytree(HERE / "extension", folder, ignore=shutil.ignore_patterns(*OURS))
    shutil.copy(HERE / "LICENSE", folder)
    fetch_wheels(folder / "wheels", name, python)
    shutil.copy(wheel, folder / "wheels")
    wheels = sorted(path.name for path in (folder / "wheels").iterdir())
    first, beyond = blenders
    lines = [f'version = "{version()}"', f'platforms = ["{name}"]']
    lines += [f'blender_version_max = "{beyond}"'] if beyond else []
    lines += ["wheels = [", *(f'  "./wheels/{one}",' for one in wheels), "]"]
    manifest = folder / "blender_manifest.toml"
    text = manifest.read_text(encoding="utf-8")
    text = re.sub(r"(?m)^blender_version_min = .*$", f'blender_version_min = "{first}"', text)
    head, permissions = text.split("[permissions]")
    both = f"{head}{chr(10).join(lines)}\n\n[permissions]{permissions}"
    manifest.write_text(both, encoding="utf-8")


def fetch_wheels(folder: Path, name: str, python: str) -> None:
    """What vnca needs on a platform, in the versions of the lock and checked by their hashes."""
    with tempfile.TemporaryDirectory() as text:
        wanted = Path(text) / "needed.txt"
        wanted.write_text("".join(locked(package) for package in NEEDED), encoding="utf-8")
        words = ["download", "--quiet", "--no-deps", "--require-hashes", "-r", wanted]
        words += ["--only-binary", ":all:", "--python-version", python, "--dest", folder]
        for tag in PLATFORMS[name]:
            words += ["--platform", tag]
        run(sys.executable, "-m", "pip", *words)
    fetched = {path.name.partition("-")[0].lower() for path in folder.iterdir()}
    if absent := {package.replace("-", "_") for package in NEEDED} - fetched:
        sys.exit(f"{LOCK}: has no {', '.join(absent)} for Python {python}")


def locked(package: str) -> str:
    """The lines of the lock that pin a package, one pin for some Pythons, another for others."""
    text = LOCK.read_text(encoding="utf-8")
    found = re.finditer(rf"(?m)^{re.escape(package)}==.*(\n    --hash=.*)+\n", text)
    return "".join(match[0] for match in found)


def made_wheel(folder: Path | None, name: str, python: str) -> Path | None:
    """The wheel of vnca for a platform and Python among those that were made before."""
    if folder is None:
        return None
    tag = f"cp{python.replace('.', '')}"
    system, _, machine = name.partition("-")
    ends = {"linux": "manylinux*", "windows": "win*", "macos": "macosx*"}[system]
    machine = {"x64": "*64", "arm64": "*arm64"}[machine]
    found = sorted(folder.glob(f"vnca-{version()}-{tag}-{tag}-{ends}{machine}.whl"))
    return next(
        (path for path in found if path.stem.endswith("arm64") == (machine == "*arm64")), None
    )


def native_wheel(python: str, folder: Path) -> Path | None:
    """A wheel with the kernel for this platform; None where this Python cannot be had here."""
    program = sys.executable
    if version_of(program) != python:
        words = (
            Path(sys.executable).with_name("uv"),
            "python",
            "find",
            "--no-python-downloads",
            "--no-project",
            python,
        )
        program = subprocess.run(words, capture_output=True, text=True).stdout.strip()
        if version_of(program) != python:
            print(f"Python {python}: not here; its zips paint in numpy", flush=True)
            return None
    wheel = build_wheel(program, folder, native=True)
    return None if wheel.name.endswith("-none-any.whl") else wheel


def build_wheel(program: str, folder: Path, *, native: bool) -> Path:
    """A wheel of vnca, with the kernel for this platform and Python, or without one for any."""
    folder.mkdir(parents=True)
    words = ["-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, ROOT]
    if program == sys.executable:
        words.append("--no-build-isolation")
    if not native:
        for setting in ("wheel.py-api=py3", "wheel.cmake=false"):
            words += ["--config-settings", setting]
    run(program, *words)
    (wheel,) = folder.glob("vnca-*.whl")
    return wheel


def version_of(program: str) -> str:
    """Major and minor version of a Python; empty if it does not run."""
    if not program:
        return ""
    code = "import sys; print('%d.%d' % sys.version_info[:2])"
    done = subprocess.run([program, "-c", code], capture_output=True, text=True)
    return done.stdout.strip()


def version() -> str:
    """Of vnca, and so of the extension."""
    found = re.search(r'(?m)^version = "(.*)"', (ROOT / "pyproject.toml").read_text("utf-8"))
    assert found is not None, "pyproject.toml has a version"
    return found[1]


def this_platform() -> str:
    """The name that Blender has for this machine."""
    system = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}[platform.system()]
    machine = {"x86_64": "x64", "AMD64": "x64", "arm64": "arm64", "aarch64": "arm64"}
    return f"{system}-{machine[platform.machine()]}"


def extension_program(blender: str) -> Path:
    """Blender's own program for extensions, inside the package `bpy`."""
    code = "import importlib.util as u; print(u.find_spec('bpy').submodule_search_locations[0])"
    done = subprocess.run([blender, "-c", code], capture_output=True, text=True)
    found = sorted(
        Path(done.stdout.strip()).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    )
    if not found:
        sys.exit(f"{blender}: has no bpy")
    return found[-1]


def run(*command: object) -> None:
    """Run a program that has to succeed."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(words)}:\n{done.stdout}{done.stderr}")


if __name__ == "__main__":
    main()
