"""RockSim `.rse` files: XML, `<engine>` elements with attributes and a list of `<eng-data>`.

Format: rocksim.com, engine files; lengths in millimetres, masses in grams. Its own columns of mass
and centre of gravity are not used: propellant leaves with the impulse delivered.
"""

import math
import xml.etree.ElementTree as ET
from typing import Final

from twin.physics import safe_xml
from twin.physics.motor.curve import Motor
from twin.physics.motor.eng import MOST_MOTORS, MOST_POINTS, curve
from twin.physics.motor.entry import Entry
from twin.physics.motor.figures import MotorError

ATTRIBUTES: Final = ("dia", "len", "propWt", "initWt")
POINT: Final = "eng-data"


def entries(content: bytes, source: str, largest: int) -> list[Entry]:
    """All motors of an `.rse` file in order; one that is malformed spoils no other.

    Raises
    ------
    MotorError : not well-formed, with a document type or entities, too large, or without a motor
    """
    try:
        root = safe_xml.parsed(content, largest)
    except safe_xml.XmlError as error:
        raise MotorError(f"{source} cannot be read as a RockSim file: {error}") from None
    engines = list(root.iter("engine"))
    if not engines:
        raise MotorError(
            f"{source}: holds no motor; a RockSim file has elements <engine>, this one"
            f" <{_tag(root)}>"
        )
    if len(engines) > MOST_MOTORS:
        raise MotorError(f"{source}: more than {MOST_MOTORS} motors in one file")
    return [_entry(engine, source) for engine in engines]


def _tag(element: ET.Element) -> str:
    return element.tag[:40]


def _entry(engine: ET.Element, source: str) -> Entry:
    name, maker = engine.get("code", "unnamed").strip()[:60], engine.get("mfg", "").strip()[:60]
    try:
        return Entry(name, maker, _motor(engine, name))
    except MotorError as error:
        return Entry(name, maker, fault=f"{source}: {error}")


def _motor(engine: ET.Element, name: str) -> Motor:
    diameter, length, propellant, loaded = (_number(engine, a, name) for a in ATTRIBUTES)
    data = list(engine.iter(POINT))
    if not 0 < len(data) <= MOST_POINTS:
        raise MotorError(
            f"motor {name!r}: has {len(data)} <{POINT}> elements; must be 3 to {MOST_POINTS}"
        )
    time, thrust = curve([(_number(p, "t", name), _number(p, "f", name)) for p in data])
    return Motor(
        name=name,
        time=time,  # type: ignore[arg-type]
        thrust=thrust,  # type: ignore[arg-type]
        propellant_mass=propellant * 1e-3,
        loaded_mass=loaded * 1e-3,
        diameter=diameter * 1e-3,
        length=length * 1e-3,
    )


def _number(element: ET.Element, attribute: str, name: str) -> float:
    text = element.get(attribute)
    if text is None:
        raise MotorError(f"motor {name!r}: <{_tag(element)}> has no attribute {attribute!r}")
    try:
        value = float(text if "." in text else text.replace(",", ".", 1))
    except ValueError:
        shown = text if len(text) <= 40 else text[:37] + "..."
        raise MotorError(f"motor {name!r}: {attribute}={shown!r} is not a number") from None
    if not math.isfinite(value):
        raise MotorError(f"motor {name!r}: {attribute}={text[:40]} is not finite")
    return value
