"""`twin mechanism search`: gimbals that fit between a motor and a tube, checked and ranked."""

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

import numpy as np

from analysis.files import write_text
from twin import status
from twin.config.mechanism import Mechanism as Settings
from twin.config.paths import writable
from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.experiments.mechanism.build import write
from twin.experiments.mechanism.figures import MechanismResult, figures
from twin.physics.mechanism.dimensions import SLIM, WIDE, Dimensions, Servo
from twin.physics.motor import load
from twin.physics.vehicle import VehicleError
from twin.physics.vehicle.write import entries

MARGIN: Final = math.radians(2.0)  # of the stops over the stroke
BALL: Final = 0.0020  # m, radius of a rod's ball
FREE: Final = 0.0004  # m, between what moves and the bore
BOARD: Final = (0.0140, 0.0056)  # m: half a diagonal of the IMU's board, its top above the motor
# 4.8 g class: 20 x 8.6 x 17 mm, 0.6 kg cm at 4.8 V, data sheet of the Hitec HS-40
SMALL_SERVO: Final = Servo(
    length=0.020, depth=0.017, width=0.0086, shaft=0.0052, ears=0.028, screws=0.024,
    flange=0.0039, mass=0.0048, torque=0.059,
)  # fmt: skip
USUAL: Final = 0.33  # of horn over lever: 10° take 30° of the servo
CHECKED: Final = 40  # candidates whose parts are drawn and measured, at most
WANTED: Final = 3


@dataclass(frozen=True)
class Candidate:
    """A mechanism that fits and its figures.

    Attributes
    ----------
    size : dimensions
    figures : as `twin mechanism check` prints them
    """

    size: Dimensions
    figures: MechanismResult

    @property
    def diameter(self) -> float:
        """Smallest bore that it would fit with the accepted gap [m]."""
        bore = self.figures.bore
        spare = 0.0 if bore is None else bore.distance - self.figures.gap_mm * 1e-3
        return self.size.bore - 2 * spare

    @property
    def merits(self) -> tuple[float, float, float, float]:
        """Resolution, need of torque, diameter and coupling; smaller is better."""
        found = self.figures
        return found.step_deg, 1 / found.torque.reserve, self.diameter, found.coupling


@dataclass(frozen=True)
class SearchResult(Result):
    """Mechanisms that fit, the best first."""

    file: str
    found: tuple[Candidate, ...]

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        return {
            "file": self.file,
            "found": [{**asdict(c.size), "stl": [], **c.figures.as_dict()} for c in self.found],
        }

    def rows(self) -> Rows:
        """One block for each mechanism."""
        rows: Rows = []
        for k, found in enumerate(self.found):
            size, own = found.size, found.figures
            rows += [
                (f"{k + 1}", f"horn {size.horn * 1e3:.3g} mm, lever {size.lever * 1e3:.3g} mm"),
                ("", (f"resolution {own.step_deg:.3f}° per µs, torque reserve"
                     f" {own.torque.reserve:.1f}, coupling {own.coupling:.3f}")),
                ("", (f"fits a bore of {found.diameter * 1e3:.1f} mm; servos"
                     f" {min(own.servo_deg):.0f}° to {max(own.servo_deg):.0f}°")),
            ]  # fmt: skip
        return [*rows, ("written", self.file), ("", f"twin mechanism build {self.file}")]


