"""One verb of the command line: from arguments to settings, and from results to the exit code."""

import io
import json
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from analysis.schema import AnalysisError
from hardware.frames import HardwareError
from twin import status
from twin.cli.arguments import parse
from twin.cli.ready import ready
from twin.config import Settings
from twin.config.result import Result
from twin.errors import CheckError, DivergenceError, TwinError

MISTAKE, FAILED = 2, 1
NARROWEST = 40  # columns


def run(arguments: Sequence[str]) -> NoReturn:
    """Run one verb and end the process with 0, 1 (a check failed) or 2 (the user's mistake)."""
    _prepare_terminal()
    try:
        with status.shown():
            verb, settings = parse(list(arguments))
            status.say("starting")
            ready(verb.name, settings)
            result = verb.function(settings)
        sys.exit(_status(settings, result))
    except (TwinError, AnalysisError, HardwareError) as error:
        _complain(f"twin: {error}")
        sys.exit(MISTAKE)
    except (DivergenceError, CheckError) as error:
        _complain(f"twin: {error}")
        sys.exit(FAILED)
    except BrokenPipeError:
        _discard_output()
        sys.exit(FAILED)


def _status(settings: Settings, result: Result | int | None) -> int:
    """Print a result; returns the exit code."""
    if not isinstance(result, Result):
        return result or 0
    as_json = getattr(settings, "json", False)
    _print(json.dumps(result.as_dict(), allow_nan=False) if as_json else result.text())
    ignored = getattr(settings, "on_fault", None) == "ignore"
    return 0 if ignored else result.status


def _print(text: str) -> None:
    try:
        print(text, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        _discard_output()
        raise TwinError(f"cannot print the result: {error.strerror}") from None


def _discard_output() -> None:
    """Let nothing more be written at exit to an output that is closed or full."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _prepare_terminal() -> None:
    """Print on terminals of any encoding and width.

    A character that the encoding lacks, such as ° in ASCII, is replaced by a question mark.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    if os.environ.get("COLUMNS", "").isdigit() and int(os.environ["COLUMNS"]) < NARROWEST:
        os.environ["COLUMNS"] = str(NARROWEST)  # the help does not fit in less


def _complain(line: str) -> None:
    """Print one line; what a file or its name has of line ends and control characters is spelt."""
    line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in line)
    print(line, file=sys.stderr)
