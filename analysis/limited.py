"""Work on files of unknown origin in a process with limits, which crashes in this one's place.

A reader in C may crash, never end or fill the memory on hostile bytes, and no `except` catches it.
"""

import os
import subprocess
import sys
from pathlib import Path

from analysis.schema import AnalysisError

REFUSED = 3  # exit code of a process that says why on standard error
ROOT = Path(__file__).resolve().parents[1]
LONGEST = 300  # characters of a reason
GRACE = 30.0  # s; only a process that waits for something takes as long


class LimitError(AnalysisError):
    """What the process ended with, as the rest of a sentence about the file."""


def run(module: str, request: bytes, *, seconds: float, megabytes: int) -> bytes:
    """Standard output of `python -m module` for a request on standard input.

    The module calls `confine` before it looks at the request, and `refuse` to say what is wrong.
    An exception in this process, also one that a signal raises, ends the other one.

    Parameters
    ----------
    seconds : processor time that it may take; on the clock `GRACE` more, for a busy machine
    megabytes : memory that it may add to what it has after its imports

    Raises
    ------
    LimitError : it refused, crashed, or exceeded a limit
    """
    paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(p for p in paths if p),
        "MUJOCO_GL": "disable",  # no window system is looked for, a fifth of MuJoCo's import
    }
    command = [sys.executable, "-P", "-m", module, str(seconds), str(megabytes)]
    pipe = subprocess.PIPE
    try:
        done = subprocess.run(
            command, input=request, stdout=pipe, stderr=pipe, env=environment, check=False,
            timeout=seconds + GRACE,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise LimitError(f"takes longer than {seconds:g} s to read") from None
    if done.returncode == 0:
        return done.stdout
    raise LimitError(_reason(done.returncode, done.stderr.decode(errors="replace"), seconds))


def _reason(code: int, text: str, seconds: float) -> str:
    if code == REFUSED:
        return " ".join(text.split())[:LONGEST]
    if "memory" in text.lower() or "bad_alloc" in text or "MemoryError" in text:
        return "needs more memory than a file of its kind may"
    if os.name == "posix":
        import signal

        if code in (-signal.SIGXCPU, -signal.SIGKILL):
            return f"takes longer than {seconds:g} s to read"
    return "is damaged or hostile: it crashes its reader"


def confine() -> None:
    """Limit this process as its arguments say; call after all imports."""
    if os.name != "posix":
        return  # only the time is limited, by the process that waits
    import resource
    import signal

    signal.signal(signal.SIGINT, signal.SIG_DFL)
    seconds, megabytes = float(sys.argv[1]), int(sys.argv[2])
    statm = Path("/proc/self/statm")
    held = int(statm.read_text().split()[0]) * resource.getpagesize() if statm.exists() else 0
    for kind, most in (
        (resource.RLIMIT_AS, held + megabytes * 1_000_000),
        (resource.RLIMIT_CPU, max(1, round(seconds))),
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_FSIZE, 0),
    ):
        _, hard = resource.getrlimit(kind)
        top = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (top, hard))


def refuse(reason: str) -> None:
    """End this process with a reason for the one that waits."""
    print(reason, file=sys.stderr)
    sys.stderr.flush()
    os._exit(REFUSED)
