"""How far `vnca plan` is from what painting then takes: time, memory and disk.

    python benchmarks/plan.py SEQUENCE MODEL [--frames 30-53] [--refine 2] [OPTIONS OF SMOKE]

Paints into a temporary folder, in a process of its own, on the machine as it is: of time, only a
quiet one tells.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def main() -> None:
    """Predict, paint, and print both."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("sequence")
    parser.add_argument("model")
    parser.add_argument("--again", action="store_true", help="measure the costs of cells again")
    asked, options = parser.parse_known_args()
    vnca = [sys.executable, "-m", "vnca"]
    again = ["--again"] * asked.again
    words = ["plan", asked.sequence, "--model", asked.model, "--json", *options, *again]
    told = json.loads(subprocess.run([*vnca, *words], check=True, stdout=subprocess.PIPE).stdout)
    with tempfile.TemporaryDirectory() as folder:
        begun = time.monotonic()
        process = subprocess.Popen(
            [*vnca, "stylize", asked.model, asked.sequence, "--out", folder, *options]
        )
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.monotonic() - begun
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            sys.exit(process.returncode)
        disk = sum(path.stat().st_size for path in Path(folder).glob("*.vdb"))
    memory = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    for name, measured in (("seconds", seconds), ("memory", memory), ("disk", disk)):
        planned = told["plan"][name]
        print(f"{name:8} planned {planned:.5g}, measured {measured:.5g}: {planned / measured:.2f}")


if __name__ == "__main__":
    main()
