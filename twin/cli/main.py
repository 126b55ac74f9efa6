"""The `twin` command: handles signals first, then imports the rest, which takes a second."""

import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run one verb and end the process with 0, 1 (a check failed) or 2 (the user's mistake)."""
    signal.signal(signal.SIGTERM, _terminate)
    try:
        from twin.cli.command import run
    except KeyboardInterrupt:
        print("twin: interrupted; nothing was recorded", file=sys.stderr)
        sys.exit(128 + signal.SIGINT)
    run(sys.argv[1:] if arguments is None else arguments)


def _terminate(number: int, frame: FrameType | None) -> None:  # noqa: ARG001  a handler's signature
    """Leave through the `finally` blocks, so that a recording gets its footer."""
    raise SystemExit(128 + number)


if __name__ == "__main__":
    main()
