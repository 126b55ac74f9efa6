"""What a recording holds: entity paths, component names, units, and the way to storage and back.

Names are paths without the leading slash (`gimbal/command`). Values are SI inside; what people read
in a plot is stored in the unit they read it in. The sensors' readings are stored as they came, in
SI: a replay repeats a run bit for bit from them, and a detour through degrees would cost the last
bit.
"""

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

SCHEMA = "tvc-twin/recording/1"

APPLICATION = "tvc_twin"
PROPERTY = "run"
TIMING = "timing"
FLIGHT = "flight"
TIME = "time"
WALL_TIME = "wall_time"
EVENTS = "/events"
HEALTH = "/health"
ESTIMATOR = "/estimator"
WORLD = "/world"

Kind = Literal["continuous", "sampled", "counter"]


class AnalysisError(ValueError):
    """A measurement or file that cannot be used, reported in one line."""


# Stored units that differ from SI: how many stored units one SI unit is.
_PER_SI: Mapping[tuple[str, str], float] = MappingProxyType(
    {
        ("rad", "deg"): 180.0 / math.pi,
        ("rad/s", "deg/s"): 180.0 / math.pi,
        ("s", "ms"): 1e3,
        ("s", "µs"): 1e6,
        ("m", "µm"): 1e6,
    }
)


@dataclass(frozen=True, slots=True)
class Signal:
    """One vector signal of a recording.

    Attributes
    ----------
    name : path without the leading slash
    entity : path in the recording
    components : names of the k components
    unit : SI unit of the values inside [k]
    stored_unit : unit of the values in the file
    kind : `continuous` is finite in every row; of `sampled`, rows without any measurement are not
        stored and a component may be NaN; `counter` holds whole numbers that start at zero
    """

    name: str
    entity: str
    components: tuple[str, ...]
    unit: str
    stored_unit: str
    kind: Kind = "continuous"

    @property
    def scale(self) -> float:
        """Stored units per SI unit."""
        return 1.0 if self.unit == self.stored_unit else _PER_SI[self.unit, self.stored_unit]

    def to_stored(self, values: ArrayLike) -> NDArray[np.float64]:
        """Values (..., k) in SI as they stand in the file."""
        return np.asarray(values, dtype=np.float64) * self.scale

    def from_stored(self, values: ArrayLike) -> NDArray[np.float64]:
        """Values (..., k) of the file in SI."""
        return np.asarray(values, dtype=np.float64) / self.scale


def _signal(
    name: str, components: str, unit: str, stored: str | None = None, kind: Kind = "continuous"
) -> Signal:
    return Signal(name, f"/{name}", tuple(components.split()), unit, stored or unit, kind)


