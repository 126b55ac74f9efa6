"""A study file: what is flown, what varies, how it is sampled, what is measured, when it ends."""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from analysis import toml
from analysis.files import FileError, content
from twin.campaigns.sampling.design import KINDS
from twin.campaigns.sampling.files import beside, contents
from twin.campaigns.sampling.vary import JOINT, Varied, number, shown, varied
from twin.campaigns.statistics.statistic import (
    Condition,
    Measure,
    Statistic,
    condition,
    measure,
    statistic,
)
from twin.config import Fly
from twin.errors import TwinError

SHIPPED = Path(__file__).parents[1] / "studies"
LARGEST = 1_000_000  # bytes
MOST_RUNS = 100_000_000
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
SECTIONS = ("study", "fly", "vary", "design", "measure", "stop", "fail_if")
# settings of `fly` that a campaign decides itself
OWN = ("out", "json", "force", "repeat", "within", "clock")
VERSIONS = ("tvc-twin", "mujoco", "numpy", "numba")


@dataclass(frozen=True)
class Stop:
    """When a campaign has enough runs.

    Attributes
    ----------
    statistic : whose interval is watched
    half_width : of the interval that suffices
    confidence : of the interval
    """

    statistic: Statistic
    half_width: float
    confidence: float


@dataclass(frozen=True)
class Study:
    """The content of a study file, validated.

    Attributes
    ----------
    name : of the file, without its ending
    title : what it asks, one line
    fly : settings of the flight
    vary : what varies
    kind, n, seed : design, samples, seed
    measures : figures that are true or false, from conditions on figures
    stop : sequential stop; None to fly all
    fail_if : conditions that a campaign must not meet
    nominal : values that parameters keep in a map while another one varies
    about : names of a choice that the map is about, by parameter
    digest : of everything that decides a row, with the versions of the physics
    place : of the file as it was given, or the name of a shipped study
    folder, source : of the file, and the file
    text : the file
    """

    name: str
    title: str
    fly: Mapping[str, Any]
    vary: tuple[Varied, ...]
    kind: str
    n: int
    seed: int
    measures: tuple[Measure, ...]
    stop: Stop | None
    fail_if: tuple[Condition, ...]
    nominal: Mapping[str, float]
    about: Mapping[str, list[str]]
    digest: str
    place: str
    folder: Path
    source: Path
    text: str

    @property
    def confidence(self) -> float:
        """Of every interval that is reported."""
        return self.stop.confidence if self.stop else 0.95


def read(place: str) -> Study:
    """Read a study file, or a shipped study by its name.

    Raises
    ------
    TwinError : in one line, what is wrong and where
    """
    file = Path(place)
    if not file.suffix and not file.is_file():
        names = sorted(f.stem for f in SHIPPED.glob("*.toml"))
        if place not in names:
            raise TwinError(
                f"{place or repr(place)}: must be a study file (.toml), the folder of its results,"
                f" or one of {', '.join(names)}"
            )
        file = SHIPPED / f"{place}.toml"
    try:
        text = content(file, LARGEST).decode()
        given = toml.parsed(text)
    except FileError as error:
        raise TwinError(str(error)) from None
    except ValueError as error:
        raise TwinError(f"{file}: not TOML: {' '.join(str(error).split())}") from None
    try:
        return _study(place, file, given, text)
    except TwinError as error:
        raise TwinError(f"{file}: {error}") from None


def _study(place: str, file: Path, given: dict[str, Any], text: str) -> Study:
    for name, section in given.items():
        if name not in SECTIONS:
            raise TwinError(f"[{name}]: unknown section; there are {', '.join(SECTIONS)}")
        if not isinstance(section, dict):
            raise TwinError(f"{name}: must be a section [{name}]")
    part = {name: given.get(name, {}) for name in SECTIONS}
    _keys("study", part["study"], ("title",))
    _keys("design", part["design"], ("kind", "n", "seed"))
    fly = _fly(part["fly"], file.parent)
    vary = tuple(varied(n, table, file.parent) for n, table in part["vary"].items())
    if not vary:
        raise TwinError("[vary]: nothing varies; give at least one [vary.NAME]")
    columns = [c for v in vary for c in v.columns]
    if twice := sorted({c for c in columns if columns.count(c) > 1}):
        raise TwinError(f"[vary]: {twice[0]} varies twice")
    kind, n, seed = _design(part["design"], vary)
    given_nominal = {n: t["nominal"] for n, t in part["vary"].items() if "nominal" in t}
    about = {n: v for n, v in given_nominal.items() if isinstance(v, list)}
    nominal = {n: float(v) for n, v in given_nominal.items() if n not in about}
    for v in vary:
        _check_nominal(v, given_nominal.get(v.name))
    if kind == "star" and not nominal:
        raise TwinError("[design] star: needs a nominal value for each parameter of the star")
    measures = tuple(measure(n, t, columns) for n, t in part["measure"].items())
    return Study(
        name=file.stem, title=str(part["study"].get("title", file.stem))[:200], fly=fly, vary=vary,
        kind=kind, n=n, seed=seed, measures=measures,
        stop=_stop(part["stop"], measures), text=text,
        fail_if=tuple(
            condition(str(t), measures, f"[fail_if] {n}:") for n, t in part["fail_if"].items()
        ),
        nominal=nominal, about=about,
        digest=_digest(part, file.parent), place=place, folder=file.parent,
        source=file,
    )  # fmt: skip


