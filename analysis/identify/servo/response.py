"""Response of a bounded servo of either structure to a record's commands."""

from typing import TYPE_CHECKING

import numpy as np

from analysis.array import Array
from analysis.identify.problem.basis import denominator, over_single
from analysis.identify.problem.ramps import Bounds
from analysis.identify.problem.states import Part, held_states
from analysis.identify.servo.motion import play, set_point_servo, speed_servo
from analysis.recording.measurements import Measurement
from analysis.transfer_function.servo import Structure

if TYPE_CHECKING:
    from analysis.identify.evidence.evidence import ChannelFit, ServoBounds


def servo_response(
    part: Part, axis: int, structure: Structure, poles: int, theta: Array
) -> tuple[Array, Array]:
    """Angle and rate (n,) of the servo with unit gain and no offset."""
    delay, limit = float(theta[poles]), float(np.exp(theta[poles + 1]))
    dead_band, backlash = float(theta[poles + 2]), float(theta[poles + 3])
    command = np.ascontiguousarray(part.input[:, axis])
    motion: tuple[Array, Array]
    if structure in ("speed", "clipped"):
        k, w = _loop(theta[:poles])
        motion = speed_servo(
            part.time, part.input_time, command, delay, k, w, limit, dead_band,
            structure == "clipped",
        )  # fmt: skip
    elif structure == "set-point":
        k, w = _loop(theta[:poles])
        slew, back = np.exp(theta[poles + 4 : poles + 6])
        motion = set_point_servo(
            part.time, part.input_time, command, delay, k, w, limit, limit * back, slew, dead_band
        )
    else:
        motion = _behind_ramps(part, command, theta[:poles], delay, Bounds(limit, dead_band))
    if backlash == 0.0:
        return motion
    angle, rate = play(*motion, backlash)
    return angle, rate


def servo_motion_of(
    channel: "ChannelFit", bounds: "ServoBounds", record: Measurement, column: int
) -> tuple[Array, Array]:
    """Angle and rate (n,) of an identified servo under a record's commands."""
    den = np.array(channel.den) / channel.den[0]
    gain = channel.num[-1] / channel.den[-1]
    limits = np.array(
        [
            channel.delay,
            np.log(bounds.rate_limit.value / abs(gain)),
            bounds.dead_band.value,
            bounds.backlash.value / abs(gain),
        ]
    )
    if bounds.slew is not None and bounds.rate_limit_back is not None:
        up, down = bounds.rate_limit.value, bounds.rate_limit_back.value
        if gain < 0.0:
            up, down = down, up
            limits[1] = np.log(up / abs(gain))
        limits = np.append(limits, np.log([bounds.slew.value / abs(gain), down / up]))
    none = np.zeros(0, dtype=np.intp)
    part = Part(record.time, record.command.time, record.command.values, none, none, False)
    theta = np.concatenate([np.log(den[1:]), limits])
    angle, rate = servo_response(part, column, bounds.structure, len(den) - 1, theta)
    return gain * angle, gain * rate


def _loop(section: Array) -> tuple[float, float]:
    """Loop gain k and speed bandwidth w of s² + c₁s + c₀ = s² + w·s + k·w, or of s + k."""
    if len(section) == 1:
        return float(np.exp(section[0])), 0.0
    c1, c0 = np.exp(section)
    return float(c0 / c1), float(c1)


def _behind_ramps(
    part: Part, command: Array, section: Array, delay: float, bounds: Bounds
) -> tuple[Array, Array]:
    den = denominator(section)
    single, held = held_states(part.time, part.input_time, command, den, delay, bounds)
    a0 = den.coefficients[-1]
    both = []
    for numerator in (np.array([[a0]]), np.array([[a0, 0.0]])):
        weight, through = over_single(numerator, den)
        both.append((single @ weight).real[:, 0] + held * through[0])
    return both[0] + command[0], both[1]
