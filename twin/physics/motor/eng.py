"""RASP `.eng` files: comment lines, a header line, lines of time and thrust; several to a file.

Format: thrustcurve.org, "RASP file format"; the curve starts at (0, 0) without saying so and ends
at zero thrust.
"""

import math
from pathlib import Path

from twin.physics.motor.curve import Motor, MotorError

LARGEST_FILE = 4_000_000  # bytes; thrustcurve.org's whole collection is smaller
MOST_POINTS = 20_000  # per motor
MOST_NAMES = 8  # listed in a message
HEADER = "name diameter[mm] length[mm] delays propellant[kg] loaded[kg] maker"


def load(path: Path | str, name: str | None = None) -> Motor:
    """Motor of a file: the only one in it, or the one called `name`.

    Raises
    ------
    MotorError : unreadable, malformed, no motor of that name or several, or several and no name
    """
    motors = read(Path(path))
    names = ", ".join(motor.name for motor in motors[:MOST_NAMES])
    names += ", …" if len(motors) > MOST_NAMES else ""
    matching = [motor for motor in motors if name is None or motor.name == name]
    if not matching:
        raise MotorError(f"{path}: no motor {name!r}; the file holds {names}")
    if len(matching) > 1:
        called = "" if name is None else f" called {name!r}"
        raise MotorError(
            f"{path} holds {len(matching)} motors{called}: {names}; give a file with one of them"
        )
    return matching[0]


def read(path: Path) -> list[Motor]:
    """All motors of a file, in order.

    Raises
    ------
    MotorError : unreadable or malformed, with the line
    """
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise MotorError(f"{path} is larger than {LARGEST_FILE} bytes; no .eng file is")
        text = path.read_bytes().decode("utf-8", errors="replace")
    except OSError as error:
        raise MotorError(f"cannot read motor {path}: {error.strerror}") from error
    return parse(text, str(path))


def parse(text: str, source: str = "motor") -> list[Motor]:
    """All motors of an `.eng` text; `source` names it in errors.

    Raises
    ------
    MotorError : malformed, with the line
    """
    motors: list[Motor] = []
    header: list[str] | None = None
    points: list[tuple[float, float]] = []
    for number, raw in enumerate(text.splitlines(), 1):
        words = raw.partition(";")[0].split()
        if not words:
            continue
        where = f"{source}, line {number}"
        if header is None:
            header, points = _header(words, where), []
            continue
        points.append(_point(words, where))
        if len(points) > MOST_POINTS:
            raise MotorError(f"{where}: more than {MOST_POINTS} points in one curve")
        if points[-1][1] == 0 and points[-1][0] > 0 and _burning(points):
            motors.append(_motor(header, points, source))
            header = None
    if header is not None:
        last = f"{points[-1][1]:g} N at {points[-1][0]:g} s" if points else "the header"
        raise MotorError(
            f"{source}: the thrust curve of {header[0]!r} never ends: its last point is {last};"
            " it must end with a thrust of 0"
        )
    if not motors:
        raise MotorError(f"{source}: holds no motor; a header line reads {HEADER}")
    return motors


def _burning(points: list[tuple[float, float]]) -> bool:
    return any(thrust > 0 for _, thrust in points)


def _header(words: list[str], where: str) -> list[str]:
    if len(words) < 7:
        raise MotorError(
            f"{where}: a header line has 7 words, {HEADER}; here are {len(words)}: {_quote(words)}"
        )
    for word in (words[1], words[2], words[4], words[5]):
        _number(word, where)
    return words


def _point(words: list[str], where: str) -> tuple[float, float]:
    if len(words) != 2:
        raise MotorError(
            f"{where}: expected time [s] and thrust [N], found {len(words)} words: {_quote(words)}"
        )
    return _number(words[0], where), _number(words[1], where)


def _number(word: str, where: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise MotorError(f"{where}: {_quote([word])} is not a number") from None
    if not math.isfinite(value):
        raise MotorError(f"{where}: {word} is not finite")
    return value


def _quote(words: list[str]) -> str:
    text = " ".join(words)
    return repr(text if len(text) <= 60 else text[:57] + "...")


def _motor(header: list[str], points: list[tuple[float, float]], source: str) -> Motor:
    if points[0][0] != 0:
        points = [(0.0, 0.0), *points]
    try:
        return Motor(
            name=header[0],
            time=[t for t, _ in points],  # type: ignore[arg-type]
            thrust=[f for _, f in points],  # type: ignore[arg-type]
            propellant_mass=float(header[4]),
            loaded_mass=float(header[5]),
            diameter=float(header[1]) * 1e-3,
            length=float(header[2]) * 1e-3,
        )
    except MotorError as error:
        raise MotorError(f"{source}: {error}") from None
