"""What a flight passes through, tick by tick, and its figures in the terms of rocketry."""

import math
from dataclasses import asdict, dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from analysis.flown import fast
from twin.config.result import Rows
from twin.errors import TwinError
from twin.physics.aerodynamics.atmosphere import (
    COLUMNS,
    DENSITY,
    TEMPERATURE,
    density,
    profile_at,
    sound,
    speed_of_sound,
)
from twin.plant.authority import command_limit, numeric
from twin.plant.plant import Plant

Array = NDArray[np.float64]
STRAIGHT_M = 1e5  # a smallest turn of a larger radius is none
BLOCK: Final = 4096  # ticks in one array
TIME, POSITION, VELOCITY, AIRSPEED, ATTACK, COMMAND, ERROR = (
    0, slice(1, 4), slice(4, 7), 7, 8, slice(9, 11), 11,
)  # fmt: skip
WIDTH: Final = 12
AT_LIMIT: Final = 1e-6  # rad
TURN: Final = 0.5  # s, over which the direction of the path changes by more than the nose swings
HALF_NS: Final = 5e-10  # s; times are rounded
STEEP: Final = 15.0  # °, angle of attack off the rail that is reported
SUBSONIC: Final = 0.6  # Mach number up to which the normal forces hold, docs/aerodynamics.md
SHORT: Final = 1.0  # s, of a flight to the ground that is reported


@dataclass(frozen=True)
class Figures:
    """A flight in the terms of rocketry; None where it has no meaning for this flight.

    Velocities and positions are those of the gimbal pivot; heights are above the launch point.

    Attributes
    ----------
    rail_exit_s, rail_exit_speed_m_s : when the lower lug leaves the rail
    burnout_s, burnout_height_m, burnout_speed_m_s : at the end of thrust
    apogee_m, apogee_s : highest point and its time; None where the flight ended before it
    max_ascent_speed_m_s : up to the apogee
    max_acceleration_m_s2 : up to the apogee, mean over a control period
    max_mach, max_dynamic_pressure_pa : of the ascent, in the standard atmosphere
    rail_exit_angle_of_attack_deg : at the first tick off the rail
    max_angle_of_attack_deg : of the ascent after the rail, where `analysis.flown.fast` has it count
    gimbal_saturation : share of the burn in which a command is at the limit of its axis
    control_margin : share of the stroke that the larger of both commands leaves in 95 % of the burn
    turn_radius_m : smallest of the path under power in free flight, over `TURN` seconds: way over
        change of its direction (1 over the mean curvature; E. Kreyszig, Advanced Engineering
        Mathematics, 10th ed., §9.5); None without a gimbal or where the motor burned no longer
    downrange_m : level distance from the launch point at the end
    end_east_m, end_north_m : the place of the end, from the launch point
    impact_speed_m_s : at the last tick before the ground; None where it was not reached
    """

    rail_exit_s: float | None
    rail_exit_speed_m_s: float | None
    rail_exit_angle_of_attack_deg: float | None
    burnout_s: float | None
    burnout_height_m: float | None
    burnout_speed_m_s: float | None
    apogee_m: float | None
    apogee_s: float | None
    max_ascent_speed_m_s: float
    max_acceleration_m_s2: float | None
    max_mach: float
    max_dynamic_pressure_pa: float
    max_angle_of_attack_deg: float | None
    gimbal_saturation: float | None
    control_margin: float | None
    turn_radius_m: float | None
    downrange_m: float
    end_east_m: float
    end_north_m: float
    impact_speed_m_s: float | None

    def as_dict(self) -> dict[str, object]:
        """JSON values, in SI units unless the name gives another."""
        return asdict(self)

    def rows(self, slant_range: float | None) -> Rows:
        """The figures as a table; `slant_range` at burnout [m]."""
        rows = []
        if self.rail_exit_s is not None:
            off = f"{self.rail_exit_speed_m_s:.1f} m/s at {self.rail_exit_s:.2f} s"
            if self.rail_exit_angle_of_attack_deg is not None:
                off += f", angle of attack {self.rail_exit_angle_of_attack_deg:.1f}°"
            rows.append(("off the rail", off))
        if self.burnout_s is not None:
            place = f"{self.burnout_height_m:.0f} m high, slant range {slant_range:.0f} m"
            motion = f"{self.burnout_speed_m_s:.1f} m/s at {self.burnout_s:.2f} s"
            rows.append(("burnout", f"{motion}, {place}"))
        if self.apogee_m is not None:
            rows.append(("apogee", f"{self.apogee_m:.1f} m at {self.apogee_s:.2f} s"))
        most = [f"{self.max_ascent_speed_m_s:.1f} m/s (Mach {self.max_mach:.2f})"]
        if self.max_acceleration_m_s2 is not None:
            most.append(f"{self.max_acceleration_m_s2:.1f} m/s²")
        most.append(f"{self.max_dynamic_pressure_pa:.0f} Pa dynamic pressure")
        rows.append(("ascent, at most", ", ".join(most)))
        if self.max_angle_of_attack_deg is not None:
            attack = f"angle of attack {self.max_angle_of_attack_deg:.2f}°"
            rows.append(("", f"{attack}, from a third of the largest airspeed on"))
        if self.gimbal_saturation is not None:
            rows.append(("gimbal at limit", f"{self.gimbal_saturation:.1%} of the burn"))
        if self.control_margin is not None:
            left = f"{self.control_margin:.0%} or more of the stroke, in 95 % of the burn"
            rows.append(("stroke left", left))
        if self.turn_radius_m is not None and self.turn_radius_m < STRAIGHT_M:
            rows.append(("smallest turn", f"{self.turn_radius_m:.0f} m radius under power"))
        end = (
            f"{self.downrange_m:.0f} m ({self.end_east_m:.0f} m east, {self.end_north_m:.0f} north)"
        )
        if self.impact_speed_m_s is not None:
            end += f", impact at {self.impact_speed_m_s:.1f} m/s"
        return [*rows, ("downrange", end)]


