"""What a long fit is doing, for whoever shows it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_told: ContextVar[Callable[[str], None] | None] = ContextVar("told", default=None)


def say(text: str) -> None:
    """Tell what is being done now."""
    if (told := _told.get()) is not None:
        told(text)


@contextmanager
def told_to(listener: Callable[[str], None]) -> Iterator[None]:
    """Hand every such text of a block to a function."""
    token = _told.set(listener)
    try:
        yield
    finally:
        _told.reset(token)


@contextmanager
def about(text: str) -> Iterator[None]:
    """Begin every such text of a block with this one."""
    told = _told.get()
    with told_to(lambda t: told(f"{text}{t}") if told is not None else None):
        yield
