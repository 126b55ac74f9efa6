"""Clean ends for verbs that run until they are interrupted."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def until_signal() -> Iterator[Callable[[], str | None]]:
    """A function that returns which signal arrived, SIGINT or SIGTERM; None before.

    The signals do not end the process meanwhile. Off the main thread they cannot be caught, and
    the function always returns None.
    """
    came: list[str] = []

    def note(number: int, frame: FrameType | None) -> None:  # noqa: ARG001  a handler's signature
        came.append("interrupted" if number == signal.SIGINT else "terminated")

    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return
    before = {n: signal.signal(n, note) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: came[0] if came else None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