def searched(config: Settings) -> SearchResult:
    """Find mechanisms for a tube, a motor and a stroke.

    Raises
    ------
    TwinError : none fits, or the result cannot be written
    """
    assert config.tube_mm is not None
    motor = _motor(config)
    across = f"{motor.diameter * 1e3:g}"
    out = config.out or Path("runs") / f"gimbal_{across}_in_{config.tube_mm:g}.toml"
    out = writable(out, ".toml", force=config.force)
    bore = (config.tube_mm - 2 * config.wall_mm) * 1e-3
    asked = f"--tube-mm {config.tube_mm:g} with a motor of {across} mm"
    stroke = math.radians(config.stroke_deg)
    candidates = list(itertools.islice(_candidates(bore, motor, stroke), CHECKED))
    if not candidates:
        raise TwinError(f"{asked}: {_too_narrow(config, motor, stroke)}")
    found, wrong = _checked(config, candidates)
    if not found:
        raise TwinError(
            f"{asked}: none of {len(candidates)} mechanisms with {config.stroke_deg:g}° that fit by"
            f" their outlines passes; most often: {_commonest(wrong)}: give a wider tube, a smaller"
            " --stroke-deg, a smaller --gap-mm or a lighter motor"
        )
    ranks = np.argsort(np.argsort([c.merits for c in found], axis=0), axis=0).sum(axis=1)
    ordered = [found[k] for k in np.argsort(ranks, kind="stable")]
    write_text(out, _toml(ordered[0].size))
    return SearchResult(str(out), tuple(ordered))


def _checked(
    config: Settings, candidates: Sequence[Dimensions]
) -> tuple[list[Candidate], list[str]]:
    """The first candidates that pass, and what is wrong with the others."""
    found: list[Candidate] = []
    wrong: list[str] = []
    with TemporaryDirectory(prefix="tvc-twin-") as folder:
        for k, size in enumerate(candidates):
            status.say(
                f"checking mechanism {k + 1} of {len(candidates)} that fit by their outlines,"
                f" {len(found)} of {WANTED} found"
            )
            model = Path(folder) / f"{k}.xml"
            try:
                write(size, model)
                own = figures(model, config.load_g, config.gap_mm, clear=True, quick=True)
            except TwinError as error:
                wrong.append(str(error))
                continue
            wrong += own.failures[:1]
            if own.passed:
                found.append(Candidate(size, own))
            if len(found) == WANTED:
                break
    return found, wrong


def _commonest(texts: Sequence[str]) -> str:
    """The first text of those that are alike but for their numbers, and are most."""
    kinds = [re.sub(r"-?\d+(\.\d+)?", "0", text) for text in texts]
    return texts[kinds.index(Counter(kinds).most_common(1)[0][0])]


def _too_narrow(config: Settings, motor: "_Motor", stroke: float) -> str:
    """Which tube the motor needs, by the outlines of the parts."""
    wall = 2e-3 * config.wall_mm
    for k in range(1000):
        bore = motor.diameter + 2 * SLIM + k * 1e-3
        if any(_candidates(bore, motor, stroke)):
            needed = math.ceil(round((bore + wall) * 1e3, 6))
            return (
                f"too narrow for {config.stroke_deg:g}°; by the outlines of the parts it must be"
                f" {needed} mm or more with a wall of {config.wall_mm:g} mm"
            )
    return f"no tube has a mechanism with {config.stroke_deg:g}°; give a smaller --stroke-deg"


class _Motor(NamedTuple):
    """Sizes [m] and masses [kg] of the motor; None where they are not known."""

    diameter: float
    length: float | None = None
    loaded: float | None = None
    propellant: float | None = None


def _motor(config: Settings) -> _Motor:
    if config.motor is None:
        assert config.motor_mm is not None
        return _Motor(config.motor_mm * 1e-3)
    own = load(config.motor)
    return _Motor(own.diameter, own.length, own.loaded_mass, own.propellant_mass)


def _candidates(bore: float, motor: _Motor, stroke: float) -> Iterator[Dimensions]:
    """Candidates with 9 g servos, or with smaller ones where these do not fit."""
    found = list(_fitting(bore, motor, stroke, Servo()))
    yield from found or _fitting(bore, motor, stroke, SMALL_SERVO)


