"""One step of an identified gimbal axis under held commands, on the activations of an actuator.

Parameters of an axis, one numeric of the model: mark, dt, feedback, rate limit, dead band,
backlash; then per input: number of states, whole steps of delay, whether a rest is left, length of
the register, feedthrough, and the matrices A, now, before, C, then what the output's rate is of the
states and of the command. Minus one state marks a servo whose own speed is bounded, followed by
gain, k, w, limit, dead band and the rest of the delay; minus two one behind a set point of bounded
speed, followed by those, the limit downward and the slew; minus three one whose speed is clipped,
followed by what follows minus one.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.transfer_function import (
    Channel,
    Servo,
    TransferFunctionModel,
    discretise_channel,
    realise,
    speed_loop,
    whole_steps,
)
from analysis.transfer_function.speed import clip_move, move, track
from hardware.frames import AXES
from twin.errors import TwinError
from twin.physics.native.cache import jit

Array = NDArray[np.float64]

MARK: Final = 20260402.0  # in dynprm and numeric: an actuator of this layout
# activations: stage counter, y[k−1], y[k], its rate, two per input of the shaped command; registers
PHASE, BEFORE, OUTPUT, RATE, _SHAPED = 0, 1, 2, 3, 4
REGISTERS: Final = _SHAPED + 2 * len(AXES)
_HEAD: Final = 6
_PER_INPUT: Final = 5
_SPEED: Final = -1
_SET_POINT: Final = -2
_CLIPPED: Final = -3
_MARKS: Final = {"speed": _SPEED, "set-point": _SET_POINT, "clipped": _CLIPPED}
_LOOP: Final = 6
_LOOP_BEHIND_SET_POINT: Final = 8
# 1/s; a hobby servo's poles lie at 10 to 300. Its Runge–Kutta steps are 0.2 of the fastest time
# constant, so this one takes 100 of them in a millisecond, some 2 µs.
FASTEST_SERVO: Final = 2e4


def packed(model: TransferFunctionModel, axis: str, dt: float) -> tuple[list[float], int]:
    """Parameters of one output after mark, dt and feedback, and how many states they need.

    Raises
    ------
    TwinError
        A speed-bounded servo is faster than any servo is, and would take a flight for ever.
    """
    servo = model.servos[model.outputs.index(axis)] if model.servos else Servo()
    at_speed = servo.structure != "command"
    bounds = (0.0, 0.0) if at_speed else (servo.rate_limit, servo.dead_band)
    data: list[float] = [*bounds, servo.backlash]
    states = 0
    for input_ in AXES:
        channel = model.channel(axis, input_)
        if at_speed and not channel.zero:
            part, size = _packed_speed(channel, servo, dt, axis)
        else:
            part, size = _packed_linear(channel, dt)
        data += part
        states += size
    return data, states


def _packed_linear(channel: Channel, dt: float) -> tuple[list[float], int]:
    c = discretise_channel(channel.num, channel.den, channel.delay, dt)
    if c.zero:
        return [0.0] * _PER_INPUT, 0
    A, B, C, _ = realise(channel.num, channel.den)
    rate = [*(C @ A), float(C @ B)]
    data = [len(c.now), c.shift, c.late, c.memory, c.D]
    data += [*c.A.ravel(), *c.now, *c.before, *c.C, *rate]
    return [float(v) for v in data], len(c.now) + c.memory


def _packed_speed(channel: Channel, servo: Servo, dt: float, axis: str) -> tuple[list[float], int]:
    loop = speed_loop(channel.num, channel.den)
    if not max(loop[1:]) <= FASTEST_SERVO:
        raise TwinError(
            f"the identified servo of axis {axis} answers with {max(loop[1:]):g} /s, a speed-"
            f"bounded one may with at most {FASTEST_SERVO:g} /s: identify it again, or give it"
            ' "structure": "command"'
        )
    shift, rest = whole_steps(channel.delay, dt)
    late = 1 if rest > 0.0 else 0
    up, down, slew = servo.limits
    behind = servo.structure == "set-point"
    head = [_MARKS[servo.structure], shift, late, shift + late, 0.0]
    tail = [*loop, up, servo.dead_band, rest, *((down, slew) if behind else ())]
    return [float(v) for v in head + tail], (3 if behind else 2) + shift + late


@jit
def _advance_speed(
    p: Array, dt: float, act: Array, following: Array, place: int, now: float, before: float,
    clipped: bool,
) -> float:  # fmt: skip
    """One step of a speed-bounded servo; its next output [rad]."""
    gain, k, w, limit, dead_band, rest = p
    y, v = act[place], act[place + 1]
    if clipped:
        if rest > 0.0:
            y, v = clip_move(y, v, before, rest, k, w, limit, dead_band)
        y, v = clip_move(y, v, now, dt - rest, k, w, limit, dead_band)
        following[place], following[place + 1] = y, v
        return gain * y
    if rest > 0.0:
        y, v = move(y, v, before, rest, k, w, limit, dead_band)
    y, v = move(y, v, now, dt - rest, k, w, limit, dead_band)
    following[place], following[place + 1] = y, v
    return gain * y


@jit
def _advance_set_point(
    p: Array, dt: float, act: Array, following: Array, place: int, now: float, before: float
) -> float:
    """One step of a servo behind a set point of bounded speed; its next output [rad]."""
    gain, k, w, up, dead_band, rest, down, slew = p
    y, v, r = act[place], act[place + 1], act[place + 2]
    if rest > 0.0:
        y, v, r = track(y, v, r, before, rest, k, w, up, down, slew, dead_band)
    y, v, r = track(y, v, r, now, dt - rest, k, w, up, down, slew, dead_band)
    following[place], following[place + 1], following[place + 2] = y, v, r
    return gain * y


@jit
def _shape(
    act: Array, now: Array, j: int, command: float, dt: float, rate: float, dead_band: float
) -> float:
    """Command after dead band and rate limit; the mean of its ramp over this step.

    As analysis.transfer_function.servo.shaped_commands, which the tests hold it against.
    """
    held, reached = act[_SHAPED + 2 * j], act[_SHAPED + 2 * j + 1]
    if abs(command - held) > dead_band:
        held = command
    now[_SHAPED + 2 * j] = held
    if rate == 0.0:
        now[_SHAPED + 2 * j + 1] = held
        return held
    missing = held - reached
    reach = rate * dt
    if abs(missing) <= reach:
        now[_SHAPED + 2 * j + 1] = held
        return held - missing * abs(missing) / (2.0 * reach)
    step = reach if missing > 0.0 else -reach
    now[_SHAPED + 2 * j + 1] = reached + step
    return reached + 0.5 * step


@jit
def advance(p: Array, act: Array, following: Array, commands: Array) -> None:
    """One exact step of one axis: `following` from `act`, under the commands (2,) [rad]."""
    dt, rate, dead_band, backlash = p[1], p[3], p[4], p[5]
    at, place, y, speed = _HEAD, REGISTERS, 0.0, 0.0
    for j in range(len(AXES)):
        n, shift, late, memory = int(p[at]), int(p[at + 1]), int(p[at + 2]), int(p[at + 3])
        D = p[at + 4]
        at += _PER_INPUT
        u = _shape(act, following, j, commands[j], dt, rate, dead_band)
        register = place
        for k in range(memory - 1, 0, -1):
            following[register + k] = act[register + k - 1]
        if memory > 0:
            following[register] = u
        # age 0 is the command set now; the next output's feedthrough is one step younger
        now = u if shift == 0 else act[register + shift - 1]
        place += memory
        if n == 0 and D == 0.0:
            continue
        before = act[register + shift] if late else 0.0
        if n in (_SPEED, _CLIPPED):
            loop = p[at : at + _LOOP]
            y += _advance_speed(loop, dt, act, following, place, now, before, n == _CLIPPED)
            moved = (following[place] - act[place]) / dt  # of first order, whose speed is no state
            speed += loop[0] * (following[place + 1] if loop[2] > 0.0 else moved)
            at, place = at + _LOOP, place + 2
            continue
        if n == _SET_POINT:
            loop = p[at : at + _LOOP_BEHIND_SET_POINT]
            y += _advance_set_point(loop, dt, act, following, place, now, before)
            speed += loop[0] * following[place + 1]
            at, place = at + _LOOP_BEHIND_SET_POINT, place + 3
            continue
        A, gain_now = at, at + n * n
        gain_before, C = gain_now + n, gain_now + 2 * n
        for r in range(n):
            x = p[gain_now + r] * now + p[gain_before + r] * before
            for c in range(n):
                x += p[A + r * n + c] * act[place + c]
            following[place + r] = x
            y += p[C + r] * x
            speed += p[C + n + r] * x
        speed += p[C + 2 * n] * now
        age = max(shift + late - 1, 0)
        y += D * (u if age == 0 else act[register + age - 1])
        place += n
        at = C + 2 * n + 1
    z = act[OUTPUT]
    following[BEFORE] = z
    following[OUTPUT] = min(max(z, y - 0.5 * backlash), y + 0.5 * backlash)
    # within the play the output rests
    following[RATE] = speed if backlash == 0.0 or following[OUTPUT] != z else 0.0
