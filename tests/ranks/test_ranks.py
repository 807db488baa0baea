"""What ranks tell each other: as threads of one program, and as programs of MPI."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from tests.cli.test_stylize_ranks import launcher

from vnca.ranks import Alone, RankError, Ranks
from vnca.ranks.threads import together

ROOT = Path(__file__).parents[2]
LARGE = 300_000  # more than is sent without being asked for


def check(ranks: Ranks) -> None:
    """All that ranks can do, as each of them sees it."""
    rank, size = ranks.rank, ranks.size
    assert ranks.every(("from", rank)) == [("from", each) for each in range(size)]
    assert ranks.leads is (rank == 0)
    for count in (0, 3, LARGE):
        for dtype in (np.float32, np.int64):
            # Each sends to those after it, of its own kind and size.
            going = {to: np.full((count + rank, 2), 10 * rank + to, dtype) for to in ranks.others}
            coming = {of: np.empty((count + of, 2), dtype) for of in ranks.others}
            swap = ranks.swap(going, coming)
            swap.poll()
            swap.wait()
            swap.wait()
            for of, array in coming.items():
                assert (array == 10 * of + rank).all()
    found: list[object] = []
    ranks.gather([(rank, at) for at in range(rank)], found.append)
    every = [(of, at) for at in range(size) for of in range(at + 1, size)]
    assert found == (every if rank == 0 else [])
    assert ranks.sent.messages >= 6 * (size - 1)
    assert ranks.sent.bytes >= 2 * LARGE * (4 + 8) * (size - 1)


@pytest.mark.parametrize("size", [1, 2, 4])
def test_threads(size: int) -> None:
    together(size, check)


def test_who_is_alone_has_nobody_to_tell() -> None:
    ranks = Alone()
    assert ranks.every(3) == [3]
    ranks.swap({}, {}).wait()
    ranks.gather([1, 2], lambda _: pytest.fail("nobody gives anything"))
    assert ranks.others == []


def test_one_that_fails_ends_the_others() -> None:
    def work(ranks: Ranks) -> None:
        if ranks.rank == 1:
            raise ZeroDivisionError
        with pytest.raises(RankError):
            ranks.every(0)
        raise RankError("rank 1 has ended")

    with pytest.raises(ZeroDivisionError):
        together(3, work)


def test_programs_of_mpi() -> None:
    program = "from vnca.ranks import launched; from tests.ranks.test_ranks import check; "
    program += "check(launched()); print('as it should be')"
    done = subprocess.run(
        [*launcher(3), "-c", program],
        capture_output=True,
        text=True,
        timeout=300,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("as it should be") == 3
