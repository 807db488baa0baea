import time
from collections.abc import Callable
from itertools import groupby

from vnca.bench.timing import Spread, in_turns, seconds


def test_kinds_of_work_take_turns() -> None:
    done: list[str] = []

    def begin(name: str) -> Callable[[], Callable[[], object]]:
        def work() -> None:
            done.append(name)
            time.sleep(0.02)

        return lambda: work

    times = in_turns({"a": begin("a"), "b": begin("b")}, "cpu", repeats=3)
    assert [name for name, _ in groupby(done)] == ["a", "b"] * 3
    assert [len(taken) for taken in times.values()] == [3, 3]


def test_what_comes_before_the_work_is_not_timed() -> None:
    def begin() -> Callable[[], object]:
        time.sleep(1.0)
        return lambda: time.sleep(0.1)

    assert 0.1 <= seconds(begin, "cpu") < 0.9


def test_short_work_is_repeated_so_that_waking_up_does_not_count() -> None:
    calls = []
    seconds(lambda: lambda: calls.append(time.sleep(0.01)), "cpu")
    assert len(calls) > 5


def test_a_spread_is_of_the_extremes_and_the_middle() -> None:
    assert Spread.of([5.0, 1.0, 2.0]) == (1, 2, 5)
