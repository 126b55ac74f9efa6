"""Status of a long fit, for a caller that shows it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_listener: ContextVar[Callable[[str], None] | None] = ContextVar("listener", default=None)


def say(text: str) -> None:
    """State what is being done now."""
    if (listener := _listener.get()) is not None:
        listener(text)


@contextmanager
def reported_to(listener: Callable[[str], None]) -> Iterator[None]:
    """Hand every such text of a block to a function."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


@contextmanager
def about(text: str) -> Iterator[None]:
    """Begin every such text of a block with this one."""
    outer = _listener.get()
    with reported_to(lambda t: outer(f"{text}{t}") if outer is not None else None):
        yield