_TABLE = (
    # angle about x (ring) and y (holder)
    _signal("gimbal/command", "x y", "rad", "deg"),
    # a model under the run's commands; beside a rig, a second gimbal that nothing measured touches
    _signal("gimbal/simulated", "x y", "rad", "deg", "sampled"),
    # the joints of a vehicle whose gimbal is a rig: they follow the measured angle and rate
    _signal("gimbal/followed", "x y", "rad", "deg"),
    _signal("gimbal/measured", "x y", "rad", "deg", "sampled"),
    _signal("gimbal/sigma", "x y", "rad", "deg", "sampled"),
    _signal("gimbal/rate/simulated", "x y", "rad/s", "deg/s", "sampled"),
    _signal("gimbal/rate/followed", "x y", "rad/s", "deg/s"),
    _signal("gimbal/rate/measured", "x y", "rad/s", "deg/s", "sampled"),
    # two motions aligned by `twin compare`, and other minus reference
    _signal("gimbal/reference", "x y", "rad", "deg", "sampled"),
    _signal("gimbal/other", "x y", "rad", "deg", "sampled"),
    _signal("gimbal/difference", "x y", "rad", "deg", "sampled"),
    # measured minus simulated, half width of the model's 95 % interval, and what the gimbal's
    # properties are by the measurement, with their standard deviations (`twin compare --drift`)
    _signal("shadow/residual", "x y", "rad", "deg", "sampled"),
    _signal("shadow/band", "x y", "rad", "deg", "sampled"),
    _signal("shadow/estimate/gain", "x y x_sigma y_sigma", "1", kind="sampled"),
    _signal("shadow/estimate/zero", "x y x_sigma y_sigma", "rad", "deg", "sampled"),
    _signal("shadow/estimate/delay", "x y x_sigma y_sigma", "s", "ms", "sampled"),
    _signal("shadow/estimate/lag", "x y x_sigma y_sigma", "s", "ms", "sampled"),
    _signal("shadow/estimate/speed", "x y x_sigma y_sigma", "1", kind="sampled"),
    _signal("shadow/estimate/backlash", "x y x_sigma y_sigma", "rad", "deg", "sampled"),
    _signal("shadow/estimate/friction", "x y x_sigma y_sigma", "1", kind="sampled"),
    # motion of the body frame (origin on the gimbal pivot) in the world, east-north-up
    _signal("vehicle/position", "x y z", "m"),
    _signal("vehicle/velocity", "x y z", "m/s"),
    _signal("vehicle/attitude", "w x y z", "1"),
    _signal("vehicle/rate", "x y z", "rad/s", "deg/s"),  # in the body frame
    _signal("vehicle/tilt", "x y", "rad", "deg"),  # rotation from the vertical to the nose
    _signal("vehicle/mass", "mass", "kg"),
    _signal("vehicle/thrust", "thrust", "N"),
    _signal("vehicle/angle_of_attack", "angle", "rad", "deg", "sampled"),  # NaN without airspeed
    _signal("vehicle/airspeed", "speed", "m/s"),
    _signal("vehicle/wind", "x y z", "m/s"),  # at the centre of mass, in the world
    # wanted nose direction, as vehicle/tilt; and the rotation still missing, about body x and y;
    # NaN while no thrust steers
    _signal("control/setpoint", "x y", "rad", "deg", "sampled"),
    _signal("control/error", "x y", "rad", "deg", "sampled"),
    # the rig's readings, exactly as received
    _signal("sensors/potentiometer", "x_a x_b y_a y_b", "1", kind="sampled"),  # of the supply
    _signal("sensors/gyro", "x y z", "rad/s", kind="sampled"),
    _signal("sensors/accelerometer", "x y z", "m/s²", kind="sampled"),
    _signal("sensors/base_gyro", "x y z", "rad/s", kind="sampled"),
    _signal("sensors/base_accelerometer", "x y z", "m/s²", kind="sampled"),
    _signal("sensors/pulse", "x y turntable", "s", "µs", "sampled"),
    _signal("sensors/switches", "x_plus x_minus y_plus y_minus", "1", kind="sampled"),
    _signal("sensors/joystick", "x y", "1", kind="sampled"),
    _signal("sensors/device_time", "time", "s", kind="sampled"),  # the device's own clock
    _signal("sensors/flags", "flags", "1", kind="sampled"),
    # of each frame: the tick that took it, how often the rig had become ready by then, and how old
    # its gyro's readings are
    _signal("sensors/taken", "time", "s", kind="sampled"),
    _signal("sensors/session", "session", "1", kind="sampled"),
    _signal("sensors/gyro_delay", "delay", "s", kind="sampled"),
    # turn about the launch's x axis: of the vehicle, and of the base that plays it, by its IMU
    _signal("turntable/simulated", "x", "rad", "deg"),
    _signal("turntable/measured", "x", "rad", "deg"),
    _signal("turntable/sigma", "x", "rad", "deg"),
    # did the run keep its time
    _signal("timing/lateness", "lateness", "s", "ms"),
    _signal("timing/sensor_age", "age", "s", "ms", "sampled"),
    _signal("timing/round_trip", "time", "s", "ms", "sampled"),
    _signal("link/lost", "frames", "1", kind="counter"),
    _signal("link/crc_errors", "frames", "1", kind="counter"),
    _signal("link/connected", "connected", "1"),
    # the pushrod linkage: gap of the closed loops, and servo shaft angles
    _signal("linkage/closure", "x y", "m", "µm"),
    _signal("linkage/servo", "x y", "rad", "deg"),
)

SIGNALS: Mapping[str, Signal] = MappingProxyType({signal.name: signal for signal in _TABLE})
ENTITIES: Mapping[str, Signal] = MappingProxyType({signal.entity: signal for signal in _TABLE})

# Signals of a rig: one row a sensor frame, rare ones only where they change
# (a row of a signal takes 44 bytes besides its values, 500 times a second), and a row a tick.
FRAME = (
    "gimbal/measured",
    "gimbal/sigma",
    "gimbal/rate/measured",
    "sensors/potentiometer",
    "sensors/gyro",
    "sensors/accelerometer",
    "sensors/base_gyro",
    "sensors/base_accelerometer",
    "sensors/pulse",
    "sensors/device_time",
    "sensors/taken",
)
RARE = (
    "sensors/switches",
    "sensors/joystick",
    "sensors/flags",
    "sensors/session",
    "sensors/gyro_delay",
)
TICK = (
    "timing/sensor_age",
    "timing/round_trip",
    "link/lost",
    "link/crc_errors",
    "link/connected",
)


def signal(name: str) -> Signal:
    """Return the signal of that name, or say which names there are.

    Raises
    ------
    AnalysisError : there is no such signal; the message lists the valid names
    """
    try:
        return SIGNALS[name]
    except KeyError:
        raise AnalysisError(unknown("signal", name, SIGNALS)) from None


def unknown(what: str, name: str, valid: Iterable[str]) -> str:
    """One line that says a name is none, which one may have been meant, and which there are."""
    names = sorted(valid)
    close = difflib.get_close_matches(name, names, n=1)
    hint = f" (did you mean '{close[0]}'?)" if close else ""
    return f"no {what} '{name}'{hint}; there are: {', '.join(names) or 'none'}"
