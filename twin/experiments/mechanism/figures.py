"""What a gimbal mechanism can do, and whether its parts clear each other."""

import math
from dataclasses import asdict, dataclass
from pathlib import Path

import mujoco
import numpy as np

from hardware.frames import AXES
from hardware.parts import SERVO_TRAVEL
from twin.config.result import Result, Rows
from twin.physics.mechanism import Kinematics, mobility
from twin.physics.mechanism.clearance import Clearance, Gap
from twin.physics.mechanism.torque import Torque, holding
from twin.plant.authority import numeric, stroke
from twin.plant.model.compose import MJCF
from twin.plant.model.model import ModelConfig, load

MICROSECOND = 1e-6  # s, step of a servo's pulse
REFERENCE = MJCF / "mechanism.xml"


@dataclass(frozen=True)
class MechanismResult(Result):
    """Figures of a mechanism.

    Attributes
    ----------
    file : MJCF file
    mobility : degrees of freedom without idle ones, as a text
    stops_deg : ends of the gimbal angles, x low, high, y low, high
    servo_deg : shaft angles that these take, the same
    stroke_deg : largest command either way
    gain : gimbal over servo angle (x, y) at home
    gain_range : least and largest over the commanded angles, both axes
    coupling : largest gimbal angle of the other axis per gimbal angle, over the commanded angles
    step_deg, dead_band_deg, backlash_deg : at the gimbal (largest gain): of 1 µs of pulse, the
        half width of the servo's dead band, the gear's backlash
    torque : held against `load_g` across the tube
    clearance, bore : smallest gaps; None where they were not measured, or there is no tube
    gap_mm : smallest that is accepted
    """

    file: str
    mobility: str
    stops_deg: tuple[float, float, float, float]
    servo_deg: tuple[float, float, float, float]
    stroke_deg: float
    gain: tuple[float, float]
    gain_range: tuple[float, float]
    coupling: float
    step_deg: float
    dead_band_deg: float
    backlash_deg: float
    load_g: float
    torque: Torque
    clearance: Gap | None
    bore: Gap | None
    gap_mm: float

    @property
    def passed(self) -> bool:
        """Whether the servos are strong enough and the clearances are kept."""
        return self.torque.reserve >= 1.0 and all(self._clear(g) for g in self._gaps)

    @property
    def _gaps(self) -> list[Gap]:
        return [gap for gap in (self.clearance, self.bore) if gap is not None]

    def _clear(self, gap: Gap) -> bool:
        return gap.distance * 1e3 >= self.gap_mm

    def as_dict(self) -> dict[str, object]:
        """JSON values, in SI units unless the name gives another."""
        return {**asdict(self), "torque_reserve": self.torque.reserve, "passed": self.passed}

    def rows(self) -> Rows:
        """The figures as a table."""
        x0, x1, y0, y1 = self.stops_deg
        u0, u1, v0, v1 = self.servo_deg
        needed, stall = (max(self.torque.needed), min(self.torque.stall))
        least, most = self.gain_range
        rows = [
            ("mechanism", self.file),
            ("mobility", self.mobility),
            ("stops", f"x {x0:.1f}° to {x1:.1f}°, y {y0:.1f}° to {y1:.1f}°"),
            ("servos", f"x {u0:.1f}° to {u1:.1f}°, y {v0:.1f}° to {v1:.1f}° for all of it"),
            ("gain at home", f"{self.gain[0]:.3f} (x), {self.gain[1]:.3f} (y) gimbal per servo"),
            ("", f"{least:.3f} to {most:.3f} within ±{self.stroke_deg:.3g}°"),
            ("coupling", f"{self.coupling:.3f} of an axis's angle on the other, at most"),
            ("resolution", f"{self.step_deg:.3f}° for 1 µs of pulse"),
            ("", f"dead band ±{self.dead_band_deg:.3f}°, backlash {self.backlash_deg:.3f}°"),
            ("torque", f"{needed * 1e3:.1f} N mm at {self.load_g:g} g across the tube"),
            ("", f"stall {stall * 1e3:.0f} N mm, reserve {self.torque.reserve:.1f}"),
        ]
        if self.clearance is not None:
            rows.append(("smallest gap", self.clearance.text))
        if self.bore is not None:
            rows.append(("", f"{self.bore.text} (its bore)"))
        return rows + [("FAILED", text) for text in self.failures]

    @property
    def failures(self) -> list[str]:
        """What is not passed, with its figures, one line each."""
        texts = []
        if self.torque.reserve < 1.0:
            needed, stall = max(self.torque.needed) * 1e3, min(self.torque.stall) * 1e3
            texts.append(
                f"the servos stall at {stall:.0f} N mm, {self.load_g:g} g takes {needed:.0f} N mm"
            )
        tight = [gap.text for gap in self._gaps if not self._clear(gap)]
        return texts + [f"{text}; must be {self.gap_mm:g} mm or more" for text in tight]


