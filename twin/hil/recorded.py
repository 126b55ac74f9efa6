"""A recorded rig: the frames of a run, fused again at the ticks that took them."""

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
TURNTABLE_SIGNALS = ("sensors/base_gyro", "sensors/base_accelerometer")
LARGEST_READING = 1e6  # rad/s, m/s² and fractions of a supply stay far below
LONGEST_MEMORY = 100_000  # characters; the state of an estimator takes about 3000


def base_of(recording: Recording) -> BaseMap:
    """Map of the turntable of a recorded rig.

    Raises
    ------
    TwinError, HardwareError : it is missing or invalid
    """
    values = recording.properties.get("base")
    names = BaseMap.__dataclass_fields__
    if not isinstance(values, dict) or set(values) != set(names):
        raise TwinError("the recording has no map of its base IMU, which a replay needs")
    kinds = {"gyro_bias": tuple[float, float, float]}
    return BaseMap(**{n: typed(f"base.{n}", values[n], kinds.get(n, float)) for n in names})


def calibration_of(recording: Recording, *, given: bool) -> Calibration | None:
    """The calibration of a recorded run, from its recording; None without one.

    Parameters
    ----------
    given : whether the configuration of the run names one

    Raises
    ------
    TwinError, HardwareError : it is missing or invalid
    """
    if not given:
        return None
    files = recording.properties.get("files")
    kept = files.get("calibration") if isinstance(files, dict) else None
    text = kept.get("text") if isinstance(kept, dict) else None
    if not isinstance(text, str):
        raise TwinError("the recording has no copy of the calibration of its run")
    return parsed(text, "the recording's calibration")


class _StepSignal:
    """A piecewise constant signal, recorded where it changed."""

    def __init__(self, series: TimeSeries) -> None:
        self._times, self._values = series.time_ns, series.values[:, 0].tolist()

    def at(self, time_ns: int) -> float:
        """Value at a time [ns]: the last one before it, else the first; 0 without values."""
        k = int(np.searchsorted(self._times, time_ns, side="right")) - 1
        return float(self._values[max(k, 0)]) if self._values else 0.0


class RecordedRig:
    """Takes the place of `hardware.rig.Rig`; ignores what is sent.

    The estimator starts from its recorded state and takes the same frames in the same order, so its
    estimates equal those of the recorded run bit for bit.

    Parameters
    ----------
    recording : recording of a run with a rig
    calibration : of that run
    plant : its time is the experiment time
    turntable : whether the rig stood on a turntable, whose readings are then required

    Raises
    ------
    TwinError : the recording lacks what a replay needs
    """

    def __init__(
        self,
        recording: Recording,
        calibration: Calibration,
        plant: Plant,
        *,
        turntable: bool = False,
    ) -> None:
        _check(recording, turntable=turntable)
        self.calibration = calibration
        self.fusion = Fusion(calibration)
        self.states: list[GimbalState] = []
        self.hello: Hello | None = None
        self.gyro_delay = 0.0
        self.reason, self.started = "recorded", ""
        self._memory, self.session = _memory(recording.estimator)
        self._plant = plant
        self._frames = recorded_frames(recording, recording["sensors/potentiometer"].time_ns)
        self._taken = np.rint(recording["sensors/taken"].values[:, 0] * 1e9).astype(np.int64)
        self._session, self._delay = (
            _StepSignal(recording[f"sensors/{n}"]) for n in ("session", "gyro_delay")
        )
        self._link = tuple(
            _StepSignal(recording[f"link/{n}"]) for n in ("connected", "lost", "crc_errors")
        )
        self._next, self._begun = 0, False

    def _recorded(self, what: int) -> float:
        return self._link[what].at(self._plant.time_ns)

    @property
    def phase(self) -> Phase:
        """Recorded state of the connection."""
        return Phase.READY if self._recorded(0) > 0.0 else Phase.AWAY

    @property
    def statistics(self) -> RigStatistics:
        """Recorded losses."""
        lost, damaged = round(self._recorded(1)), round(self._recorded(2))
        return RigStatistics(1, lost, damaged, 0, 0, 0, 0, (), 0, 0, 0, 0.0)

    @property
    def health(self) -> str:
        """Health given by the estimator."""
        health = self.fusion.monitor.describe()
        return health if self.phase is Phase.READY else f"rig {self.phase}"

    @property
    def turntable_limits(self) -> Pair:
        """Default limits of a device [s]."""
        return PULSES

    def connect(self) -> None:
        """Do nothing."""

    def renew(self, base: BaseMap | None = None) -> None:
        """Restore the recorded state of the estimator."""
        self.fusion = Fusion(self.calibration, base=base)
        self.fusion.restore(self._memory)

    def poll(self) -> list[SensorFrame]:
        """Return the frames that this tick took in the recorded run, fused again."""
        if not self._begun:  # frames before the run are in the recorded state
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
            raise TwinError(f"the recorded reading at {at:.3f} s is invalid: {error}") from None

    def listen(self) -> bool:
        """Do nothing."""
        return False

    def send(self, command: GimbalCommand, turntable: float = 0.0) -> None:
        """Do nothing."""

    def send_pulses(self, x: float, y: float, turntable: float = 0.0) -> None:
        """Do nothing."""

    def name(self, serial: int) -> None:
        """Do nothing."""

    def neutral(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


def _check(recording: Recording, *, turntable: bool) -> None:
    """Refuse a recording that lacks what a replay needs."""
    needed = (*NEEDED, *TURNTABLE_SIGNALS) if turntable else NEEDED
    missing = [n for n in needed if n not in recording.series or not len(recording[n].time)]
    if missing or not recording.estimator:
        lacks = ", ".join(missing) or "state of the estimator"
        raise TwinError(f"the recording has no {lacks}: the readings of its rig cannot be replayed")
    readings = [n for n in needed if n.startswith("sensors/")]
    lengths = {len(recording[n].time) for n in readings if n not in RARE}
    if len(lengths) > 1:
        raise TwinError("the recording's sensor signals have different lengths")
    for name in readings:
        largest = 1e9 if name == "sensors/device_time" else LARGEST_READING
        if not (np.abs(recording[name].values) < largest).all():  # also refuses NaN
            raise TwinError(f"the recording's {name} has impossible values")
    if (np.diff(recording["sensors/taken"].values[:, 0]) < 0.0).any():
        raise TwinError("the recording's sensors/taken must not decrease")


def _memory(text: str) -> tuple[dict[str, object], int]:
    """Recorded state of the estimator, and its session."""
    if len(text) > LONGEST_MEMORY:
        raise TwinError(
            f"the recorded state of the estimator has {len(text)} characters; must be at most"
            f" {LONGEST_MEMORY}"
        )
    try:
        memory = json.loads(text)
    except (ValueError, RecursionError):
        memory = None
    fusion = memory.get("fusion") if isinstance(memory, dict) else None
    session = memory.get("session") if isinstance(memory, dict) else None
    if not isinstance(fusion, dict) or not isinstance(session, int):
        raise HardwareError("the recorded state of the estimator is invalid")
    return fusion, session