def _keys(section: str, given: Mapping[str, Any], valid: tuple[str, ...]) -> None:
    if unknown := sorted(set(given) - set(valid)):
        raise TwinError(f"[{section}]: unknown key {unknown[0]!r}; there are {', '.join(valid)}")


def _fly(given: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Settings of the flight, files relative to the study's folder."""
    settings = {name: beside(name, value, folder) for name, value in given.items()}
    for name in OWN:
        if name in settings:
            raise TwinError(f"[fly] {name}: a campaign decides it; leave it out")
    if not all(isinstance(k, str) for k in settings):
        raise TwinError("[fly]: must have settings of `twin fly`")
    config = Fly.of(settings)
    if config.real_time or config.controller is not None:
        what = f"gimbal {config.gimbal!r}" if config.real_time else "controller"
        raise TwinError(
            f"[fly] {what}: a campaign flies in simulation time with the attitude loop; use"
            " `twin fly --repeat` for a rig on a port or an own controller"
        )
    return settings


def _design(given: Mapping[str, Any], vary: tuple[Varied, ...]) -> tuple[str, int, int]:
    kind = given.get("kind", "grid" if all(v.kind == "grid" for v in vary) else "random")
    if kind not in KINDS:
        raise TwinError(f"[design] kind {kind!r}: must be one of {', '.join(KINDS)}")
    n, seed = given.get("n", 1 if kind == "grid" else None), given.get("seed", 0)
    if n is None:
        raise TwinError(f"[design]: {kind} needs n, the number of samples, for example n = 100")
    for name, value, low in (("n", n, 1), ("seed", seed, 0)):
        whole = isinstance(value, int) and not isinstance(value, bool)
        if not whole or not low <= value <= MOST_RUNS:
            raise TwinError(f"[design] {name} {value!r}: must be a whole number from {low}")
    random = [v.name for v in vary if v.kind != "grid"]
    if kind == "grid" and random:
        raise TwinError(
            f"[design] grid: {random[0]} is not a grid; take another kind, which flies its samples"
            " in every cell of the grid"
        )
    if kind in ("sensitivity", "star") and len(random) < len(vary):
        raise TwinError(f"[design] {kind}: cannot have a grid; vary it as uniform or choice")
    if kind == "sensitivity" and (joint := [v.name for v in vary if v.kind in JOINT]):
        raise TwinError(
            f"[design] sensitivity: {joint[0]} has a covariance, and Sobol indices are of"
            " independent parameters; give each its own distribution, or take another kind"
        )
    return kind, int(n), int(seed)


def _check_nominal(v: Varied, nominal: object) -> None:
    """Refuse a nominal value that the parameter cannot have."""
    numbers = all(isinstance(value, int | float) for value in v.values)
    if isinstance(nominal, list):
        names = [str(shown(value)) for value in v.values]
        if odd := [n for n in nominal if n not in names]:
            raise TwinError(f"[vary.{v.name}] nominal {odd[0]!r}: is none of its values")
    elif nominal is not None and (v.kind in JOINT or not numbers):
        raise TwinError(
            f"[vary.{v.name}] nominal {nominal!r}: a number is for a parameter that is one number;"
            f" {v.name} is a {v.kind} of {'several' if numbers else 'names'}"
        )


def _stop(given: Mapping[str, Any], measures: tuple[Measure, ...]) -> Stop | None:
    if not given:
        return None
    _keys("stop", given, ("statistic", "half_width", "confidence"))
    if missing := {"statistic", "half_width"} - set(given):
        raise TwinError(f"[stop]: needs {', '.join(sorted(missing))}")
    confidence = number("[stop] confidence", given.get("confidence", 0.95))
    if not 0.5 <= confidence < 1.0:
        raise TwinError(f"[stop] confidence {confidence:g}: must be from 0.5 to below 1")
    watched = statistic(str(given["statistic"]), measures)
    half = number("[stop] half_width", given["half_width"], positive=True)
    return Stop(watched, half, confidence)


def _digest(part: Mapping[str, Any], folder: Path) -> str:
    """Digest of what decides a row: sections, files that they name, versions."""
    total = hashlib.sha256()
    deciding = {k: part[k] for k in ("fly", "vary", "design", "measure")}
    if part["design"].get("kind") != "star":  # elsewhere nominal values only belong to the map
        deciding["vary"] = {
            name: {k: v for k, v in table.items() if k != "nominal"}
            for name, table in part["vary"].items()
        }
    total.update(json.dumps(deciding, sort_keys=True, default=str).encode())
    for data in contents(part["fly"], part["vary"], folder):
        total.update(data)
    total.update(json.dumps(versions(), sort_keys=True).encode())
    return total.hexdigest()


def versions() -> dict[str, str]:
    """Versions that decide the last bit of a row."""
    return {name: version(name) for name in VERSIONS}
