"""SIGTERM as an exception: at once, or where a piece of work is finished."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from vnca.core.errors import Terminated


@contextmanager
def terminable() -> Iterator[None]:
    """SIGTERM raises `Terminated` in the main thread wherever that is, as Ctrl-C does its own."""

    def terminate(*_: Any) -> None:
        raise Terminated

    with _handling(terminate):
        yield


@contextmanager
def finishing() -> Iterator[Callable[[], None]]:
    """SIGTERM waits for a piece of work: the function given is called where one is finished.

    It raises `Terminated` if there was a SIGTERM. A second SIGTERM does not wait.
    """
    is_asked = False

    def ask(*_: Any) -> None:
        nonlocal is_asked
        if is_asked:
            raise Terminated
        is_asked = True

    def stop_if_asked() -> None:
        if is_asked:
            raise Terminated

    with _handling(ask):
        yield stop_if_asked


@contextmanager
def _handling(handler: Callable[..., None]) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield  # Signals are the main thread's.
        return
    before = signal.signal(signal.SIGTERM, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
