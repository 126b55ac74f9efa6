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
    except KeyboardInterrupt:
        pass
    except Exception:  # an extension module turns a signal during its import into an ImportError
        if not _came:
            raise
        if _came[-1] == signal.SIGTERM:
            sys.exit(128 + signal.SIGTERM)
    print("twin: interrupted; nothing was recorded", file=sys.stderr)
    sys.exit(128 + signal.SIGINT)


def _end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001  a handler's signature
    """Leave through the `finally` blocks, so that a recording gets its footer."""
    _came.append(number)
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    raise SystemExit(128 + number)


if __name__ == "__main__":
    main()
