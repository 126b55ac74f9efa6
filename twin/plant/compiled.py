"""The compiled callbacks installed for the length of a run."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco

from twin.physics import native

NOTICE_AFTER_S = 2.0  # of compiling, before a user at a terminal is told the reason


@contextmanager
def compiled() -> Iterator[None]:
    """Install the native callbacks, and print each kind of MuJoCo warning once.

    Compiling for the first time takes long; a notice on standard error then says so.
    """
    timer = threading.Timer(NOTICE_AFTER_S, _explain_wait)
    timer.daemon = True
    if sys.stderr.isatty():
        timer.start()
    before = mujoco.get_mju_user_warning()
    printed: set[str] = set()

    def warn(message: str) -> None:
        kind = message.partition("Time")[0]
        if kind not in printed:  # a failing simulation repeats its warning at every step
            printed.add(kind)
            print(f"twin: MuJoCo: {message}", file=sys.stderr)

    mujoco.set_mju_user_warning(warn)  # MuJoCo's own handler writes a log file to the folder
    try:
        with native.installed():
            timer.cancel()
            yield
    finally:
        timer.cancel()
        mujoco.set_mju_user_warning(before)


def _explain_wait() -> None:
    print("twin: compiling the native forces, once after an update …", file=sys.stderr)
