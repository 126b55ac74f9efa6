"""The identified gimbal: channels, uncertainty, evidence, and what to beware of."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.identify.diagnostics import Residuals, Saturation
from analysis.identify.errors import IdentificationError
from analysis.identify.servo_response import Structure
from analysis.recording.record import Record
from analysis.transfer_function import Channel, Servo, TransferFunctionModel

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Estimate:
    """One estimated number.

    Attributes
    ----------
    name, unit : e.g. `x/x natural frequency`, `rad/s`; channels are named output/input
    value : as estimated
    std : standard deviation, from the Jacobian or, where that is larger by half, the bootstrap
    interval : of 95 % confidence
    """

    name: str
    value: float
    std: float
    unit: str

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of 95 % confidence."""
        return self.value - 1.96 * self.std, self.value + 1.96 * self.std

    def to_dict(self) -> dict[str, object]:
        """Plain numbers for JSON."""
        low, high = self.interval
        return {
            "name": self.name, "value": self.value, "std": self.std, "unit": self.unit,
            "low": low, "high": high,
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class AxisEvidence:
    """What the readings of one axis say about its model.

    Attributes
    ----------
    name : of the axis
    samples : readings used
    spikes : readings set aside as spikes
    noise : of angle [rad] and rate [rad/s] readings as estimated, NaN where not measured
    fit_angle, fit_rate : NRMSE fit of each record [%], NaN where not measured; around each
        record's own offset, spikes left out
    residual_angle, residual_rate : tests of the residual
    saturation : does the speed grow with the amplitude
    converged : the search ended at a minimum
    spread : bootstrap over Jacobian standard deviation, median over the parameters, NaN if unknown
    """

    name: str
    samples: int
    spikes: int
    noise: tuple[float, float]
    fit_angle: tuple[float, ...]
    fit_rate: tuple[float, ...]
    residual_angle: Residuals | None
    residual_rate: Residuals | None
    saturation: Saturation
    converged: bool
    spread: float

    @property
    def fit(self) -> tuple[float, ...]:
        """NRMSE fit of each record [%], of the angle where any was measured, else of the rate."""
        return self.fit_angle if np.isfinite(self.fit_angle).any() else self.fit_rate

    def to_dict(self) -> dict[str, object]:
        """Plain numbers for JSON; NaN becomes None."""
        return {f.name: _plain(getattr(self, f.name)) for f in fields(self)}


@dataclass(frozen=True, slots=True)
class ServoBounds:
    """Bounds of the servo of one axis.

    Attributes
    ----------
    structure : `speed`: the servo's own loop saturates; `command`: ramps ahead of the linear part
    rate_limit : of the output [rad/s]
    dead_band : half width, on the command [rad]
    backlash : total width at the output [rad]
    """

    structure: Structure
    rate_limit: Estimate
    dead_band: Estimate
    backlash: Estimate


@dataclass(frozen=True, slots=True)
class ChannelFit:
    """One transfer function with the covariance of its parameters.

    Attributes
    ----------
    num, den : descending powers of s; radians per radian
    delay : [s]; below zero if the command was given before the sample that first shows it
    estimates : gain, poles, zeros and delay in the field's own figures
    parameters : what `covariance` is of: ln c of the denominator, delay [s], numerator coefficients
    """

    num: tuple[float, ...]
    den: tuple[float, ...]
    delay: float
    estimates: tuple[Estimate, ...]
    parameters: Array = field(repr=False)
    covariance: Array = field(repr=False)

    def frequency_response(self, omega: Array) -> NDArray[np.complex128]:
        """Complex gain at angular frequencies (n,) [rad/s], delay included."""
        s = 1j * np.asarray(omega, dtype=np.float64)
        ratio = np.polyval(self.num, s) / np.polyval(self.den, s)
        return np.asarray(ratio * np.exp(-s * self.delay))


@dataclass(frozen=True, slots=True)
class IdentifiedModel:
    """A gimbal as identified: a matrix of delayed transfer functions and how far to trust it.

    Attributes
    ----------
    inputs, outputs : names of commands and axes
    channels : rows are outputs, columns inputs
    servo : bounds of each axis' servo, or None for a linear model
    axes : evidence, one per output
    warnings : everything a reader must know before quoting a figure
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    channels: tuple[tuple[ChannelFit, ...], ...]
    servo: tuple[ServoBounds, ...] | None
    axes: tuple[AxisEvidence, ...]
    warnings: tuple[str, ...] = ()

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every estimated number with its uncertainty."""
        found = [e for row in self.channels for c in row for e in c.estimates]
        for bounds in self.servo or ():
            found += [bounds.rate_limit, bounds.dead_band, bounds.backlash]
        return tuple(found)

    @property
    def fit(self) -> float:
        """NRMSE fit [%]: median over axes and records, of angles where there are any."""
        values = [f for a in self.axes for f in a.fit_angle if np.isfinite(f)]
        values = values or [f for a in self.axes for f in a.fit_rate if np.isfinite(f)]
        return float(np.median(values)) if values else float("nan")

    def estimate(self, name: str) -> Estimate:
        """One estimated number by name.

        Raises
        ------
        IdentificationError
            if there is none of that name; the message lists the valid names.
        """
        for e in self.estimates:
            if e.name == name:
                return e
        names = ", ".join(e.name for e in self.estimates)
        raise IdentificationError(f"no estimate '{name}'; there are: {names}")

    def frequency_response(self, omega: Array) -> NDArray[np.complex128]:
        """Complex gains (n, outputs, inputs) of the linear part at frequencies (n,) [rad/s]."""
        rows = [[c.frequency_response(omega) for c in row] for row in self.channels]
        return np.moveaxis(np.asarray(rows), 2, 0)

    def predict(self, record: Record) -> tuple[Array, Array]:
        """Angle and rate (n, outputs) of the model under a record's commands, from rest."""
        from analysis.identify.prediction import predict

        return predict(self, record)

    def fit_to(self, records: Sequence[Record]) -> Array:
        """NRMSE fit [%] of the prediction (records, outputs); NaN where nothing was measured.

        Around each record's own offset, which is the sensor's and not the model's; angle where it
        was measured, otherwise rate.
        """
        from analysis.identify.prediction import fit_percent

        return np.array([fit_percent(self, r) for r in records])

    def to_transfer_function(self) -> TransferFunctionModel:
        """The model file's content: what a flight with `--model` flies.

        A delay below zero becomes zero: the command was only sampled. One file has one servo block,
        so that of several axes holds their means, and the structure most of them have (`speed`, the
        common one, at a tie).
        """
        channels = tuple(
            tuple(Channel(c.num, c.den, max(c.delay, 0.0)) for c in row) for row in self.channels
        )
        servo = None
        if self.servo is not None:
            servo = Servo(
                float(np.mean([b.rate_limit.value for b in self.servo])),
                float(np.mean([b.dead_band.value for b in self.servo])),
                float(np.mean([b.backlash.value for b in self.servo])),
                _structure(self.servo),
            )
        return TransferFunctionModel(
            channels,
            self.inputs,
            self.outputs,
            servo,
            std={e.name: e.std for e in self.estimates if np.isfinite(e.std)},
            fit={a.name: _plain(a.fit) for a in self.axes},
            source={
                "warnings": list(self.warnings),
                "servo_structure": [b.structure for b in self.servo] if self.servo else None,
            },
        )

    def to_dict(self) -> dict[str, object]:
        """Plain numbers for JSON; NaN becomes None."""
        return {
            "model": self.to_transfer_function().to_dict(),
            "estimates": [_plain(e.to_dict()) for e in self.estimates],
            "axes": [a.to_dict() for a in self.axes],
            "fit": _plain(self.fit),
            "warnings": list(self.warnings),
        }


def _structure(bounds: Sequence[ServoBounds]) -> Structure:
    speed = sum(b.structure == "speed" for b in bounds)
    return "speed" if 2 * speed >= len(bounds) else "command"


def _plain(value: object) -> object:
    """Dataclasses, tuples and NumPy numbers as what JSON holds."""
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.bool_ | np.integer):
        return value.item()
    return value
