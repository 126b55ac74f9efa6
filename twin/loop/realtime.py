"""Real-time rights of this process: SCHED_FIFO and locked memory, where the system allows them."""

import ctypes
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

PRIORITY = 40  # of 99: above everything ordinary, below the kernel's own interrupt threads at 50
# <sys/mman.h> on Linux; ON_FAULT locks what is used, not gigabytes that are only reserved
_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4
GRANTED = "granted"
UNASKED = "not asked for"


@dataclass(frozen=True)
class Rights:
    """What the system granted to a loop in real time, each `granted` or why not.

    Attributes
    ----------
    scheduling : SCHED_FIFO, so that nothing ordinary delays the loop
    memory : locked memory, so that no page has to be fetched
    """

    scheduling: str = UNASKED
    memory: str = UNASKED

    def missing(self) -> tuple[str, ...]:
        """What was refused, in words."""
        named = (("SCHED_FIFO", self.scheduling), ("locked memory", self.memory))
        return tuple(f"without {name}: {told}" for name, told in named if told != GRANTED)


def stolen() -> float:
    """Time that the host has withheld from this virtual machine since it started [s].

    Of all processors together; zero on a real machine, and where the system does not tell.
    """
    try:
        words = Path("/proc/stat").read_text().split(maxsplit=9)
        return int(words[8]) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return 0.0


@contextmanager
def requested() -> Iterator[Rights]:
    """Take what rights the system gives for the length of a block, and give them back.

    Every Python thread there is gets them, since one that is preempted while it holds the
    interpreter lock stops the loop as well; threads started meanwhile are ordinary ones.
    """
    if not sys.platform.startswith("linux"):
        yield Rights("only Linux has it", "only Linux has it")
        return
    threads = [t.native_id for t in threading.enumerate() if t.native_id is not None]
    before = {tid: (os.sched_getscheduler(tid), os.sched_getparam(tid)) for tid in threads}
    scheduling, memory = _fifo(threads), _lock()
    try:
        yield Rights(scheduling, memory)
    finally:
        if scheduling == GRANTED:
            for tid, (policy, parameter) in before.items():
                with suppress(ProcessLookupError):  # it has ended
                    os.sched_setscheduler(tid, policy, parameter)
        if memory == GRANTED:
            ctypes.CDLL(None).munlockall()


def _fifo(threads: list[int]) -> str:
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    try:
        for tid in threads:
            os.sched_setscheduler(tid, policy, os.sched_param(PRIORITY))
    except OSError as error:
        return f"{error.strerror}; `ulimit -r {PRIORITY}` or rtprio in limits.conf allows it"
    return GRANTED


def _lock() -> str:
    import resource

    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    # with a limit in force, a later allocation would fail where locking it does
    if os.geteuid() != 0 and limit != resource.RLIM_INFINITY:
        return (
            f"{limit >> 10} KiB at most; `ulimit -l unlimited` or memlock in limits.conf allows it"
        )
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_CURRENT | _FUTURE | _ON_FAULT):
        return os.strerror(ctypes.get_errno())
    return GRANTED
