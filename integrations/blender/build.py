# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the extension: a zip for each platform and Python of Blender, and their index.

`python build.py --blender PYTHON --wheels DIR --out DIR [--platform NAME …]`. A zip has the wheel
of vnca that `tools/wheels.py` or cibuildwheel made for its platform and Python; where there is
none, one without the native kernel, which paints in numpy. pip fetches what vnca needs. Blender's
own program packs, checks and lists the zips: PYTHON has the package `bpy`.
"""

import argparse
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
    parser.add_argument("--wheels", type=Path, required=True, help="folder of wheels of vnca")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for old in options.out.glob("*.zip"):
        old.unlink()
    program = extension_program(options.blender)
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        anywhere = wheel_without_kernel(folder / "any")
        for python, blenders in BLENDERS.items():
            for name in options.platform:
                wheel = made_wheel(options.wheels, name, python) or anywhere
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


def made_wheel(folder: Path, name: str, python: str) -> Path | None:
    """The wheel of vnca for a platform and Python among those that were made before.

    From Python 3.12 on it is that of the stable ABI.
    """
    minor = int(python.partition(".")[2])
    tags = "cp312-abi3" if minor >= 12 else f"cp3{minor}-cp3{minor}"
    where = re.sub(r"_\d+_\d+_", "*", PLATFORMS[name][0])  # whatever version of the system
    return next(iter(sorted(folder.glob(f"vnca-{version()}-{tags}-{where}.whl"))), None)


def wheel_without_kernel(folder: Path) -> Path:
    """A wheel of vnca for any platform."""
    words = ["-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    for setting in ("wheel.py-api=py3", "wheel.cmake=false"):
        words += ["--config-settings", setting]
    run(sys.executable, *words, "--wheel-dir", folder, ROOT)
    (wheel,) = folder.glob("vnca-*.whl")
    return wheel


def version() -> str:
    """Of vnca, and so of the extension."""
    found = re.search(r'(?m)^version = "(.*)"', (ROOT / "pyproject.toml").read_text("utf-8"))
    assert found is not None, "pyproject.toml has a version"
    return found[1]


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
