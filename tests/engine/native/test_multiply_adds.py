"""What a processor could do at most, by each instruction set."""

import pytest

from vnca.engine import PRECISIONS, native

SETS = [
    (precision, name)
    for precision in PRECISIONS
    if native.unavailable(precision) is None
    for name in native.instructions(precision)
]


@pytest.mark.parametrize(("precision", "instructions"), SETS)
def test_operations_are_counted_by_rounds_and_threads(precision: str, instructions: str) -> None:
    def done(rounds: int, threads: int) -> float:
        how = {"precision": precision, "instructions": instructions}
        return native.multiply_adds(rounds, threads=threads, **how)

    assert done(1, 1) > 0
    assert done(7, 3) == 21 * done(1, 1)
