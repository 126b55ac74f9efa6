"""A recorded rig: the frames of a run again, fused again, at the ticks that took them then."""

import json

import numpy as np
from numpy.typing import NDArray

from analysis.recording import Recording, TimeSeries
from hardware.calibration import Calibration, parsed
from hardware.frames import GimbalCommand, GimbalState, HardwareError, Pair, SensorFrame
from hardware.fusion import BaseMap, Fusion
from hardware.link import Gap
from hardware.protocol import Hello
from hardware.rig import Phase, RigStatistics
from hardware.rig.rig import PULSES
from twin.errors import TwinError
from twin.plant import Plant
from twin.recalled import typed
from twin.rigs.tape import recorded_frames

Array = NDArray[np.float64]
NEEDED = (
    "sensors/taken",
    "sensors/session",
    "sensors/gyro_delay",
    "sensors/potentiometer",
    "link/connected",
    "link/lost",
    "link/crc_errors",
)
LONGEST_MEMORY = 100_000  # characters; an estimator remembers some three thousand


def base_of(tape: Recording) -> BaseMap | None:
    """Map of the base that a recorded rig stood on; None where it did not turn.

    Raises
    ------
    TwinError, HardwareError : it is no such map
    """
    values = tape.properties.get("base")
    if values is None:
        return None
    names = BaseMap.__dataclass_fields__
    if not isinstance(values, dict) or set(values) != set(names):
        raise TwinError("the recording's map of the base IMU is not one")
    kinds = {"gyro_bias": tuple[float, float, float]}
    return BaseMap(**{n: typed(f"base.{n}", values[n], kinds.get(n, float)) for n in names})


def calibration_of(tape: Recording) -> Calibration | None:
    """The calibration that a recorded run was given, as its recording keeps it; None without one.

    Raises
    ------
    HardwareError : it is no sound calibration
    """
    files = tape.properties.get("files")
    kept = files.get("calibration") if isinstance(files, dict) else None
    text = kept.get("text") if isinstance(kept, dict) else None
    return parsed(text, "the recording's calibration") if isinstance(text, str) else None


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

    Raises
    ------
    TwinError : the recording lacks what a replay needs
    """

    def __init__(self, tape: Recording, calibration: Calibration, plant: Plant) -> None:
        missing = [name for name in NEEDED if name not in tape.series]
        if missing or not tape.estimator:
            lacks = ", ".join(missing) or "the estimator's memory"
            raise TwinError(f"the recording has no {lacks}: its rig's readings cannot be repeated")
        self.calibration = calibration
        self.fusion = Fusion(calibration)
        self.states: list[GimbalState] = []
        self.hello: Hello | None = None
        self.session = 0
        self.gyro_delay = 0.0
        self._memory = _memory(tape.estimator)
        self._plant = plant
        self._frames = recorded_frames(tape, tape["sensors/potentiometer"].time_ns)
        self._taken = np.rint(tape["sensors/taken"].values[:, 0] * 1e9).astype(np.int64)
        self._session = tape["sensors/session"].values[:, 0].astype(np.int64).tolist()
        self._delay = tape["sensors/gyro_delay"].values[:, 0].tolist()
        if not len(self._frames) == len(self._taken) == len(self._session) == len(self._delay):
            raise TwinError("the recording's readings have lost some of their columns")
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
        gaps = () if self.phase is Phase.READY else (Gap(self._plant.time_ns, None, "recorded"),)
        lost, damaged = round(self._then(1)), round(self._then(2))
        return RigStatistics(1, lost, damaged, 0, 0, 0, 0, gaps, 0, 0, 0, 0.0)

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
        if self.session and self._session[k] != self.session:
            self.fusion.restart()
        self.session = self._session[k]
        self.gyro_delay = self._delay[k]
        if self.gyro_delay != self.fusion.noise.gyro_delay:
            self.fusion.set_gyro_delay(self.gyro_delay)
        return self.fusion.update(self._frames[k])

    def listen(self) -> bool:
        """Nothing more is to be heard."""
        return False

    def send(self, command: GimbalCommand, turntable: float = 0.0) -> None:
        """Do nothing; what was sent then is on the tape."""

    def send_pulses(self, x: float, y: float, turntable: float = 0.0) -> None:
        """Do nothing."""

    def neutral(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


def _memory(text: str) -> dict[str, object]:
    if len(text) > LONGEST_MEMORY:
        raise TwinError(
            f"the estimator's memory is {len(text)} characters long; something is wrong"
        )
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise HardwareError("the estimator's memory is no JSON object")
    return found
