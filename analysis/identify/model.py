"""The identified gimbal: channels, uncertainty, evidence, and what to beware of."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from analysis.array import Array
from analysis.identify.errors import IdentificationError
from analysis.identify.evidence.evidence import AxisEvidence, ChannelFit, Estimate, ServoBounds
from analysis.plain import plain
from analysis.transfer_function import Channel, Covariance, Servo, TransferFunctionModel
from analysis.transfer_function.covariance import MOST_FIGURES


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
            found += bounds.estimates
        return tuple(found)

    @property
    def fit(self) -> float:
        """NRMSE fit [%]: median over axes and records, of angles where there are any."""
        values = [f for a in self.axes for f in a.fit_angle if np.isfinite(f)]
        values = values or [f for a in self.axes for f in a.fit_rate if np.isfinite(f)]
        return float(np.median(values)) if values else float("nan")

    def per_command(self, unit: str) -> "IdentifiedModel":
        """The model with its figures in the unit of commands that are no angles."""
        if unit == "rad":
            return self
        rows = tuple(
            tuple(
                replace(
                    c,
                    estimates=tuple(
                        replace(e, unit=f"rad/{unit}") if e.unit == "rad/rad" else e
                        for e in c.estimates
                    ),
                )
                for c in row
            )
            for row in self.channels
        )
        bounds = self.servo and tuple(
            replace(b, dead_band=replace(b.dead_band, unit=unit)) for b in self.servo
        )
        return replace(self, channels=rows, servo=bounds)

    def estimate(self, name: str) -> Estimate:
        """One estimated number by name.

        Raises
        ------
        IdentificationError : there is none of that name; the message lists the valid names
        """
        for e in self.estimates:
            if e.name == name:
                return e
        names = ", ".join(e.name for e in self.estimates)
        raise IdentificationError(f"no estimate '{name}'; there are: {names}")

    def to_transfer_function(self) -> TransferFunctionModel:
        """The model file's content: what a flight with `--model` flies.

        A delay below zero becomes zero: the command was only sampled.
        """
        channels = tuple(
            tuple(Channel(c.num, c.den, max(c.delay, 0.0)) for c in row) for row in self.channels
        )
        servos = tuple(
            _servo(b, row[k].num[-1] / row[k].den[-1])
            for k, (b, row) in enumerate(zip(self.servo or (), self.channels, strict=False))
        )
        return TransferFunctionModel(
            channels,
            self.inputs,
            self.outputs,
            servos or None,
            std={e.name: e.std for e in self.estimates if np.isfinite(e.std)},
            fit={a.name: plain(a.fit) for a in self.axes},
            source={"warnings": list(self.warnings)},
            covariance=self._covariance(),
        )

    def _covariance(self) -> Covariance | None:
        """Of the figures with an uncertainty; None where figures do not describe a channel.

        Channels into one axis share their poles, and two zeros have no figures.
        """
        blocks: list[tuple[list[Estimate], Array]] = []
        for k, row in enumerate(self.channels):
            passing = [c for c in row if any(c.num)]
            if len(passing) != 1 or len(passing[0].num) > 2:
                return None
            found = list(passing[0].estimates)
            if self.servo is not None:
                b = self.servo[k]
                every = (b.rate_limit, b.dead_band, b.backlash, b.rate_limit_back, b.slew)
                found += [e for e in every if e is not None]
            blocks.append((found, passing[0].joint))
        names, values, parts = [], [], []
        for found, joint in blocks:
            # a value of zero is that of a dead band or backlash of which only a bound is known
            known = [
                i for i, e in enumerate(found) if np.isfinite(e.std) and e.std * e.value != 0.0
            ]
            names += [found[i].name for i in known]
            values += [found[i].value for i in known]
            parts.append(joint[np.ix_(known, known)])
        if not 0 < len(names) <= MOST_FIGURES:
            return None
        matrix = block_diag(*parts)
        return Covariance(tuple(names), tuple(values), tuple(map(tuple, matrix.tolist())))

    def to_dict(self) -> dict[str, object]:
        """Plain numbers for JSON; NaN becomes None."""
        return {
            "model": self.to_transfer_function().to_dict(),
            "estimates": [e.to_dict() for e in self.estimates],
            "axes": [a.to_dict() for a in self.axes],
            "fit": plain(self.fit),
            "warnings": list(self.warnings),
        }


def _servo(bounds: ServoBounds, gain: float) -> Servo:
    """The servo of a file, whose speeds are those ahead of the gain."""
    every = (bounds.rate_limit, bounds.rate_limit_back, bounds.slew)
    up, down, slew = (0.0 if e is None else e.value / abs(gain) for e in every)
    if gain < 0.0 and bounds.structure == "set-point":
        up, down = down, up
    dead_band, backlash = (max(e.value, 0.0) for e in (bounds.dead_band, bounds.backlash))
    return Servo(up, dead_band, backlash, bounds.structure, down, slew)
