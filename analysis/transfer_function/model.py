"""An identified gimbal: a matrix of delayed transfer functions and the bounds of its servos."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from analysis.array import Array
from analysis.files import write_text
from analysis.transfer_function import file
from analysis.transfer_function.channel import Channel
from analysis.transfer_function.covariance import Covariance
from analysis.transfer_function.discrete import Discrete, discretise_channel, whole_steps
from analysis.transfer_function.file import SCHEMA, ModelFileError
from analysis.transfer_function.servo import Servo, play, speed_loop

_SERVO_KEYS = {
    "rate_limit_rad_s": "rate_limit",
    "dead_band_rad": "dead_band",
    "backlash_rad": "backlash",
    "rate_limit_back_rad_s": "rate_limit_back",
    "slew_rad_s": "slew",
}
_SET_POINT_ONLY = ("rate_limit_back", "slew")


@dataclass(frozen=True, slots=True)
class TransferFunctionModel:
    """The content of one model file.

    Attributes
    ----------
    channels : rows are outputs, columns inputs; radians per radian
    inputs, outputs : names of the axes
    servo : bounds of the servo of each output, one that serves all, or None for a linear model
    std, fit, source : notes of whoever identified it, any JSON; kept, not used
    covariance : of its figures; None where they are not known to vary
    """

    channels: tuple[tuple[Channel, ...], ...]
    inputs: tuple[str, ...] = ("x", "y")
    outputs: tuple[str, ...] = ("x", "y")
    servo: Servo | tuple[Servo, ...] | None = None
    std: object = field(default=None, compare=False)
    fit: object = field(default=None, compare=False)
    source: object = field(default=None, compare=False)
    covariance: Covariance | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        rows = len(self.channels)
        if rows != len(self.outputs):
            raise ModelFileError(f"channels has {rows} rows for {len(self.outputs)} outputs")
        if self.servos and len(self.servos) != rows:
            raise ModelFileError(f"servo has {len(self.servos)} entries for {rows} outputs")
        for servo, row in zip(self.servos, self.channels, strict=False):
            for c in (c for c in row if servo.structure != "command" and not c.zero):
                if not speed_loop(c.num, c.den)[2] and servo.structure != "speed":
                    raise ModelFileError(f"a servo of structure '{servo.structure}' has two poles")
        for i, row in enumerate(self.channels):
            if len(row) != len(self.inputs):
                raise ModelFileError(
                    f"channels[{i}] has {len(row)} columns for {len(self.inputs)} inputs"
                )
        for where, names in (("inputs", self.inputs), ("outputs", self.outputs)):
            if len(set(names)) != len(names):
                raise ModelFileError(f"{where} {list(names)} repeats a name")

    @classmethod
    def second_order(cls, natural_frequency: float, damping: float, delay: float = 0.0) -> Self:
        """Two equal, uncoupled axes of ωn²/(s² + 2ζωn s + ωn²) [rad/s, 1, s]."""
        w = natural_frequency
        axis = Channel((w * w,), (1.0, 2.0 * damping * w, w * w), delay)
        none = Channel((0.0,), (1.0,))
        return cls(((axis, none), (none, axis)))

    @classmethod
    def read(cls, path: Path | str) -> Self:
        """Read a model file.

        Raises
        ------
        ModelFileError : the file is missing, too large, or not a model; the message names the key
        """
        path = Path(path)
        content = file.load(path)
        try:
            return cls.from_dict(content)
        except ModelFileError as error:
            raise ModelFileError(f"{path}: {error}") from error

    def write(self, path: Path | str) -> None:
        """Write a model file; `AnalysisError` if the folder cannot be written."""
        text = json.dumps(self.to_dict(), indent=2, allow_nan=False, ensure_ascii=False)
        write_text(Path(path), f"{text}\n")

    @classmethod
    def from_dict(cls, value: object) -> Self:
        """Model from the content of a file.

        Raises
        ------
        ModelFileError : A key is missing, unknown, or holds what cannot be; the message names it
        """
        content = file.mapping(value, "the model")
        needed = {"schema", "inputs", "outputs", "channels"}
        if "schema" in content and content["schema"] != SCHEMA:
            raise ModelFileError(f"schema is {content['schema']!r}, not {SCHEMA!r}")
        file.keys(content, "the model", needed, {"servo", "std", "fit", "source", "covariance"})
        rows = file.sequence(content["channels"], "channels", file.LARGEST_SIZE)
        covariance = content.get("covariance")
        _check_deviations(content.get("std"), "std")
        found = cls(
            channels=tuple(_row(row, f"channels[{i}]") for i, row in enumerate(rows)),
            inputs=_names(content["inputs"], "inputs"),
            outputs=_names(content["outputs"], "outputs"),
            servo=_servos(content.get("servo")),
            std=file.free(content.get("std"), "std"),
            fit=file.free(content.get("fit"), "fit"),
            source=file.free(content.get("source"), "source"),
            covariance=None if covariance is None else Covariance.from_dict(covariance),
        )
        for output, row in zip(found.outputs, found.channels, strict=True):
            if all(c.num[-1] == 0.0 for c in row):
                raise ModelFileError(
                    f"output {output!r} has gain 0 from every input; a gimbal follows its command"
                )
        return found

    def to_dict(self) -> dict[str, object]:
        """Content of the file, ready for JSON."""
        blocks = [_block(s) for s in self.servos]
        servo = None if not blocks else blocks[0] if isinstance(self.servo, Servo) else blocks
        known = {} if self.covariance is None else {"covariance": self.covariance.to_dict()}
        return {
            "schema": SCHEMA,
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "channels": [
                [{"num": list(c.num), "den": list(c.den), "delay_s": c.delay} for c in row]
                for row in self.channels
            ],
            "servo": servo,
            "std": self.std,
            "fit": self.fit,
            "source": self.source,
            **known,
        }

    def channel(self, output: int | str, input_: int | str) -> Channel:
        """One transfer function by index or name.

        Raises
        ------
        ModelFileError : no such axis
        """
        return self.channels[_index(self.outputs, output)][_index(self.inputs, input_)]

    @property
    def servos(self) -> tuple[Servo, ...]:
        """The servo of each output; none of a linear model."""
        if isinstance(self.servo, Servo):
            return (self.servo,) * len(self.outputs)
        return self.servo or ()

    @property
    def stable(self) -> bool:
        """Whether every channel that passes anything is stable."""
        return all(c.stable for row in self.channels for c in row if not c.zero)

    def discretise(self, dt: float) -> Discrete:
        """Exact zero-order-hold equivalent for a command held over steps of `dt` [s].

        Raises
        ------
        ModelFileError : `dt` is not positive
        """
        if not (np.isfinite(dt) and dt > 0.0):
            raise ModelFileError(f"dt is {dt:g} s; it must be positive")
        return Discrete(
            dt,
            tuple(
                tuple(discretise_channel(c.num, c.den, c.delay, dt) for c in row)
                for row in self.channels
            ),
        )

    def simulate(self, commands: ArrayLike, dt: float) -> Array:
        """Return outputs (n, outputs) [rad] for commands (n, inputs) [rad] held for `dt` [s] each.

        Row k is the output at the instant command k is set; all was at rest before. The servo block
        is taken into account, as the actuator in flight does.
        """
        exact = self.discretise(dt)
        if not self.servos:
            return exact.simulate(commands)
        u = np.asarray(commands, dtype=np.float64)
        y = np.zeros((len(u), len(self.outputs)))
        for i, (row, servo) in enumerate(zip(self.channels, self.servos, strict=True)):
            if servo.structure == "command":
                y[:, i] = Discrete(dt, (exact.channels[i],)).simulate(u, servo)[:, 0]
                continue
            for j, c in enumerate(row):
                if not c.zero:
                    y[:, i] += self._bounded(c, u[:, j], dt, servo)
            y[:, [i]] = play(y[:, [i]], servo.backlash)
        return y

    @staticmethod
    def _bounded(channel: Channel, u: Array, dt: float, servo: Servo) -> Array:
        from analysis.transfer_function.speed import clip_move, move, track

        gain, k, w = speed_loop(channel.num, channel.den)
        shift, first = whole_steps(channel.delay, dt)
        late = np.concatenate([np.zeros(shift + 1), u])
        up, down, slew = servo.limits
        out, y, v, r = np.empty(len(u)), 0.0, 0.0, 0.0
        if servo.structure == "set-point":
            tail = (k, w, up, down, slew, servo.dead_band)
            for n in range(len(u)):
                out[n] = gain * y
                if first > 0.0:
                    y, v, r = track(y, v, r, late[n], first, *tail)
                y, v, r = track(y, v, r, late[n + 1], dt - first, *tail)
            return out
        moved = clip_move if servo.structure == "clipped" else move
        for n in range(len(u)):
            out[n] = gain * y
            if first > 0.0:
                y, v = moved(y, v, late[n], first, k, w, up, servo.dead_band)
            y, v = moved(y, v, late[n + 1], dt - first, k, w, up, servo.dead_band)
        return out


def _index(names: tuple[str, ...], key: int | str) -> int:
    if isinstance(key, str):
        if key not in names:
            raise ModelFileError(f"no axis {key!r}; there are {', '.join(names)}")
        return names.index(key)
    if not 0 <= key < len(names):
        raise ModelFileError(f"no axis {key}; there are {len(names)}")
    return key


def _names(value: object, where: str) -> tuple[str, ...]:
    names = file.sequence(value, where, file.LARGEST_SIZE)
    for i, name in enumerate(names):
        if not isinstance(name, str) or not 1 <= len(name) <= 64:
            raise ModelFileError(f"{where}[{i}] must be a name of 1 to 64 characters")
    return tuple(names)


def _row(value: object, where: str) -> tuple[Channel, ...]:
    row = file.sequence(value, where, file.LARGEST_SIZE)
    return tuple(_channel(c, f"{where}[{j}]") for j, c in enumerate(row))


def _channel(value: object, where: str) -> Channel:
    content = file.mapping(value, where)
    file.keys(content, where, {"num", "den"}, {"delay_s"})
    longest = file.LARGEST_ORDER + 1
    coefficients = {
        key: tuple(
            file.number(c, f"{where}.{key}[{k}]")
            for k, c in enumerate(file.sequence(content[key], f"{where}.{key}", longest))
        )
        for key in ("num", "den")
    }
    delay = file.number(content.get("delay_s", 0.0), f"{where}.delay_s")
    try:
        return Channel(coefficients["num"], coefficients["den"], delay)
    except ModelFileError as error:
        raise ModelFileError(f"{where}: {error}") from error


def _check_deviations(value: object, where: str) -> None:
    """Refuse standard deviations below zero, wherever they stand in the notes of the author."""
    if isinstance(value, Mapping):
        for key, v in value.items():
            _check_deviations(v, f"{where}.{key}")
    elif isinstance(value, list | tuple):
        for k, v in enumerate(value):
            _check_deviations(v, f"{where}[{k}]")
    elif isinstance(value, int | float) and value < 0.0:
        raise ModelFileError(f"{where} is {value:g}; a standard deviation must be ≥ 0")


def _servos(value: object) -> Servo | tuple[Servo, ...] | None:
    if not isinstance(value, list):
        return None if value is None else _servo(value, "servo")
    blocks = file.sequence(value, "servo", file.LARGEST_SIZE)
    return tuple(_servo(block, f"servo[{i}]") for i, block in enumerate(blocks))


def _servo(value: object, where: str) -> Servo:
    content = file.mapping(value, where)
    file.keys(content, where, set(), {*_SERVO_KEYS, "structure"})
    figures = {
        name: file.number(content[key], f"{where}.{key}")
        for key, name in _SERVO_KEYS.items()
        if content.get(key) is not None
    }
    try:
        return Servo(structure=content.get("structure", "command"), **figures)
    except ModelFileError as error:
        raise ModelFileError(f"{where}: {error}") from error


def _block(servo: Servo) -> dict[str, object]:
    whole = servo.structure == "set-point"
    numbers = {
        key: getattr(servo, name)
        for key, name in _SERVO_KEYS.items()
        if whole or name not in _SET_POINT_ONLY
    }
    return {**numbers, "structure": servo.structure}
