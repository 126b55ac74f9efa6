"""The MJCF of a mechanism from its dimensions: the reference file with every number replaced."""

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Final

from analysis.files import content
from twin.physics.guard import LARGEST_XML
from twin.physics.mechanism.dimensions import Dimensions

REFERENCE: Final = Path(__file__).resolve().parents[3] / "mjcf" / "mechanism.xml"
SEAT: Final = 0.0041  # m, of a rod's wire behind the centres of its balls
CUP: Final = 0.0037  # m, radius of a rod's lower end, and a gap
STALL: Final = 0.1824  # N m, of the reference servo: 0.38 N m/A at 4.8 V and 10 Ω
REACH: Final = 1.25  # of the servos' commands over what the stroke takes at home


def mjcf(size: Dimensions, folder: str) -> str:
    """MJCF of a mechanism whose meshes are in a folder, relative to the file."""
    root = ET.fromstring(content(REFERENCE, LARGEST_XML))  # noqa: S314  a shipped file
    _Editor(root, size).edit(folder)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


class _Editor:
    """Places every part of the reference file for other dimensions."""

    def __init__(self, root: ET.Element, size: Dimensions) -> None:
        self._root, self._size = root, size
        self._radius, self._bore = size.motor / 2, size.bore / 2

    def edit(self, folder: str) -> None:
        self._root.find("compiler").set("meshdir", folder)  # type: ignore[union-attr]
        if self._size != Dimensions():
            self._without_potentiometers()
        self._drawings()
        self._fixed()
        self._moving()
        for axis, height in (("x", self._size.servo_x), ("y", self._size.servo_y)):
            self._servo(axis, height)
            self._rod(axis, height)
        self._limits()

    def _without_potentiometers(self) -> None:
        """Leave out the potentiometers, which fit the reference bore only."""
        for parent in list(self._root.iter()):
            for child in list(parent):
                if "potentiometer" in child.get("name", ""):
                    parent.remove(child)

    def _set(self, tag: str, name: str, **values: object) -> None:
        """Attributes of a named element; tuples are rounded to a nanometre."""
        element = self._root.find(f".//{tag}[@name='{name}']")
        assert element is not None, name
        for key, value in values.items():
            element.set(key, _text(value))

    def _numeric(self, name: str, *values: float) -> None:
        self._set("numeric", name, data=values)

    def _drawings(self) -> None:
        size, r, bore, wall = self._size, self._radius, self._bore, self._size.wall
        half = size.servo.width / 2
        self._numeric(
            "print_ring", wall(0.0022, 0.0033), wall(0.0038, 0.0057), wall(0.0035, 0.0045) - r,
            0.0035, wall(0.0044, 0.0067),
        )  # fmt: skip
        self._numeric(
            "print_holder", r + 0.00015, wall(0.00135, 0.0015), -0.024, 0.0026,
            wall(0.0018, 0.00265),
        )  # fmt: skip
        # below the cup of a rod's lower end at the stop
        low = size.height * math.cos(size.stops) - size.lever * math.sin(size.stops) - CUP
        self._numeric(
            "print_bulkhead", bore - 0.0016, bore - 0.0001, -0.006, min(0.005, low),
            wall(0.0048, 0.0071),
        )  # fmt: skip
        self._numeric(
            "print_bracket", size.servo_x - half - 0.0025, size.servo_x - half - 0.0001,
            size.servo_x + half + 0.0001, size.servo_y - half - 0.0001,
        )  # fmt: skip
        self._numeric("print_servo", size.servo.screws / 2)

    def _fixed(self) -> None:
        size, bore, wall = self._size, self._bore, self._size.wall
        top = size.servo_y + size.servo.width / 2 + 0.0014
        half, middle = (top + size.aft) / 2, (top - size.aft) / 2
        self._set("site", "tube", size=(bore, half), pos=(0.0, 0.0, middle))
        for side, sign in (("left", -1), ("right", 1)):
            ends = (sign * wall(0.0025, 0.0037), 0.0, 0.0, sign * (bore - 0.0005), 0.0, 0.0)
            self._set("geom", f"pin_x_{side}", fromto=ends)

    def _moving(self) -> None:
        size, r, wall = self._size, self._radius, self._size.wall
        for side, sign in (("left", -1), ("right", 1)):
            pin = (0.0, sign * (r + 0.0011), 0.0, 0.0, sign * wall(0.0039, 0.0059), 0.0)
            head = (0.0, sign * wall(0.0039, 0.0061), 0.0, 0.0, sign * wall(0.0049, 0.0073), 0.0)
            self._set("geom", f"pin_y_{side}", fromto=pin)
            self._set("geom", f"pin_y_{side}_head", fromto=head)
        balls = {"x": (0.0, size.lever), "y": (-size.lever, 0.0)}
        for axis, ball in balls.items():
            foot = [v * (r + 0.001) / size.lever for v in ball]
            for tag in ("geom", "site"):
                self._set(tag, f"holder_{axis}_ball", pos=(*ball, size.height))
            stud = (*foot, size.height, *ball, size.height)
            self._set("geom", f"holder_{axis}_stud", fromto=stud)
        self._set("geom", "imu_board", pos=(0.0, 0.0, size.forward + 0.0042))
        self._set("site", "imu", pos=(0.0, 0.0, size.forward + 0.0051))
        self._set("site", "motor_forward", pos=(0.0, 0.0, size.forward))
        nozzle, middle = size.forward - size.size, size.forward - size.size / 2
        self._set("site", "nozzle", pos=(0.0, 0.0, nozzle))
        for name in ("motor", "propellant"):
            self._set("body", name, pos=(0.0, 0.0, middle))
        self._set("geom", "casing", size=(r, size.size / 2), mass=size.loaded - size.burning)
        grain = (r * 0.0125 / 0.0145, size.size * 0.0697 / 0.2134)
        self._set("geom", "grain", size=grain, mass=size.burning)

    def _servo(self, axis: str, height: float) -> None:
        """A servo whose shaft points outwards; its horn's ball is over the rod's."""
        servo, (shaft, face) = self._size.servo, self._shaft()
        case, half = shaft + servo.shaft, servo.width / 2
        top, flange = face - 0.0065, face - 0.0065 - servo.flange
        name = f"servo_{axis}"
        case_size = (servo.length / 2, servo.depth / 2, half)
        middle = (case, top - servo.depth / 2, height)
        self._set("geom", f"{name}_case", size=case_size, pos=middle, mass=servo.mass)
        ears = (servo.ears / 2, 0.00125, half)
        self._set("geom", f"{name}_ears", size=ears, pos=(case, flange, height))
        self._set(
            "geom", f"{name}_boss", size=half - 0.0002,
            fromto=(shaft, top, height, shaft, face - 0.0025, height),
        )  # fmt: skip
        spline = (shaft, face - 0.0025, height, shaft, face - 0.0007, height)
        self._set("geom", f"{name}_spline", fromto=spline)
        self._set("body", f"horn_{axis}", pos=(shaft, face, height))
        for tag in ("geom", "site"):
            self._set(tag, f"horn_{axis}_ball", pos=(self._size.horn, self._size.stud, 0.0))
        stud = (self._size.horn, -0.002, 0.0, self._size.horn, self._size.stud, 0.0)
        self._set("geom", f"horn_{axis}_stud", fromto=stud)

    def _shaft(self) -> tuple[float, float]:
        """Shaft beside the plane of the rod, and the horn's outer face off the centre line [m]."""
        return -self._size.horn, self._size.lever + self._size.offset - self._size.stud

    def _rod(self, axis: str, height: float) -> None:
        y, z = -self._size.offset, self._size.height - height
        share = SEAT / abs(z)
        wire = (0.0, share * y, share * z, 0.0, (1 - share) * y, (1 - share) * z)
        name = f"rod_{axis}"
        self._set("body", name, pos=(self._size.horn, self._size.stud, 0.0))
        self._set("geom", name, fromto=wire)
        self._set("geom", f"{name}_upper", zaxis=(0.0, -y, -z))
        self._set("geom", f"{name}_lower", pos=(0.0, y, z), zaxis=(0.0, y, z))
        self._set("site", f"{name}_end", pos=(0.0, y, z))

    def _limits(self) -> None:
        """Stops, reach of the servos, and their strength."""
        size, strength = self._size, self._size.servo.torque / STALL
        classes = {c.get("class"): c for c in self._root.iter("default")}
        axis, shaft = (classes[name] for name in ("axis", "shaft"))
        stops = (-size.stops, size.stops)
        axis.find("joint").set("range", _text(stops))  # type: ignore[union-attr]
        self._numeric("stroke", size.stroke)
        joint, motor = shaft.find("joint"), shaft.find("dcmotor")
        assert joint is not None
        assert motor is not None
        for key in ("armature", "damping", "frictionloss"):
            joint.set(key, _text(float(joint.get(key, "0")) * strength))
        reach = max(0.5, REACH * size.stroke * size.lever / size.horn)
        motor.set("ctrlrange", _text((-reach, reach)))
        # another winding of the same motor: its no-load speed, supply / constant, stays
        scales = ("resistance", 1 / strength), ("gain", strength), ("rate_gain", strength)
        for name, scale in scales:
            numeric = self._root.find(f".//numeric[@name='servo_{name}']")
            assert numeric is not None
            numeric.set("data", _text(float(numeric.get("data", "0")) * scale))
        motor.set("resistance", _text(10 / strength))
        # velocity gain: K²/R and the rate gain, as `apply_servo` has it
        motor.set("controller", f"{_text(1.8 * strength)} 0 {_text(0.02244 * strength)} 10.5 0 4.8")


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return " ".join(_text(v) for v in value)
    return f"{value:.9g}" if isinstance(value, float) else str(value)
