"""What is written beside the painting of the next frame."""

import threading
from collections.abc import Callable, Iterator
from functools import partial

import pytest

from vnca.painting.behind import one_behind

LONG = 20.0  # seconds, of what would hang were it not beside the rest


def given(number: int) -> int:
    return number


def test_a_frame_is_written_while_the_next_is_painted() -> None:
    painted = threading.Event()

    def written() -> bool:
        return painted.wait(LONG)

    def jobs() -> Iterator[Callable[[], bool]]:
        yield written
        painted.set()
        yield bool

    assert list(one_behind(jobs())) == [True, False]


def test_results_come_in_order_and_one_after_the_next_was_made() -> None:
    made = []

    def jobs() -> Iterator[Callable[[], int]]:
        for number in range(4):
            made.append(number)
            yield partial(given, number)

    told = [(result, made[-1]) for result in one_behind(jobs())]
    assert told == [(0, 1), (1, 2), (2, 3), (3, 3)]


@pytest.mark.parametrize("ending", [ValueError, KeyboardInterrupt])
def test_what_was_written_is_told_before_what_went_wrong_in_the_next(
    ending: type[BaseException],
) -> None:
    def jobs() -> Iterator[Callable[[], int]]:
        yield partial(given, 7)
        raise ending

    results = one_behind(jobs())
    assert next(results) == 7
    with pytest.raises(ending):
        next(results)


def test_nothing_is_written_after_what_could_not_be() -> None:
    written = []

    def jobs() -> Iterator[Callable[[], object]]:
        yield partial(written.append, 1)
        yield partial(int, "no number")
        yield partial(written.append, 3)

    results = one_behind(jobs())
    next(results)
    with pytest.raises(ValueError, match="no number"):
        next(results)
    assert written == [1]


def test_an_end_waits_for_what_has_begun() -> None:
    begun, may_end, ended = threading.Event(), threading.Event(), []

    def slow() -> None:
        begun.set()
        may_end.wait(LONG)
        ended.append(True)

    def jobs() -> Iterator[Callable[[], object]]:
        yield int
        yield slow
        yield int

    results = one_behind(jobs())
    next(results)
    assert begun.wait(LONG)
    threading.Timer(0.05, may_end.set).start()
    results.close()
    assert ended == [True]
