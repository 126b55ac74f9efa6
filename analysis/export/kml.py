"""The path of a flight as KML, for Google Earth and other maps."""

import math
import xml.etree.ElementTree as ET  # only written
from pathlib import Path

import numpy as np

from analysis.array import Array
from analysis.flown import GROUND, flown
from analysis.recording.series import Recording, RecordingError

NAMESPACE = "http://www.opengis.net/kml/2.2"
# WGS 84: semi-major axis [m] and first eccentricity squared.
AXIS, ECCENTRICITY_2 = 6378137.0, 6.69437999014e-3
PERIOD = 0.1  # s, between two points of the path


def write(recording: Recording, path: Path, origin: tuple[float, float, float]) -> None:
    """Write the path with the places of launch, apogee, landing and, of a flight to one, target.

    A flight that ended in its climb has its highest point in place of the apogee, and one that did
    not reach the ground its last point in place of the landing.

    Parameters
    ----------
    recording : of a flight
    path : file
    origin : latitude, longitude [deg] and height above the sea [m] of the world's origin

    Raises
    ------
    RecordingError : nothing flies in the recording
    """
    if "vehicle/position" not in recording.series:
        raise RecordingError("no flight: the recording has no vehicle/position")
    series = recording["vehicle/position"]
    series = series.rows(np.asarray(np.isfinite(series.values).all(axis=1)))
    if not len(series.time):
        raise RecordingError("no flight: vehicle/position has no values")
    _, rows = np.unique(np.floor(series.time / PERIOD), return_index=True)
    places = geographic(series.values, origin)
    ET.register_namespace("", NAMESPACE)
    root = ET.Element(f"{{{NAMESPACE}}}kml")
    document = _add(root, "Document")
    _add(document, "name", path.stem)
    line = _placemark(document, "path", "LineString", places[rows])
    _add(line, "extrude", "1")
    top = int(np.argmax(series.values[:, 2]))
    flight = flown(recording)
    above = series.values[:, 2] - series.values[0, 2]
    passed = 0 < top < len(series.time) - 1
    landed = flight is not None and flight.texts.get("ended") == GROUND
    marks = (
        ("launch", 0),
        ("apogee" if passed else "highest point", top),
        ("landing" if landed else "last point", -1),
    )
    for name, row in marks:
        label = f"{name}, {series.time[row]:.1f} s, {above[row]:.0f} m above the launch point"
        _placemark(document, label, "Point", places[row][None])
    if flight is not None and flight.target is not None:
        place = geographic(series.values[:1] + flight.target, origin)
        label = f"target, {flight.target[2]:.0f} m above the launch point"
        _placemark(document, label, "Point", place)
    ET.indent(root)
    ET.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def geographic(enu: Array, origin: tuple[float, float, float]) -> Array:
    """Longitude, latitude [deg] and height [m] (n, 3) of points east, north, up (n, 3) [m].

    Through earth-centred coordinates of the WGS 84 ellipsoid.
    """
    phi, lam, height = math.radians(origin[0]), math.radians(origin[1]), origin[2]
    up = np.array([math.cos(phi) * math.cos(lam), math.cos(phi) * math.sin(lam), math.sin(phi)])
    east = np.array([-math.sin(lam), math.cos(lam), 0.0])
    normal = _normal(np.array([phi]))[0]
    centre = (normal + height) * up - [0.0, 0.0, ECCENTRICITY_2 * normal * math.sin(phi)]
    x, y, z = (centre + enu @ np.stack([east, np.cross(up, east), up])).T
    across = np.hypot(x, y)
    latitude = np.arctan2(z, across * (1.0 - ECCENTRICITY_2))
    for _ in range(5):  # converges by a factor of the eccentricity squared
        sine = np.sin(latitude)
        latitude = np.arctan2(z + ECCENTRICITY_2 * _normal(latitude) * sine, across)
    sine, cosine = np.sin(latitude), np.cos(latitude)
    above = across * cosine + z * sine - AXIS * np.sqrt(1.0 - ECCENTRICITY_2 * sine**2)
    return np.stack([np.degrees(np.arctan2(y, x)), np.degrees(latitude), above], axis=1)


def _normal(latitude: Array) -> Array:
    """Radius of curvature in the prime vertical [m]."""
    return np.asarray(AXIS / np.sqrt(1.0 - ECCENTRICITY_2 * np.sin(latitude) ** 2))


def _placemark(parent: ET.Element, name: str, kind: str, places: Array) -> ET.Element:
    mark = _add(parent, "Placemark")
    _add(mark, "name", name)
    shape = _add(mark, kind)
    _add(shape, "altitudeMode", "absolute")
    text = " ".join(f"{lon:.8f},{lat:.8f},{up:.2f}" for lon, lat, up in places)
    _add(shape, "coordinates", text)
    return shape


def _add(parent: ET.Element, name: str, text: str | None = None) -> ET.Element:
    child = ET.SubElement(parent, f"{{{NAMESPACE}}}{name}")
    child.text = text
    return child