def figures(
    file: Path, load_g: float, gap_mm: float, *, clear: bool, quick: bool = False
) -> MechanismResult:
    """Figures of a mechanism's MJCF; with `clear` its clearances too.

    Parameters
    ----------
    quick : stop measuring clearances at the first that is too small

    Raises
    ------
    TwinError : a file that is not a mechanism, in one line
    """
    model = load(ModelConfig(scene="bench", mechanism=file)).mj
    kinematics = Kinematics(model)
    whole = kinematics.workspace()
    ends = np.degrees([model.joint(f"gimbal_{a}").range for a in AXES]).ravel()
    servo = np.degrees([(whole.servo[..., k].min(), whole.servo[..., k].max()) for k in (0, 1)])
    reach = stroke(model)
    home, ratio = ratios(kinematics, reach)
    own = np.abs(ratio[..., [0, 1], [0, 1]])
    most = float(own.max())
    clearance = bore = None
    if clear:
        until = gap_mm * 1e-3 if quick else -math.inf
        clearance, bore = Clearance(model).smallest(until=until)
    return MechanismResult(
        file=_shown(file),
        mobility=mobility(model).text,
        stops_deg=_four(ends),
        servo_deg=_four(servo.ravel()),
        stroke_deg=math.degrees(reach),
        gain=(float(home[0, 0]), float(home[1, 1])),
        gain_range=(float(own.min()), most),
        coupling=coupling(ratio),
        step_deg=float(np.degrees(MICROSECOND * SERVO_TRAVEL)) * most,
        dead_band_deg=_degrees(model, "gimbal_servo_dead_band") * most,
        backlash_deg=_degrees(model, "gimbal_backlash") * most,
        load_g=load_g,
        torque=holding(model, load_g),
        clearance=clearance,
        bore=bore,
        gap_mm=gap_mm,
    )


def ratios(kinematics: Kinematics, stroke: float) -> tuple[np.ndarray, np.ndarray]:
    """∂gimbal/∂servo at home (2, 2), and over the commanded angles (n, n, 2, 2)."""
    angles = np.linspace(-stroke, stroke, 17)
    grid = np.stack(np.meshgrid(angles, angles, indexing="ij"), axis=-1)
    step = 1e-6 * np.eye(2)
    columns = [
        (kinematics.servo_from_gimbal(grid + e) - kinematics.servo_from_gimbal(grid - e)) / 2e-6
        for e in step
    ]
    ratio = np.linalg.inv(np.stack(columns, axis=-1))
    return ratio[8, 8], ratio


def coupling(ratio: np.ndarray) -> float:
    """Largest motion of the other axis per motion of the driven one, one servo moving."""
    other = np.abs(ratio[..., [1, 0], [0, 1]])
    return float((other / np.abs(ratio[..., [0, 1], [0, 1]])).max())


def _degrees(model: mujoco.MjModel, name: str) -> float:
    values = numeric(model, name)
    return 0.0 if values is None else float(np.degrees(values).max())


def _four(values: np.ndarray) -> tuple[float, float, float, float]:
    a, b, c, d = values.tolist()
    return a, b, c, d


def _shown(file: Path) -> str:
    return "the reference mechanism" if file == REFERENCE else str(file)
