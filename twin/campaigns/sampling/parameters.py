"""What a name of `[vary]` is, and how its value becomes a setting of one flight."""

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import mujoco

from analysis.transfer_function import Servo, TransferFunctionModel, with_figures
from twin.campaigns.sampling.files import beside
from twin.campaigns.sampling.vary import Varied
from twin.config import Fly
from twin.config.base import unknown
from twin.errors import TwinError
from twin.experiments.assembly import make_plant
from twin.plant.model import overrides

_ITEM = re.compile(r"(\w+)(?:\[(\d+)\])?")
MODEL = "model."
THRUST = "motor.thrust_scale"
# of a gimbal given by its response: name, default, what it is
RESPONSE: Mapping[str, tuple[float, str]] = {
    "model.bandwidth_hz": (9.6, "frequency at which the gain is down by 3 dB"),
    "model.damping": (0.6, "damping ratio"),
    "model.delay_s": (0.0166, "transport delay"),
    "model.gain": (1.0, "gimbal angle per commanded angle"),
    "model.slew_deg_s": (0.0, "fastest change of the gimbal angle; 0: unlimited"),
    "model.dead_band_deg": (0.0, "half width of the dead band"),
    "model.backlash_deg": (0.0, "play, stop to stop"),
}
"""Response of `--gimbal transfer-function` by parameters; the defaults are near the reference."""


@dataclass(frozen=True)
class Binding:
    """Turns the values of one run into the settings of its flight.

    Attributes
    ----------
    fly : settings that all runs share
    nominal : of each parameter that is varied relatively, its parts and their nominal values
    seed : of the first sample
    folder : of the study, where a varied file is looked for first
    model : identified model whose figures vary
    """

    fly: Mapping[str, Any]
    nominal: Mapping[str, tuple[tuple[str, float], ...]]
    seed: int
    folder: Path = Path()
    model: TransferFunctionModel | None = None

    def config(self, values: Mapping[str, Any], sample: int, scratch: Path) -> Fly:
        """Settings of one flight.

        Parameters
        ----------
        values : of the run, by column
        sample : number of the sample; the flight's seed follows from it
        scratch : folder for the file of an identified model

        Raises
        ------
        TwinError : the values cannot be flown
        """
        settings = {k: list(v) if isinstance(v, list) else v for k, v in self.fly.items()}
        settings["seed"] = self.seed + sample
        parameters: dict[str, float] = dict(Fly.of({"set": settings.pop("set", ())}).set)
        response: dict[str, float] = {}
        for name, value in _flat(values):
            if name.startswith(MODEL):
                response[name] = float(value)
            elif name in self.nominal:
                parameters |= {part: base * value for part, base in self.nominal[name]}
            elif _of_fly(name):
                _put(settings, name, beside(name, value, self.folder))
            else:
                parameters[name] = value
        if response:
            file = scratch / f"model-{os.getpid()}.json"  # processes fly at the same time
            self._model(response).write(file)
            settings["model"] = file
        return Fly.of({**settings, "set": parameters})

    def _model(self, given: Mapping[str, float]) -> TransferFunctionModel:
        if self.model is None:
            return response_model(given)
        return with_figures(self.model, {n.removeprefix(MODEL): v for n, v in given.items()})


def binding(fly: Mapping[str, Any], vary: tuple[Varied, ...], folder: Path = Path()) -> Binding:
    """Check every name of a study against the model that it flies.

    Parameters
    ----------
    folder : of the study, where a varied file is looked for first

    Raises
    ------
    TwinError : a name that is none, with the nearest ones
    """
    seed = int(fly.get("seed", 0))
    plain = Binding(fly, {}, seed)
    config = plain.config({}, 0, Path())
    names = _names(vary)
    _check_given(fly, config, vary)
    identified = [v for v in vary if v.model is not None]
    _check_names(config, names, identified[0].columns if identified else ())
    model = make_plant(config, config.motor).model
    relative = {c for v in vary if v.relative for c in v.columns} | ({THRUST} & set(names))
    nominal = {name: _nominal(model, name) for name in relative}
    for name in names:
        if not (name.startswith(MODEL) or _of_fly(name) or name in nominal):
            overrides.value(model, name)
    return Binding(fly, nominal, seed, folder, identified[0].model if identified else None)


def _check_given(fly: Mapping[str, Any], config: Fly, vary: tuple[Varied, ...]) -> None:
    """Refuse what `[fly]` gives a value and `[vary]` replaces; a relative value multiplies it."""
    given = {*fly, *(name for name, _ in config.set)}
    for name in _names(tuple(v for v in vary if not v.relative)):
        if name in given:
            raise TwinError(f"[vary.{name}]: [fly] gives it a value already; leave one of them out")


