"""Several styles in one rule, against a rule for each: what they cost, and how near they come.

    python benchmarks/styles_together.py WORK FRAME PICTURE PICTURE … [--on-smoke] [-- OPTION …]

Trains a solid texture of each picture alone and one of all together (with --on-smoke, the whole of
`vnca train` on FRAME), with the options given. Then each paints FRAME, and its style score is that
of `vnca evaluate`, in points of 100. Times are processor seconds of all threads: a busy machine
favours neither. What is in the folder WORK already is not trained again.
"""

import argparse
import json
import resource
import subprocess
import sys
from pathlib import Path

import vnca
from vnca.rule.model import CONFIG_NAME
from vnca.rule.styles import alone, names_of

TOGETHER, SECONDS = "together", "processor_seconds.json"
MOST_TRAININGS, MOST_POINTS = 3, 5
"""What the rule of all may cost, in trainings of one, and by how much a style may be farther."""


def main() -> None:
    """Train what is missing, measure, and print a line for each style."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("work", type=Path)
    parser.add_argument("frame", type=Path)
    parser.add_argument("pictures", type=Path, nargs="+")
    parser.add_argument("--on-smoke", action="store_true")
    own, options = sys.argv[1:], []
    if "--" in own:
        own, options = own[: own.index("--")], own[own.index("--") + 1 :]
    asked = parser.parse_args(own)
    command = ["train", str(asked.frame)] if asked.on_smoke else ["texture", "train"]
    names = names_of(asked.pictures)

    def trained(name: str, pictures: list[Path]) -> tuple[Path, float]:
        run = asked.work / name
        return run, seconds_of([*command, *map(str, pictures), "--out", str(run), *options], run)

    singles = [trained(name, [p]) for name, p in zip(names, asked.pictures, strict=True)]
    whole, cost = trained(TOGETHER, asked.pictures)
    mean = sum(seconds for _, seconds in singles) / len(singles)
    print(f"{'':20}{'alone':>8}{'together':>10}{'points':>8}{'seconds alone':>15}")
    worst = 0.0
    for number, ((run, seconds), picture) in enumerate(zip(singles, asked.pictures, strict=True)):
        models = vnca.load(run), alone(vnca.load(whole), number)
        one, all_ = (100 * score(model, asked.frame, picture) for model in models)
        worst = max(worst, one - all_)
        print(f"{names[number]:20}{one:8.1f}{all_:10.1f}{all_ - one:8.1f}{seconds:15.0f}")
    iterations = json.loads((whole / CONFIG_NAME).read_text())["config"]["iterations"]
    print(
        f"together: {cost:.0f} seconds, {cost / mean:.2f} trainings of one (at most "
        f"{MOST_TRAININGS}), {iterations} iterations; farthest behind: {worst:.1f} points (at most "
        f"{MOST_POINTS})"
    )


def seconds_of(command: list[str], run: Path) -> float:
    """Train unless it was done before, and tell how many processor seconds it took."""
    told = run / SECONDS
    if not told.exists():
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, "-m", "vnca", *command, "--overwrite"], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        told.write_text(json.dumps(spent))
    return json.loads(told.read_text())


def score(model: vnca.Model, frame: Path, picture: Path) -> float:
    """How near a frame painted with a model comes to a picture: 1 is as near as its own parts."""
    found = vnca.evaluate(model, frame, style=picture, device="cpu")["style.score"]
    assert found is not None, "there is smoke in the frame"
    return found


if __name__ == "__main__":
    main()