class Views(NamedTuple):
    """What a tick is kept of, views that stay in place.

    Attributes
    ----------
    position, velocity : of the pivot (3,) [m, m/s]
    airspeed, attack : (1,) airspeed [m/s], angle of attack [rad]
    command, error : (2,) commanded gimbal angle, attitude error [rad]
    """

    position: Array
    velocity: Array
    airspeed: Array
    attack: Array
    command: Array
    error: Array


class Track:
    """Collects a flight tick by tick in blocks of memory.

    Parameters
    ----------
    command : (2,) latest commanded gimbal angle, as the loop writes it [rad]
    error : (2,) attitude error, as the controller writes it [rad]

    Attributes
    ----------
    views : for compiled code, which calls `keep` with a row of `room`
    """

    def __init__(self, plant: Plant, command: Array, error: Array) -> None:
        self._model, self._plant = plant.model, plant
        signals = plant.signals
        self.views = Views(
            plant.position, plant.velocity, signals["vehicle/airspeed"],
            signals["vehicle/angle_of_attack"], command, error,
        )  # fmt: skip
        self._blocks: list[Array] = []
        self._left = 0

    def watch(self, time_ns: int) -> None:
        """Keep this tick; derived signals must belong to it."""
        keep(self.room()[0], time_ns, self.views)
        self.took(1)

    def room(self) -> Array:
        """Rows for the next ticks (n, WIDTH), at least one."""
        if self._left == 0:
            self._blocks.append(np.empty((BLOCK, WIDTH)))
            self._left = BLOCK
        return self._blocks[-1][BLOCK - self._left :]

    def took(self, count: int) -> None:
        """Count rows of `room` that were filled."""
        self._left -= count

    def error_rms_deg(self, count: int) -> float:
        """Root mean square of the attitude error in the first `count` ticks."""
        squares = np.ascontiguousarray(self.ticks[:count, ERROR])
        return math.degrees(math.sqrt(float(np.mean(squares))))

    @property
    def limit(self) -> float:
        """Largest command of an axis by the attitude loop [rad]."""
        return command_limit(self._model)

    @property
    def ticks(self) -> Array:
        """All ticks and the present instant, (n, WIDTH): columns `TIME` to `COMMAND`."""
        last = self._blocks[-1][BLOCK - self._left - 1].copy() if self._blocks else np.zeros(WIDTH)
        last[TIME] = self._plant.time_ns * 1e-9
        last[POSITION], last[VELOCITY] = self.views.position, self.views.velocity
        filled = np.concatenate([*self._blocks, np.empty((0, WIDTH))])
        return np.concatenate([filled[: len(filled) - self._left], last[None]])

    def figures(self, burnout: float, *, landed: bool) -> Figures:
        """Figures of the flight so far.

        Parameters
        ----------
        burnout : its time [s]
        landed : whether the last instant is at the ground
        """
        ticks, start = self.ticks, self._launch()
        time, height = ticks[:, TIME], ticks[:, POSITION][:, 2] - start[2]
        speed = np.linalg.norm(ticks[:, VELOCITY], axis=1)
        off, free = self._rail_exit(ticks, start)
        top = int(height.argmax())
        passed = free < top < len(ticks) - 1
        up = ticks[: top + 1]
        pressure, mach = self._air(up)
        climb = up[free:]
        # a tick past the highest point has a parachute's opening in it
        acceleration = _accelerations(up[:-1] if passed and up[-1, VELOCITY][2] < 0 else up)
        east, north = (ticks[-1, POSITION] - start)[:2].tolist()
        burnt = bool(time[-1] > burnout)
        return Figures(
            rail_exit_s=off,
            rail_exit_speed_m_s=None if off is None else _at(off, time, speed),
            rail_exit_angle_of_attack_deg=None
            if off is None
            else _largest_degrees(ticks[free : free + 1, ATTACK]),
            burnout_s=burnout if burnt else None,
            burnout_height_m=_at(burnout, time, height) if burnt else None,
            burnout_speed_m_s=_at(burnout, time, speed) if burnt else None,
            apogee_m=float(height[top]) if passed else None,
            apogee_s=float(time[top]) if passed else None,
            max_ascent_speed_m_s=float(speed[: top + 1].max()),
            max_acceleration_m_s2=float(acceleration.max()) if acceleration.size else None,
            max_mach=float(mach.max()),
            max_dynamic_pressure_pa=float(pressure.max()),
            max_angle_of_attack_deg=_largest_degrees(climb[fast(climb[:, AIRSPEED]), ATTACK]),
            gimbal_saturation=self._saturation(ticks[time <= burnout]),
            control_margin=self._margin(ticks[time <= burnout]),
            turn_radius_m=None
            if self._plant.twin.gimbal == "fixed"
            else _turn_radius(ticks[free:][time[free:] <= burnout]),
            downrange_m=math.hypot(east, north),
            end_east_m=east,
            end_north_m=north,
            impact_speed_m_s=float(speed[-2]) if landed else None,
        )

    def notes(self, *, landed: bool) -> tuple[str, ...]:
        """What is odd about the launch, one line each."""
        ticks, start = self.ticks, self._launch()
        found = []
        off, free = self._rail_exit(ticks, start)
        if off is not None and free < len(ticks):
            angle = math.degrees(ticks[free, ATTACK])
            speed = np.linalg.norm(ticks[:, VELOCITY], axis=1)
            if angle > STEEP:
                found.append(
                    f"angle of attack {angle:.0f}° off the rail: it leaves the rail at"
                    f" {_at(off, ticks[:, TIME], speed):.1f} m/s, slow for this wind; give a"
                    " longer rail or more thrust"
                )
        if (mach := float(self._air(ticks)[1].max())) > SUBSONIC:
            found.append(
                f"Mach {mach:.2f}: normal forces hold below Mach {SUBSONIC:g}; they do not depend"
                " on the Mach number"
            )
        ended = float(ticks[-1, TIME])
        if landed and ended < SHORT:
            elevation = numeric(self._model, "ramp_elevation")
            raised = "" if elevation is None else f" from {math.degrees(elevation[0]):.0f}°"
            found.append(f"reached the ground {ended:.2f} s after time zero{raised} of elevation")
        return tuple(found)

    def _rail_exit(self, ticks: Array, start: Array) -> tuple[float | None, int]:
        """Time at which the lower lug left the rail [s], None without; first tick in free flight.

        That tick is past the last one where it is still on the rail.
        """
        length = numeric(self._model, "ramp_length")
        if length is None or length[0] <= 0.0:
            return None, 0
        away = np.linalg.norm(ticks[:, POSITION] - start, axis=1)
        off = np.flatnonzero(away > length[0])
        if not off.size:
            return None, len(ticks)
        k = int(off[0])
        return float(np.interp(length[0], away[k - 1 : k + 1], ticks[k - 1 : k + 1, TIME])), k

    def _launch(self) -> Array:
        q = int(self._model.joint("vehicle").qposadr[0])
        return np.array(self._model.qpos0[q : q + 3])

    def _air(self, ticks: Array) -> tuple[Array, Array]:
        """Dynamic pressure [Pa] and Mach number at each tick; zero in a vacuum."""
        enabled, altitude = (
            numeric(self._model, "air_enabled"),
            numeric(self._model, "air_altitude"),
        )
        if enabled is None or altitude is None or not enabled[0]:
            return np.zeros(len(ticks)), np.zeros(len(ticks))
        z = np.ascontiguousarray(ticks[:, POSITION][:, 2])
        profile = numeric(self._model, "air_profile")
        if profile is None:
            rho, sound = _standard_air(z, altitude[0])
        else:
            _check_top(profile, float(z.max()))
            rho, sound = _profile_air(z, profile)
        return 0.5 * rho * ticks[:, AIRSPEED] ** 2, ticks[:, AIRSPEED] / sound

    def _saturation(self, burning: Array) -> float | None:
        if self._plant.twin.gimbal == "fixed" or not len(burning):
            return None
        limit = self.limit - AT_LIMIT
        return float((np.abs(burning[:, COMMAND]) >= limit).any(axis=1).mean())

    def _margin(self, burning: Array) -> float | None:
        if self._plant.twin.gimbal == "fixed" or not len(burning):
            return None
        largest = np.abs(burning[:, COMMAND]).max(axis=1)
        return float(1.0 - np.quantile(largest, 0.95) / self.limit)