def _fitting(bore: float, motor: _Motor, stroke: float, servo: Servo) -> Iterator[Dimensions]:
    """Dimensions that fit by their outlines, those with the finest resolution first.

    Between the narrowest bore and that of the reference, places change in proportion.
    """
    r, big = motor.diameter / 2, bore / 2
    stops = stroke + MARGIN
    share = min((big - r - SLIM) / (WIDE - SLIM), 1.0)
    wide = share == 1.0
    high = max(r - 0.0145, 0.0) * math.sin(stops)  # the seats of the rods swing over the ring
    fit = []
    for horn, more, rods in itertools.product(
        (0.005, 0.006, 0.007, 0.008, 0.010, 0.012),
        (0.0, 0.002, 0.004, 0.007), (0.036, 0.041, 0.046),
    ):  # fmt: skip
        lever = _rounded(r + 0.0034 + 0.0026 * share + more)
        height = _rounded(
            max(0.0102 + 0.0028 * share + high, _passing(lever, stops, over=more > 0))
        )
        offset, stud = _rounded(0.0005 + 0.0023 * share), _rounded(0.0034 - 0.0006 * share)
        forward = _rounded(_forward(big, stops) if wide else height + 0.0048)
        reach = lever * math.cos(stops) + height * math.sin(stops) + BALL + FREE
        inside = max(reach, lever + offset + BALL + FREE) <= big
        if not inside or not _holds(servo, horn, lever + offset - stud, big):
            continue
        shaft = _rounded(max(height + rods, forward + 0.011 + servo.width / 2))
        try:
            size = Dimensions(
                bore=bore, motor=motor.diameter, motor_length=motor.length,
                motor_mass=motor.loaded, propellant=motor.propellant,
                forward=forward, aft=_rounded(_aft(r, big, stops)),
                lever=lever, height=height, horn=horn, offset=offset, stud=stud, servo_x=shaft,
                servo_y=_rounded(shaft + servo.width + 0.0089 - 0.0056 * share), stroke=stroke,
                stops=stops, servo=servo,
            )  # fmt: skip
        except VehicleError:
            continue
        fit.append(size)
    yield from sorted(fit, key=lambda size: abs(size.horn / size.lever - USUAL))


def _rounded(length: float) -> float:
    """To a tenth of a millimetre."""
    return round(length, 4)


def _passing(lever: float, stops: float, *, over: bool) -> float:
    """Height at which the lower end of a rod passes the bulkhead, whose pads need 3 mm [m].

    With `over` its seat on the holder, which reaches over the ring, passes the ring too.
    """
    return ((0.0106 if over else 0.0067) + lever * math.sin(stops)) / math.cos(stops)


def _forward(big: float, stops: float) -> float:
    """Farthest forward end of the motor whose sensor board stays in the bore [m]."""
    both = math.acos(math.cos(stops) ** 2)
    most = (big - FREE - BOARD[0] * math.cos(both)) / math.sin(both) - BOARD[1]
    return min(0.036, most)


def _aft(r: float, big: float, stops: float) -> float:
    """End of the tube that the holder's clamp or the motor does not touch [m]."""
    both = math.acos(math.cos(stops) ** 2)
    lug = r + 0.0047  # at 24 mm aft; the holder ends there
    if lug * math.cos(both) + 0.024 * math.sin(both) + FREE < big:
        return min(0.030, (big - FREE - r * math.cos(both)) / math.sin(both))
    return 0.008


def _holds(servo: Servo, horn: float, face: float, big: float) -> bool:
    """Whether the bore takes the servo's case and ears behind a horn's face."""
    middle = servo.shaft - horn
    top = face - 0.0065
    corners = [
        (middle + side * half, y)
        for half, ends in (
            (servo.length / 2, (top, top - servo.depth)),
            (servo.ears / 2, (top - servo.flange,)),
        )
        for side in (-1, 1)
        for y in ends
    ]
    return max(math.hypot(x, y) for x, y in corners) + FREE < big


def _toml(size: Dimensions) -> str:
    """Text of the dimensions, as `twin mechanism build` reads it."""
    own = replace(size, motor_length=size.size, motor_mass=size.loaded, propellant=size.burning)
    lines = [f"{key} = {text}" for key, text in entries(own)]
    servo = ", ".join(f"{key} = {text}" for key, text in entries(size.servo))
    return (
        "# Found by twin mechanism search.\n" + "\n".join([*lines, f"servo = {{ {servo} }}"]) + "\n"
    )
