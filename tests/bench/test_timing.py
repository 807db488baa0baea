import time
from collections.abc import Callable

from vnca.bench.timing import Spread, in_turns, seconds


def test_kinds_of_work_take_turns() -> None:
    done: list[str] = []

    def begin(name: str) -> Callable[[], Callable[[], object]]:
        return lambda: lambda: done.append(name)

    times = in_turns({"a": begin("a"), "b": begin("b")}, "cpu", repeats=3)
    assert done == ["a", "b"] * 3
    assert [len(taken) for taken in times.values()] == [3, 3]


def test_what_comes_before_the_work_is_not_timed() -> None:
    def begin() -> Callable[[], object]:
        time.sleep(0.3)
        return lambda: time.sleep(0.01)

    assert 0.01 <= seconds(begin, "cpu") < 0.25


def test_a_spread_is_of_the_extremes_and_the_middle() -> None:
    assert Spread.of([5.0, 1.0, 2.0]) == (1, 2, 5)
