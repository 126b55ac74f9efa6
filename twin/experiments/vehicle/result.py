"""Masses and stability of a vehicle as a table, and the file that was built."""

from dataclasses import asdict, dataclass
from typing import Final

from twin.config.result import Result, Rows
from twin.physics.vehicle.barrowman import Term

NO_MACH: Final = "normal forces hold below Mach 0.6; they do not depend on the Mach number"


@dataclass(frozen=True)
class State:
    """A vehicle at one instant of its burn; stations from the origin towards the nose [m].

    Attributes
    ----------
    time : after ignition [s]
    mass : [kg]
    centre_of_mass : [m]
    transverse, axial : moments of inertia about it [kg m²]
    margin : centre of mass ahead of the centre of pressure [calibres]
    """

    time: float
    mass: float
    centre_of_mass: float
    transverse: float
    axial: float
    margin: float


@dataclass(frozen=True)
class Part:
    """A part of a described vehicle: its name, mass [kg] and centre of mass from the tip [m]."""

    name: str
    mass: float
    station: float


@dataclass(frozen=True)
class VehicleResult(Result):
    """Masses and stability of a vehicle.

    Attributes
    ----------
    name : file
    states : over the burn, the first loaded and the last empty
    centre_of_pressure : by angle of attack in degrees [m]
    diameter : of the reference area [m]
    drag : axial drag coefficient
    drag_source : where it comes from
    terms : normal force of each part; empty for an MJCF file
    parts : masses of the airframe, the motor and the gimbal; empty for an MJCF file
    tip : station of the nose's tip [m]; None for an MJCF file
    thrust : largest [N]
    launch : direction and length of its rail, in words
    gimbal : where its pivot is, or could be, in words
    drawn : picture that was written; None without one
    """

    name: str
    states: tuple[State, ...]
    centre_of_pressure: dict[str, float]
    diameter: float
    drag: float
    drag_source: str
    terms: tuple[Term, ...]
    tip: float | None
    thrust: float
    notes: tuple[str, ...] = ()
    parts: tuple[Part, ...] = ()
    launch: str = ""
    gimbal: str = ""
    drawn: str | None = None

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        return asdict(self)

    def rows(self) -> Rows:
        """The figures as a table; stations from the tip where it is known."""
        full, empty = self.states[0], self.states[-1]
        gravity = 9.80665
        rows = [
            ("vehicle", self.name),
            ("mass", f"{full.mass:.4g} kg loaded, {empty.mass:.4g} kg empty"),
            ("thrust / weight", f"{self.thrust / (full.mass * gravity):.2f} at most"),
            ("inertia", f"{_pair(full)} loaded, {_pair(empty)} empty [kg m²], transverse and roll"),
            ("stations from", "the tip of the nose" if self.tip is not None else "the origin"),
        ]
        parts = [f"{p.name}: {p.mass * 1e3:.4g} g at {p.station:.4f} m" for p in self.parts]
        rows += _titled("parts", parts)
        rows += _titled("over the burn", [self._instant(state) for state in self.states])
        pressures = self.centre_of_pressure.items()
        rows += _titled("centre of pressure", [self._pressure(*item) for item in pressures])
        rows.append(("", NO_MACH))
        terms = [f"{t.name}: C_Nα {t.slope:+.3f} at {t.station:.4f} m" for t in self.terms]
        rows += _titled("normal force", terms)
        rows += [("launch", self.launch), ("gimbal", self.gimbal)]
        rows.append(("axial drag", f"{self.drag:.3f} of π/4 ({self.diameter * 1e3:.4g} mm)²"))
        if self.drag_source:
            rows.append(("", self.drag_source))
        rows += [("note", note) for note in self.notes]
        return rows if self.drawn is None else [*rows, ("drawing", self.drawn)]

    def _station(self, z: float) -> float:
        return z if self.tip is None else self.tip - z

    def _instant(self, state: State) -> str:
        return (
            f"{state.time:6.2f} s: mass {state.mass:.4g} kg, centre of mass"
            f" {self._station(state.centre_of_mass):.4f} m, margin {state.margin:+.2f} calibres"
        )

    def _pressure(self, angle: str, z: float) -> str:
        ends = (self.states[0], self.states[-1])
        full, empty = ((end.centre_of_mass - z) / self.diameter for end in ends)
        return (
            f"{float(angle):4.0f}° of attack: {self._station(z):.4f} m, margin {full:+.2f} loaded,"
            f" {empty:+.2f} empty"
        )


@dataclass(frozen=True)
class BuildResult(Result):
    """An MJCF file that was written."""

    file: str
    source: str

    def as_dict(self) -> dict[str, object]:
        """JSON values."""
        return asdict(self)

    def rows(self) -> Rows:
        """What was written, and how to fly it."""
        fly = f"twin fly --vehicle {self.file}"
        return [("description", self.source), ("MJCF", self.file), ("next", fly)]


def _titled(title: str, texts: list[str]) -> Rows:
    """Rows of which only the first has the title."""
    return [(title if k == 0 else "", text) for k, text in enumerate(texts)]


def _pair(state: State) -> str:
    return f"{state.transverse:.3g} and {state.axial:.2g}"