def _check_names(config: Fly, names: list[str], figures: Sequence[str]) -> None:
    """Refuse names that are no parameters; `figures` are those of an identified model."""
    for name in names:
        if name.startswith(MODEL):
            if figures and name not in figures:
                raise TwinError(
                    f"[vary.{name}]: [vary.model] varies the whole model; leave one of them out"
                )
            if name not in (figures or RESPONSE):
                raise TwinError(f"[vary] {unknown(name, tuple(RESPONSE), 'parameter')}")
            if config.gimbal != "transfer-function" or config.model is not None:
                where = "vary.model" if figures else f"vary.{name}"
                raise TwinError(
                    f"[{where}]: needs [fly] gimbal = 'transfer-function' without a model file"
                )


def _names(vary: tuple[Varied, ...]) -> list[str]:
    """All settings and parameters that a study varies, those of sets in place of the set."""
    names = []
    for v in vary:
        sets = [value for value in v.values if isinstance(value, Mapping)]
        if sets and len(sets) < len(v.values):
            raise TwinError(f"[vary.{v.name}]: must be all tables of parameters, or none")
        names += [n for s in sets for n, _ in _flat({"": s})] if sets else list(v.columns)
    return list(dict.fromkeys(names))


def _flat(values: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Names and values, those of a chosen set in place of the set."""
    flat: list[tuple[str, Any]] = []
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat += [(n, v) for n, v in value.items() if n not in ("name", "source")]
        else:
            flat.append((name, value))
    return flat


def _of_fly(name: str) -> bool:
    match = _ITEM.fullmatch(name)
    return match is not None and match[1] in {f.name for f in fields(Fly)}


def _put(settings: dict[str, Any], name: str, value: object) -> None:
    """Set a setting, or one number of several."""
    match = _ITEM.fullmatch(name)
    assert match is not None
    setting, at = match[1], match[2]
    if at is None:
        settings[setting] = value
        return
    now = settings.get(setting, getattr(Fly, setting, None))
    if not isinstance(now, list | tuple) or int(at) >= len(now):
        raise TwinError(
            f"[vary] {name}: [fly] {setting} has no such number; give all of them there"
        )
    settings[setting] = [value if k == int(at) else v for k, v in enumerate(now)]


def _nominal(model: mujoco.MjModel, name: str) -> tuple[tuple[str, float], ...]:
    """Parts of a parameter and their values; all of a numeric of several numbers."""
    if name == THRUST:
        return _nominal(model, "motor_thrust") + _nominal(model, "motor_impulse")
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    count = int(model.numeric_size[index]) if index >= 0 else 1
    parts = [name] if count == 1 else [f"{name}[{k}]" for k in range(count)]
    return tuple((part, overrides.value(model, part)) for part in parts)


def response_model(given: Mapping[str, float]) -> TransferFunctionModel:
    """Two equal axes of second order with the response of `RESPONSE`.

    The natural frequency follows from the bandwidth of a second-order low-pass: ω_B = ωn √(1 − 2ζ²
    + √((1 − 2ζ²)² + 1)) (K. Ogata, Modern Control Engineering, 5th ed., 2010, §7-8). The slew rate
    bounds the speed of the servo itself where the damping allows a loop of this form.

    Raises
    ------
    TwinError : impossible values
    """
    v = {name: given.get(name, default) for name, (default, _) in RESPONSE.items()}
    band, damping = v["model.bandwidth_hz"], v["model.damping"]
    if not (band > 0.0 and damping > 0.0 and v["model.delay_s"] >= 0.0):
        raise TwinError(
            f"model.bandwidth_hz {band:g}, model.damping {damping:g}: must be positive, and"
            f" model.delay_s {v['model.delay_s']:g} not negative"
        )
    a = 1.0 - 2.0 * damping**2
    wn = 2.0 * math.pi * band / math.sqrt(a + math.sqrt(a * a + 1.0))
    plain = TransferFunctionModel.second_order(wn, damping, v["model.delay_s"])
    (x, none), _ = plain.channels
    axis = type(x)((v["model.gain"] * wn * wn,), x.den, x.delay)
    slew, dead_band, backlash = (math.radians(v[f"model.{n}"]) for n in _BOUNDS)
    servo = Servo(slew, dead_band, backlash, "speed") if slew or dead_band or backlash else None
    return TransferFunctionModel(((axis, none), (none, axis)), servo=servo)


_BOUNDS = ("slew_deg_s", "dead_band_deg", "backlash_deg")
