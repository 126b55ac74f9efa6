"""Controllers of a mirror: none, the joystick of the rig, or the keyboard."""

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from math import radians
from typing import Self

from hardware.frames import GimbalState, Pair, SensorFrame
from twin.errors import TwinError
from twin.loop.readings import Readings

DEAD_ZONE = 0.03  # of the joystick, whose springs do not return it exactly to the middle
KEY_STEP = radians(0.5)
ARROWS = {"A": (0, 1), "B": (0, -1), "C": (1, 1), "D": (1, -1)}  # ESC [ A: axis, direction


class Watch:
    """Sends no commands; gives the angle of the pulses in force, for the recording.

    Parameters
    ----------
    readings : of the seat
    pulse_angle : gimbal angle of the pulses of a frame [rad]
    """

    def __init__(self, readings: Readings, pulse_angle: Callable[[SensorFrame], Pair]) -> None:
        self._readings, self._pulse_angle = readings, pulse_angle
        self._pulse: Pair | None = None
        self._angle: Pair = (0.0, 0.0)

    def update(self, time: float, gimbal: GimbalState) -> Pair:  # noqa: ARG002  the seat's signature
        """Return the angle of the pulses in force [rad]."""
        frames = self._readings.frames
        if frames and frames[-1].pulse[:2] != self._pulse:
            self._pulse = frames[-1].pulse[:2]
            self._angle = self._pulse_angle(frames[-1])
        return self._angle


class Stick:
    """The joystick of the rig.

    Parameters
    ----------
    readings : of the seat
    stroke : angle at its ends, either way [rad]
    """

    def __init__(self, readings: Readings, stroke: float) -> None:
        self._readings, self._stroke = readings, stroke
        self._angle: Pair = (0.0, 0.0)

    def update(self, time: float, gimbal: GimbalState) -> Pair:  # noqa: ARG002  the seat's signature
        """Return the angle of the joystick [rad]."""
        if self._readings.frames:
            x, y = self._readings.frames[-1].joystick
            self._angle = self._stroke * _part(x), self._stroke * _part(y)
        return self._angle


def _part(deflection: float) -> float:
    """Part of the stroke, −1 to 1, with the dead zone taken out."""
    beyond = max(abs(deflection) - DEAD_ZONE, 0.0) / (1.0 - DEAD_ZONE)
    return beyond if deflection > 0 else -beyond


def _standard_input() -> int:
    """Descriptor of standard input; −1 where it was closed or replaced."""
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):
        return -1


class Keys:
    """Arrow keys: up and down turn x, right and left turn y, by half a degree; space is zero.

    A context manager that puts the terminal into unbuffered mode. `q` sets `ended`.

    Parameters
    ----------
    stroke : largest angle, either way [rad]
    terminal : file descriptor; standard input if omitted

    Raises
    ------
    TwinError : not a terminal, or a system without POSIX terminals
    """

    def __init__(self, stroke: float, terminal: int | None = None) -> None:
        self._stroke = stroke
        self._fd = _standard_input() if terminal is None else terminal
        self.ended = False
        self._angle = [0.0, 0.0]
        self._rest = ""
        self._begun = False
        if self._fd < 0 or not os.isatty(self._fd):
            raise TwinError("--steer keys: standard input must be a terminal")
        try:
            import termios
        except ImportError:
            raise TwinError(
                "--steer keys: needs a POSIX terminal; give --steer joystick instead"
            ) from None
        self._termios = termios

    def __enter__(self) -> Self:
        t = self._termios
        self._before = t.tcgetattr(self._fd)
        raw = t.tcgetattr(self._fd)
        raw[3] &= ~(t.ICANON | t.ECHO)  # signals stay: Ctrl-C ends the run
        raw[6][t.VMIN], raw[6][t.VTIME] = 0, 0
        t.tcsetattr(self._fd, t.TCSANOW, raw)
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError, self._termios.error):
            self._termios.tcsetattr(self._fd, self._termios.TCSADRAIN, self._before)

    def update(self, time: float, gimbal: GimbalState) -> Pair:  # noqa: ARG002  the seat's signature
        """Return the angle set by the keys [rad]; those typed before it began are lost."""
        if not self._begun:
            self._begun = True
            with suppress(self._termios.error):
                self._termios.tcflush(self._fd, self._termios.TCIFLUSH)
        with suppress(OSError):
            self._press(os.read(self._fd, 64).decode("ascii", "ignore"))
        return self._angle[0], self._angle[1]

    def _press(self, typed: str) -> None:
        text = self._rest + typed
        self._rest = ""
        while text:
            if text in ("\x1b", "\x1b["):
                self._rest = text  # the rest of an arrow key has not arrived
                return
            if text.startswith("\x1b["):
                axis, way = ARROWS.get(text[2], (0, 0))
                turned = self._angle[axis] + way * KEY_STEP
                self._angle[axis] = min(max(turned, -self._stroke), self._stroke)
                text = text[3:]
                continue
            if text[0] == " ":
                self._angle = [0.0, 0.0]
            self.ended |= text[0] == "q"
            text = text[1:]
