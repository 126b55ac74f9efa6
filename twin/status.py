"""What the program does: one line on a terminal; in a log, a line now and then of long work."""

import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from analysis.signs import unsigned_zeros

Text = str | Callable[[], str]

FIRST_S, PERIOD_S = 0.7, 0.25  # until the line appears, and between two of its updates
LONG_S = 30.0  # until the first line in a log; each further one takes twice as long
_doing: Text = ""
_about = ""
_on = False  # whether a thread shows the line
_lock = threading.Lock()
_width = 0  # characters of the line that is shown


def say(doing: Text) -> None:
    """Set what is being done: a text, or a function that another thread may call at any time.

    An empty text removes the line, before something else is printed.
    """
    global _doing
    _doing = doing
    if not doing:
        with _lock:
            _erase()


@contextmanager
def stage(about: str) -> Iterator[None]:
    """Begin every status line of a block with this text."""
    global _about
    before, _about = _about, about
    try:
        yield
    finally:
        _about = before


def note(line: str) -> None:
    """Print a line on standard error that stays, in place of the status line."""
    with _lock:
        _erase()
        print(unsigned_zeros(line), file=sys.stderr, flush=True)


def begun(line: str) -> None:
    """Print a line that stays where no status line is shown, and nothing on a terminal."""
    if not _on:
        note(line)


def done(line: str) -> None:
    """Print a line that stays where the status line is shown, and nothing elsewhere."""
    if _on:
        note(line)


@contextmanager
def shown() -> Iterator[None]:
    """Show the status line during a block; in a pipe or log, a line after 30, 60, 120 … seconds."""
    global _on
    _on, over = sys.stderr.isatty(), threading.Event()
    show = _show if _on else _log
    thread = threading.Thread(target=show, args=(over,), daemon=True, name="status")
    thread.start()
    try:
        yield
    finally:
        _on = False
        over.set()
        thread.join()
        with _lock:
            _erase()


def _log(over: threading.Event) -> None:
    began, seconds = time.monotonic(), LONG_S
    while not over.wait(max(0.0, seconds - (time.monotonic() - began))):
        if line := _line(seconds):
            with suppress(OSError, ValueError):
                note(line)
        seconds *= 2


def _line(seconds: float) -> str:
    """The line so many seconds after the command began; empty where there is nothing to show."""
    try:
        text = _doing if isinstance(_doing, str) else _doing()
    except Exception:
        return ""
    return f"{_about}{text} ({seconds:.0f} s since the start)" if text else ""


def _show(over: threading.Event) -> None:
    seconds = FIRST_S
    while not over.wait(PERIOD_S if seconds > FIRST_S else FIRST_S):
        _draw(seconds)
        seconds += PERIOD_S


def _draw(seconds: float) -> None:
    global _width
    line, room = _line(seconds), shutil.get_terminal_size().columns - 1
    with _lock:
        if not _doing or not line:
            return
        try:
            print(f"\r{line[:room]:<{min(_width, room)}}\r", end="", file=sys.stderr, flush=True)
        except OSError:
            return
        _width = len(line)


def _forget() -> None:
    """In a forked process, which has no thread for the line, begin without one."""
    global _lock, _on, _width
    _lock, _on, _width = threading.Lock(), False, 0


def _erase() -> None:
    global _width
    if _width:
        room = shutil.get_terminal_size().columns - 1
        print("\r" + " " * min(_width, room) + "\r", end="", file=sys.stderr, flush=True)
        _width = 0


if hasattr(os, "register_at_fork"):
    # no fork while the line is drawn: the child would inherit a lock that nobody releases
    os.register_at_fork(
        before=lambda: _lock.acquire(),
        after_in_parent=lambda: _lock.release(),
        after_in_child=_forget,
    )
