"""The compiled callbacks installed for the length of a run."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco

from analysis.compiled import cache_folder
from twin import status
from twin.physics import native

_lock = threading.Lock()
_depth = 0  # blocks that are open
_previous: object = None  # handler of warnings outside them
_printed: set[str] = set()


@contextmanager
def compiled() -> Iterator[None]:
    """Install the native callbacks, and print each kind of MuJoCo warning once.

    Blocks may overlap in any order, as those of several environments do.
    """
    when = "once after an installation or update, 30 s"
    if cache_folder() is None:
        when = "at every start, since no cache can be written; NUMBA_CACHE_DIR may name a folder"
    status.say(f"loading the native forces; if they are new they are compiled, {when}")
    with _warnings_printed(), native.installed():
        status.say("building the model")
        yield


@contextmanager
def _warnings_printed() -> Iterator[None]:
    """Print warnings; MuJoCo's own handler writes a log file to the folder."""
    global _depth, _previous
    with _lock:
        if _depth == 0:
            _previous = mujoco.get_mju_user_warning()
            _printed.clear()
            mujoco.set_mju_user_warning(_warn)
        _depth += 1
    try:
        yield
    finally:
        with _lock:
            _depth -= 1
            if _depth == 0:
                mujoco.set_mju_user_warning(_previous)


def _warn(message: str) -> None:
    kind = message.partition("Time")[0]
    if kind not in _printed:  # a failing simulation repeats its warning at every step
        _printed.add(kind)
        status.note(f"twin: MuJoCo: {message}")