def _turn_radius(flown: Array) -> float | None:
    """Smallest radius of the turns of a path over `TURN` [m]; very large where it is straight."""
    time = flown[:, TIME]
    first = np.flatnonzero(time <= time[-1] - TURN) if len(time) else np.empty(0, np.int64)
    if not first.size:
        return None
    last = np.searchsorted(time, time[first] + TURN - HALF_NS)
    speed = np.linalg.norm(flown[:, VELOCITY], axis=1)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))])
    a, b = flown[first, VELOCITY], flown[last, VELOCITY]
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
    return float(((way[last] - way[first]) / np.maximum(angle, 1e-9)).min())


@njit(nogil=True)
def keep(row: Array, time_ns: int, v: Views) -> None:
    """Write a tick to a row (WIDTH,)."""
    row[0] = time_ns * 1e-9
    for k in range(3):
        row[1 + k], row[4 + k] = v.position[k], v.velocity[k]
    row[7], row[8] = v.airspeed[0], v.attack[0]
    row[9], row[10] = v.command[0], v.command[1]
    row[11] = v.error[0] * v.error[0] + v.error[1] * v.error[1]


@njit()
def _standard_air(z: Array, altitude: float) -> tuple[Array, Array]:
    """Density [kg/m³] and speed of sound [m/s] at heights above ground [m]."""
    rho, sound = np.empty_like(z), np.empty_like(z)
    for k in range(z.size):
        rho[k], sound[k] = density(z[k] + altitude), speed_of_sound(z[k] + altitude)
    return rho, sound


