"""A recorded rig: the frames of a run again, fused again, at the ticks that took them then."""

import json

import numpy as np
from numpy.typing import NDArray

from analysis.recording import Recording, TimeSeries
from analysis.schema import RARE
from hardware.calibration import Calibration, parsed
from hardware.frames import GimbalCommand, GimbalState, HardwareError, Pair, SensorFrame
from hardware.fusion import BaseMap, Fusion
from hardware.protocol import Hello
from hardware.rig import Phase, RigStatistics
from hardware.rig.rig import PULSES
from twin.config.recorded import typed
from twin.errors import TwinError
from twin.hil.playback import recorded_frames
from twin.plant.plant import Plant

Array = NDArray[np.float64]
NEEDED = (
    "gimbal/command",
    "sensors/taken",
    "sensors/session",
    "sensors/gyro_delay",
    "sensors/potentiometer",
    "sensors/gyro",
    "sensors/device_time",
    "sensors/flags",
    "link/connected",
    "link/lost",
    "link/crc_errors",
)
OF_A_TURNTABLE = ("sensors/base_gyro", "sensors/base_accelerometer")
LARGEST_READING = 1e6  # rad/s, m/s² and fractions of a supply stay far below
LONGEST_MEMORY = 100_000  # characters; an estimator remembers some three thousand


def base_of(tape: Recording) -> BaseMap:
    """Map of the turning base that a recorded rig stood on.

    Raises
    ------
    TwinError, HardwareError : there is none, or it is no such map
    """
    values = tape.properties.get("base")
    names = BaseMap.__dataclass_fields__
    if not isinstance(values, dict) or set(values) != set(names):
        raise TwinError("the recording has no map of the base IMU that its controller saw")
    kinds = {"gyro_bias": tuple[float, float, float]}
    return BaseMap(**{n: typed(f"base.{n}", values[n], kinds.get(n, float)) for n in names})


def calibration_of(tape: Recording, *, given: bool) -> Calibration | None:
    """The calibration that a recorded run was given, as its recording keeps it; None without one.

    Parameters
    ----------
    given : whether the run's configuration names one

    Raises
    ------
    TwinError, HardwareError : it is missing, or no sound calibration
    """
    if not given:
        return None
    files = tape.properties.get("files")
    kept = files.get("calibration") if isinstance(files, dict) else None
    text = kept.get("text") if isinstance(kept, dict) else None
    if not isinstance(text, str):
        raise TwinError("the recording does not hold the calibration that its run was given")
    return parsed(text, "the recording's calibration")


class _Held:
    """A signal recorded where it changed."""

    def __init__(self, series: TimeSeries) -> None:
        self._times, self._values = series.time_ns, series.values[:, 0].tolist()

    def at(self, time_ns: int) -> float:
        """The value in force at a time [ns]; the first one before it, 0 without any."""
        k = int(np.searchsorted(self._times, time_ns, side="right")) - 1
        return float(self._values[max(k, 0)]) if self._values else 0.0


