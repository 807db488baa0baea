"""Reading the next frame while this one is computed."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")


def read_ahead(loads: Iterable[Callable[[], T]]) -> Iterator[T]:
    """The results of `loads` in order, each computed in a thread one ahead of its use.

    At most two results exist at a time. An exception is raised where its result would have been.
    """
    with ThreadPoolExecutor(max_workers=1) as reader:
        pending = None
        for load in loads:
            following = reader.submit(load)
            if pending is not None:
                yield pending.result()
            pending = following
        if pending is not None:
            yield pending.result()