@njit()
def _profile_air(z: Array, profile: Array) -> tuple[Array, Array]:
    """The same in a profile of the air."""
    rho, speed = np.empty_like(z), np.empty_like(z)
    for k in range(z.size):
        rho[k] = profile_at(profile, DENSITY, z[k])
        speed[k] = sound(profile_at(profile, TEMPERATURE, z[k]))
    return rho, speed


def _at(time: float, times: Array, values: Array) -> float:
    return float(np.interp(time, times, values))


def _check_top(profile: Array, highest: float) -> None:
    """Refuse a flight that leaves its wind and temperature profile.

    Raises
    ------
    TwinError : both heights
    """
    top = float(profile.reshape(COLUMNS, -1)[0, -1])
    if highest > top:
        raise TwinError(
            f"launch.profile: ends at {top:g} m above the ground and the flight reached"
            f" {highest:.0f} m; must cover it: add higher levels"
        )


def _accelerations(ticks: Array) -> Array:
    """Mean acceleration between ticks [m/s²]."""
    change = np.linalg.norm(np.diff(ticks[:, VELOCITY], axis=0), axis=1)
    return np.asarray(change / np.diff(ticks[:, TIME]))


def _largest_degrees(angle: Array) -> float | None:
    defined = angle[np.isfinite(angle)]
    return math.degrees(float(defined.max())) if defined.size else None
