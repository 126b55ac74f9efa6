"""The `twin` command: handles signals first, then imports the rest, which takes a second."""

import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

_came: list[int] = []  # signals


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run one verb and end the process with 0, 1 (a check failed) or 2 (the user's mistake)."""
    _came.clear()
    # read when NumPy is loaded: its threads wait for each other in the small matrices of a fit
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    signal.signal(signal.SIGTERM, _end)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # a shell may ignore it
        signal.signal(signal.SIGINT, _end)
    try:
        from twin.cli.command import run

        run(sys.argv[1:] if arguments is None else arguments)
    except (KeyboardInterrupt, Exception) as error:
        # an extension module turns a signal during its import into an ImportError
        if not (_came or isinstance(error, KeyboardInterrupt)):
            raise
        kept = " ".join(getattr(error, "__notes__", ()))  # the recorder adds where
    number = _came[-1] if _came else signal.SIGINT
    what = "ended by SIGTERM" if number == signal.SIGTERM else "interrupted"
    print(f"twin: {what}; {kept or 'nothing was recorded'}", file=sys.stderr)
    sys.exit(128 + number)


def _end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001  a handler's signature
    """Leave through the `finally` blocks, so that a recording gets its footer."""
    _came.append(number)
    raise KeyboardInterrupt(signal.Signals(number).name)
