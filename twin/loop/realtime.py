"""Real-time scheduling and locked memory of this process, where the system allows them."""

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
UNASKED = "not requested"


@dataclass(frozen=True)
class Rights:
    """What the system granted to a real-time loop: `granted`, or the reason against it.

    Attributes
    ----------
    scheduling : SCHED_FIFO, so that ordinary processes do not delay the loop
    memory : locked memory, so that no page fault delays it
    """

    scheduling: str = UNASKED
    memory: str = UNASKED

    def missing(self) -> tuple[str, ...]:
        """What was refused, and why."""
        named = (("SCHED_FIFO", self.scheduling), ("locked memory", self.memory))
        return tuple(f"without {name}: {reason}" for name, reason in named if reason != GRANTED)


def stolen() -> float:
    """Time that the host has withheld from this virtual machine since it started [s].

    Sum over all processors; zero on a physical machine and where the system does not report it.
    """
    try:
        words = Path("/proc/stat").read_text().split(maxsplit=9)
        return int(words[8]) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return 0.0


@contextmanager
def requested() -> Iterator[Rights]:
    """Request real-time rights for the length of a block.

    Every existing Python thread gets them, since a thread that is preempted while it holds the
    interpreter lock stops the loop as well; threads started later are ordinary ones.
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
