"""The command line as it is without what only training needs."""

import os
import subprocess
import sys

# What only training needs: nothing of it may be imported to apply a style or to film.
TRAINING_ONLY = ("torch", "scipy", "h5py", "av", "OpenEXR", "tensorboard", "jaxtyping")
WITHOUT = """
import sys
class Without:
    def __init__(self, finder):
        self.finder = finder
    def __getattr__(self, name):
        return getattr(self.finder, name)
    def find_spec(self, name, *where):
        is_absent = name.partition(".")[0] in PACKAGES or name == ABSENT
        return None if is_absent else self.finder.find_spec(name, *where)
sys.meta_path[:] = map(Without, sys.meta_path)
from vnca.cli import main
sys.exit(main(sys.argv[1:]))
"""


def without_training(
    *arguments: object, absent: str = "", packages: tuple[str, ...] = TRAINING_ONLY
) -> subprocess.CompletedProcess[str]:
    """Runs the command line where only the core dependencies are, and not the module `absent`.

    Args:
        *arguments: The command.
        absent: A module that is not there either.
        packages: Packages that are not there.
    """
    told = f"ABSENT, PACKAGES = {absent!r}, {packages!r}"
    command = [sys.executable, "-c", f"{told}{WITHOUT}", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, env=os.environ)
