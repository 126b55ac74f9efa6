"""The `twin` command: arguments to configurations, results to a summary, errors to exit codes."""

import contextlib
import io
import json
import os
import re
import signal
import sys
from collections.abc import Mapping, Sequence
from types import FrameType
from typing import Annotated, NoReturn

import tyro

from analysis.schema import AnalysisError
from hardware.frames import HardwareError
from twin.config import (
    Calibrate,
    Compare,
    Converge,
    Doctor,
    Fly,
    Identify,
    Mirror,
    Replay,
    Report,
    Rig,
    Step,
    View,
)
from twin.errors import DivergenceError, TwinError

MISTAKE, FAILED = 2, 1
# what tyro says, and what it means to somebody who is no programmer
PLAINER = (
    (r"no type matching FLOAT could be instantiated from \['(.*?)'\]\.?", r"'\1' is not a number"),
    (r"could not convert string to float: '(.*?)'", r"'\1' is not a number"),
    (r"invalid literal for int\(\) with base 10: '(.*?)'", r"'\1' is not a whole number"),
    (r"Missing value for argument '(.*?)'\. Expected 1 values\.", r"\1: its value is missing"),
    (r"Missing value for argument '(.*?)'\. Expected (\d+) values\.", r"\1: \2 values are needed"),
    (
        r"Could not (?:parse arguments|find valid parse for arguments:) \[(.*?)\].*",
        r"\1 will not do",
    ),
    (
        r"invalid choice '(.*?)' for argument '(.*?)'\. Expected one of \((.*?)\)\.?",
        r"\2: no \1; there are \3",
    ),
)
COMMANDS = (
    "fly",
    "step",
    "mirror",
    "calibrate",
    "rig",
    "converge",
    "replay",
    "identify",
    "compare",
    "report",
    "view",
    "doctor",
)
Command = (
    Annotated[Fly, tyro.conf.subcommand("fly")]
    | Annotated[Step, tyro.conf.subcommand("step")]
    | Annotated[Mirror, tyro.conf.subcommand("mirror")]
    | Annotated[Calibrate, tyro.conf.subcommand("calibrate")]
    | Annotated[Rig, tyro.conf.subcommand("rig")]
    | Annotated[Converge, tyro.conf.subcommand("converge")]
    | Annotated[Identify, tyro.conf.subcommand("identify")]
    | Annotated[Compare, tyro.conf.subcommand("compare")]
    | Annotated[Replay, tyro.conf.subcommand("replay")]
    | Annotated[Report, tyro.conf.subcommand("report")]
    | Annotated[View, tyro.conf.subcommand("view")]
    | Annotated[Doctor, tyro.conf.subcommand("doctor")]
)


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run one command and end the process with 0, 1 (a check failed) or 2 (the user's mistake)."""
    signal.signal(signal.SIGTERM, _terminate)
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        command = _parse(list(arguments))
        sys.exit(_dispatch(command))
    except (TwinError, AnalysisError, HardwareError) as error:
        _say(f"twin: {error}")
        sys.exit(MISTAKE)
    except DivergenceError as error:
        _say(f"twin: {error}")
        sys.exit(FAILED)
    except KeyboardInterrupt as interrupt:
        kept = " ".join(getattr(interrupt, "__notes__", ()))  # the recorder says where
        _say(f"twin: interrupted; {kept or 'nothing was recorded'}")
        sys.exit(128 + signal.SIGINT)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(FAILED)


def _parse(arguments: list[str]) -> object:
    """Return the command's configuration; tyro's box of advice is folded into one line."""
    if arguments and not arguments[0].startswith("-") and arguments[0] not in COMMANDS:
        raise TwinError(f"no command {arguments[0]!r}; there are {', '.join(COMMANDS)}")
    told = io.StringIO()
    try:
        with contextlib.redirect_stderr(told):
            return tyro.cli(
                Command,
                prog="twin",
                description="Digital twin of a thrust-vector-control gimbal and its vehicle.",
                args=arguments,
                config=(tyro.conf.OmitArgPrefixes, tyro.conf.DisallowNone),
            )
    except SystemExit as end:
        if end.code in (0, None):
            raise
        command = f"twin {arguments[0]}" if arguments and arguments[0] in COMMANDS else "twin"
        raise TwinError(
            f"{_advice(told.getvalue())} (`{command} --help` lists what there is)"
        ) from None


def _advice(box: str) -> str:
    """The text under the title of a box drawn by tyro, in Unicode or in ASCII, on one line."""
    paragraphs: list[list[str]] = [[]]
    for line in box.splitlines():
        text = line.strip("│| ")
        if text.startswith(("╭", "╰")) or not text.strip("─-"):
            paragraphs.append([])
        else:
            paragraphs[-1].append(text)
    told = next((p for p in paragraphs[1:] if p), ["the arguments make no command"])
    text = " ".join(told).removeprefix("Error parsing ")
    for pattern, plain in PLAINER:
        text = re.sub(pattern, plain, text)
    return text


def _dispatch(command: object) -> int:
    """Each command's own imports are made here, so that one does not pay for another's."""
    match command:
        case Fly(repeat=1):
            from twin.experiments.fly import fly

            result = fly(command)
            _report(result.as_dict(), result.text(), as_json=command.json)
            return _status(command, passed=result.passed)
        case Fly():
            from twin.experiments.repeat.repeat import repeat

            flights = repeat(command)
            _report(flights.as_dict(), flights.text(), as_json=command.json)
            return _status(command, passed=flights.passed)
        case Step():
            from twin.experiments.fly import step

            response = step(command)
            _report(response.as_dict(), response.text(), as_json=command.json)
            return _status(command, passed=response.passed)
        case Mirror():
            from twin.experiments.mirror import mirror

            mirrored = mirror(command)
            _report(mirrored.as_dict(), mirrored.text(), as_json=command.json)
            return 0
        case Calibrate():
            from twin.experiments.calibrate import calibrate

            calibrated = calibrate(command)
            _report(calibrated.as_dict(), calibrated.text(), as_json=command.json)
            return 0
        case Rig():
            from twin.experiments.serve import rig

            rig(command)
            return 0
        case Converge():
            from twin.experiments.convergence import converge

            study = converge(command)
            _report(study.as_dict(), study.text(), as_json=command.json)
            return 0
        case Identify():
            from twin.evaluation import identify

            model = identify(command)
            _report(model.as_dict(), model.text(), as_json=command.json)
            return 0
        case Compare():
            from twin.evaluation import compare

            comparison = compare(command)
            _report(comparison.as_dict(), comparison.text(), as_json=command.json)
            return 0 if comparison.passed else FAILED
        case Replay():
            from twin.experiments.replay import replay

            repeated = replay(command)
            _report(repeated.as_dict(), repeated.text(), as_json=command.json)
            return 0 if repeated.passed else FAILED
        case Report():
            from twin.evaluation.report import write_report

            page = write_report(command)
            _report(page.as_dict(), page.text(), as_json=command.json)
            return 0
        case View():
            from twin import viewer

            status = viewer.view(command.recording, web=command.web, port=command.port)
            return int(status or 0)
        case Doctor():
            from twin.cli import doctor

            findings = doctor.examine()
            _report(doctor.as_dict(findings), doctor.table(findings), as_json=command.json)
            return 0
    raise AssertionError(command)


def _status(command: Fly | Step, *, passed: bool) -> int:
    return 0 if passed or command.on_fault == "ignore" else FAILED


def _report(numbers: Mapping[str, object], text: str, *, as_json: bool) -> None:
    print(json.dumps(numbers, allow_nan=False) if as_json else text)


def _say(line: str) -> None:
    print(line, file=sys.stderr)


def _terminate(number: int, frame: FrameType | None) -> None:  # noqa: ARG001  a handler's signature
    """Leave through the `finally` blocks, so that a recording gets its footer."""
    raise SystemExit(128 + number)
