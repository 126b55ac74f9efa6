"""What a board on a port answers: whether flashing and wiring worked; its servos are not moved."""

import time
from collections.abc import Callable, Iterator
from typing import Literal

from hardware.firmware.build import build_hash
from hardware.frames import POTENTIOMETER_NAMES, SensorFrame
from hardware.link import Link
from hardware.parts import MPU6050, RAIL, SUCCESSORS
from hardware.protocol import Board, Flags, Hello
from hardware.rig.rig import Rig

LISTENED_S = 0.5
POLL_S = 0.005
SWITCHES = ("+x", "-x", "+y", "-y")
UNKNOWN_CHIP = (
    "neither an MPU6050 (0x68) nor an MPU6500 (0x70): reset the board and look again; if it stays,"
    " check SDA, SCL and the supply, or use another module"
)
Level = Literal["ok", "note", "missing"]
Row = tuple[str, Level, str, str]  # topic, level, state, remedy


def examined(port: str) -> list[Row]:
    """Connect a board, listen for half a second, and say what it is and what it reads.

    Raises
    ------
    HardwareError : the port cannot be opened, or no board of this version answers
    """
    rig = Rig(Link(port), arm=False, fuse=False)
    try:
        return list(answers(rig, lambda: time.sleep(POLL_S)))
    finally:
        rig.close()


def answers(rig: Rig, wait: Callable[[], None]) -> Iterator[Row]:
    """One row for each item of a board's HELLO and readings.

    Parameters
    ----------
    wait : lets some milliseconds pass between two polls
    """
    hello = rig.connect()
    frames: list[SensorFrame] = []
    for _ in range(round(LISTENED_S / POLL_S)):
        wait()
        frames += rig.poll()
    hello = rig.hello or hello  # sent again once the IMUs are set up
    yield from _identity(hello)
    if not frames:
        yield "readings", "missing", "none in half a second", "flash the firmware anew"
        return
    rate = (len(frames) - 1) / max(1e-6, (frames[-1].device_us - frames[0].device_us) * 1e-6)
    yield "readings", "ok", f"{rate:.0f} a second", ""
    yield from _sensors(hello, frames)


def _identity(hello: Hello) -> Iterator[Row]:
    version = ".".join(map(str, hello.firmware))
    flashed = hello.board == Board.NANO
    build = f"build {hello.build:08x}" if flashed else "no build (not a flashed Nano)"
    state = f"firmware {version}, {build}, serial number {hello.serial:08x}"
    own = not flashed or hello.build == build_hash()
    remedy = "" if own else f"this tree's build is {build_hash():08x}: flash it to have the same"
    yield "board", "ok" if own else "note", state, remedy


def _sensors(hello: Hello, frames: list[SensorFrame]) -> Iterator[Row]:
    flags = 0
    for frame in frames:
        flags |= frame.flags
    names = ("holder", Flags.HOLDER_IMU, 0x68), ("base", Flags.BASE_IMU, 0x69)
    for (name, bit, address), chip in zip(names, hello.imu_identity, strict=True):
        if flags & bit:
            known = chip == MPU6050 or chip in SUCCESSORS
            kind = {MPU6050: "MPU6050"}.get(chip, "MPU6500" if known else f"WHO_AM_I {chip:#x}")
            remedy = "" if known else UNKNOWN_CHIP
            state = f"answers at {address:#x}, {kind}"
            yield f"IMU {name}", "ok" if known else "note", state, remedy
        else:
            missing = name == "holder"
            remedy = "check SDA, SCL, AD0 and its supply"
            remedy = remedy if missing else f"only needed for the turntable; there {remedy}"
            level: Level = "missing" if missing else "note"
            yield f"IMU {name}", level, f"no answer at {address:#x}", remedy
    last = frames[-1]
    read = [sum(f.potentiometer[k] for f in frames) / len(frames) for k in range(4)]
    at_rail = [n for n, v in zip(POTENTIOMETER_NAMES, read, strict=True) if not RAIL < v < 1 - RAIL]
    shown = ", ".join(f"{v:.3f}" for v in read)
    if len(at_rail) == len(read):
        remedy = "check their 5 V and wipers; without any: `twin calibrate --minimal`"
        yield "potentiometers", "note", f"all at an end: {shown}", remedy
    else:
        remedy = f"check {', '.join(at_rail)}" if at_rail else ""
        yield "potentiometers", "missing" if at_rail else "ok", shown, remedy
    closed = [n for n, state in zip(SWITCHES, last.switches, strict=True) if state]
    yield "limit switches", "ok", f"closed: {', '.join(closed) or 'none'}", ""
