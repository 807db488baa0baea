"""A step in bricks by every instruction set that this machine has, in turns.

Prints nanoseconds of one processor a changing cell, what part that is of the multiply-adds that
these instructions can do, and how many times as quick it is as the last of the same precision.
"""

import argparse
import time

import numpy as np

from vnca.core import Box
from vnca.engine import PRECISIONS, native
from vnca.engine.automaton import changing_rows
from vnca.engine.domain import Domain
from vnca.engine.native import bricks
from vnca.rule import Rule, RuleConfig, Scales

ROUNDS = 100_000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edge", type=int, default=48, help="cells along a box that is alive")
    parser.add_argument("--hidden", type=int, default=128)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--precisions", nargs="+", choices=PRECISIONS, default=PRECISIONS)
    options = parser.parse_args()
    edge = options.edge
    domain = Domain.filling(Box((0, 0, 0), (edge, edge, edge)))
    rule = Rule.initial(RuleConfig(hidden=options.hidden), Scales(), seed=0)
    automaton, random = rule.automaton(0), np.random.default_rng(0)
    state = random.standard_normal((len(domain) + 1, rule.config.channels)).astype(np.float32)
    state[-1] = 0
    priors = random.standard_normal((len(domain), rule.config.conditioning_width))
    arrays = (state, domain.around, domain.hashes.view(np.int32), priors.astype(np.float32))
    rows = changing_rows(domain.hashes, seed=0, step=0, probability=automaton.update_probability)
    inputs = automaton.weights.hidden.shape[1]
    needed = 2 * options.hidden * (inputs + rule.config.channels) * len(rows)
    for precision in options.precisions:
        if native.unavailable(precision) is not None:
            continue
        names = native.instructions(precision)
        step: dict[str, list[float]] = {name: [] for name in names}
        peak: dict[str, list[float]] = {name: [] for name in names}
        for _ in range(options.repeats):
            for name in names:
                how = {"precision": precision, "instructions": name, "threads": 1}
                begun = time.thread_time()
                bricks.forward(*arrays, automaton, 0, **how)
                step[name].append(time.thread_time() - begun)
                begun = time.thread_time()
                done = native.multiply_adds(ROUNDS, **how)
                peak[name].append((time.thread_time() - begun) / done)
        for name in names:
            took, share = min(step[name]), needed * min(peak[name]) / min(step[name])
            print(
                f"{precision:9} {name:11} {took / len(rows) * 1e9:7.1f} ns a changing cell, "
                f"{share:5.1%} of {1e-9 / min(peak[name]):6.0f} GFLOP/s, "
                f"{min(step[names[-1]]) / took:4.2f} times as quick as {names[-1]}"
            )


if __name__ == "__main__":
    main()
