"""`vnca bench step`."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from vnca.bench.step import TOLERANCES, StepConfig, StepRun, measure_steps, prepare
from vnca.cli.bench_options import Tables, parse_bench, short


@dataclass(frozen=True)
class Step(Tables):
    """Time one step of the automaton in every backend, in turns, in one run.

    Times are per active cell. GFLOP/s count the matrix products that are needed, the same for
    every backend. If backends disagree with the reference in float64, nothing is timed.
    """

    config: StepConfig = field(default_factory=StepConfig)
    """What is measured."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and measure."""
    bench_step(parse_bench("step", Step, arguments))


def bench_step(options: Step) -> None:
    """Measure as asked, print what was found and keep it.

    Raises:
        VncaError: If something cannot be measured or written, or backends disagree.
    """
    options.require_writable()
    facts = prepare(options.config)
    options.print("{device}, {threads} threads, torch {torch}, vnca {vnca}".format(**facts))
    rows = []
    for run in measure_steps(options.config):
        options.print("\n".join(_table(run)))
        rows += run.rows
    peaks = {name: rows[0][name] for name in ("gemm_gflops", "copy_gbs")}
    options.keep(facts, rows, peaks)


def _table(run: StepRun) -> list[str]:
    first, plain = run.rows[0], {r["pass"]: r for r in run.rows if r["backend"] == "plain"}
    to_state, to_gradients = TOLERANCES[run.dtype]
    lines = [
        "",
        f"{run.dtype}, {first['grid']} cells, {first['occupancy']:.1%} active, hidden "
        f"{first['hidden']}",
        f"peaks: GEMM {run.gemm_gflops:.1f} GFLOP/s, copy {run.copy_gbs:.1f} GB/s",
        f"all agree with the reference in float64: states to {to_state:.0e}, gradients to "
        f"{to_gradients:.0e} of their norm",
        f"{'backend':10}{'pass':9}{'ns a cell (min to max)':>32}{'GFLOP/s':>10}{'of GEMM':>9}"
        f"{'of copy':>9}{'MB':>9}{'against plain':>15}",
    ]
    for row in run.rows:
        took = short(row["ns_per_cell"])
        spread = f"({short(row['ns_per_cell_min'])} to {short(row['ns_per_cell_max'])})"
        gain = ""
        if row["pass"] in plain:
            gain = f"{plain[row['pass']]['ns_per_cell'] / row['ns_per_cell']:.1f}×"
        lines.append(
            f"{row['backend']:10}{row['pass']:9}{took:>10} {spread:>21}"
            f"{row['gflops']:>10.1f}{row['share_of_gemm']:>9.1%}{row['share_of_copy']:>9.1%}"
            f"{short(row['peak_mb']):>9}{gain:>15}"
        )
    return lines