class RecordedRig:
    """Stands in for `hardware.rig.Rig`; whatever is sent to it goes nowhere.

    The estimator begins with what it remembered when the recorded run began and takes the same
    frames in the same order, so its states are those of then to the last bit.

    Parameters
    ----------
    tape : recording of a run with a rig
    calibration : that the run had
    plant : whose time is the experiment's
    turns : whether it stood on a turntable, whose readings must be there then

    Raises
    ------
    TwinError : the recording lacks what a replay needs
    """

    def __init__(
        self, tape: Recording, calibration: Calibration, plant: Plant, *, turns: bool = False
    ) -> None:
        _check(tape, turns=turns)
        self.calibration = calibration
        self.fusion = Fusion(calibration)
        self.states: list[GimbalState] = []
        self.hello: Hello | None = None
        self.gyro_delay = 0.0
        self.reason, self.started = "recorded", ""
        self._memory, self.session = _memory(tape.estimator)
        self._plant = plant
        self._frames = recorded_frames(tape, tape["sensors/potentiometer"].time_ns)
        self._taken = np.rint(tape["sensors/taken"].values[:, 0] * 1e9).astype(np.int64)
        self._session, self._delay = (
            _Held(tape[f"sensors/{n}"]) for n in ("session", "gyro_delay")
        )
        self._link = tuple(_Held(tape[f"link/{n}"]) for n in ("connected", "lost", "crc_errors"))
        self._next, self._begun = 0, False

    def _then(self, what: int) -> float:
        return self._link[what].at(self._plant.time_ns)

    @property
    def phase(self) -> Phase:
        """Whether the rig was connected then."""
        return Phase.READY if self._then(0) > 0.0 else Phase.AWAY

    @property
    def statistics(self) -> RigStatistics:
        """Losses as they were."""
        lost, damaged = round(self._then(1)), round(self._then(2))
        return RigStatistics(1, lost, damaged, 0, 0, 0, 0, (), 0, 0, 0, 0.0)

    @property
    def health(self) -> str:
        """Health as the estimator tells it again."""
        told = self.fusion.monitor.describe()
        return told if self.phase is Phase.READY else f"rig {self.phase}"

    @property
    def turntable_limits(self) -> Pair:
        """As every device has them at first [s]."""
        return PULSES

    def connect(self) -> None:
        """Do nothing; it is there."""

    def renew(self, base: BaseMap | None = None) -> None:
        """Take up what the estimator remembered when the run began."""
        self.fusion = Fusion(self.calibration, base=base)
        self.fusion.restore(self._memory)

    def poll(self) -> list[SensorFrame]:
        """Return the frames that the present tick took then, fused anew."""
        if not self._begun:  # what came before the run is in the memory
            self._begun = True
            self.states = []
            return []
        end = int(np.searchsorted(self._taken, self._plant.time_ns, side="right"))
        frames = self._frames[self._next : end]
        self.states = [self._fused(k) for k in range(self._next, end)]
        self._next = max(end, self._next)
        return frames

    def _fused(self, k: int) -> GimbalState:
        stamp = self._frames[k].time_ns
        session = round(self._session.at(stamp))
        if session != self.session:
            self.fusion.restart()
        self.session, self.gyro_delay = session, self._delay.at(stamp)
        if self.gyro_delay != self.fusion.noise.gyro_delay:
            self.fusion.set_gyro_delay(self.gyro_delay)
        try:
            return self.fusion.update(self._frames[k])
        except (ArithmeticError, ValueError) as error:
            at = self._frames[k].time_ns * 1e-9
            raise TwinError(f"the recorded reading at {at:.3f} s is none: {error}") from None

    def listen(self) -> bool:
        """Nothing more is to be heard."""
        return False

    def send(self, command: GimbalCommand, turntable: float = 0.0) -> None:
        """Do nothing; what was sent then is on the tape."""

    def send_pulses(self, x: float, y: float, turntable: float = 0.0) -> None:
        """Do nothing."""

    def name(self, serial: int) -> None:
        """Do nothing."""

    def neutral(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


def _check(tape: Recording, *, turns: bool) -> None:
    """Refuse a recording that lacks what a replay takes from it."""
    needed = (*NEEDED, *OF_A_TURNTABLE) if turns else NEEDED
    missing = [n for n in needed if n not in tape.series or not len(tape[n].time)]
    if missing or not tape.estimator:
        lacks = ", ".join(missing) or "the estimator's memory"
        raise TwinError(f"the recording has no {lacks}: its rig's readings cannot be repeated")
    readings = [n for n in needed if n.startswith("sensors/")]
    lengths = {len(tape[n].time) for n in readings if n not in RARE}
    if len(lengths) > 1:
        raise TwinError("the recording's readings have lost some of their columns")
    for name in readings:
        largest = 1e9 if name == "sensors/device_time" else LARGEST_READING
        if not (np.abs(tape[name].values) < largest).all():  # NaN neither
            raise TwinError(f"the recording's {name} holds numbers that no device sends")
    if (np.diff(tape["sensors/taken"].values[:, 0]) < 0.0).any():
        raise TwinError("the recording's sensors/taken run backwards")


def _memory(text: str) -> tuple[dict[str, object], int]:
    """What the estimator remembered, and the session it was in."""
    if len(text) > LONGEST_MEMORY:
        raise TwinError(f"the estimator's memory is of {len(text)} characters; something is wrong")
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        found = None
    fusion = found.get("fusion") if isinstance(found, dict) else None
    session = found.get("session") if isinstance(found, dict) else None
    if not isinstance(fusion, dict) or not isinstance(session, int):
        raise HardwareError("the estimator's memory is not what a rig's estimator remembers")
    return fusion, session
