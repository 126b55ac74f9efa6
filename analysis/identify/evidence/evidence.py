"""What an identification says of one number, one axis and one channel, with its uncertainty."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from analysis.array import Array
from analysis.identify.evidence.diagnostics import Residuals, Saturation
from analysis.identify.evidence.statics import Statics
from analysis.plain import Plain, plain
from analysis.transfer_function.servo import Structure


@dataclass(frozen=True, slots=True)
class Estimate(Plain):
    """One estimated number.

    Attributes
    ----------
    name, unit : e.g. `x/x natural frequency`, `rad/s`; channels are named output/input
    value : as estimated
    std : standard deviation, so that 1.96 of it are a 95 % interval; from the noise or, where they
        are larger, its colour or the scatter of whole steps
    determined : whether the readings say more than nothing of it
    at_least : `value` is a limit that no motion of the record reaches: it lies above
    interval : of 95 % confidence
    """

    name: str
    value: float
    std: float
    unit: str
    determined: bool = True
    at_least: bool = False

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of 95 % confidence."""
        if self.at_least:
            return self.value, np.inf
        if self.value == 0.0 and self.name.endswith(("dead band", "backlash")):
            return 0.0, 1.96 * self.std  # neither is negative
        return self.value - 1.96 * self.std, self.value + 1.96 * self.std

    def to_dict(self) -> dict[str, object]:
        """Plain numbers for JSON; a value that is not determined is None."""
        if not self.determined:
            low = plain(self.value) if self.at_least else None
            return {**Plain.to_dict(self), "value": None, "std": None, "low": low, "high": None}
        low, high = self.interval
        return {**Plain.to_dict(self), "low": plain(low), "high": plain(high)}


@dataclass(frozen=True, slots=True)
class AxisEvidence(Plain):
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
    spread : deviation over whole steps, over that of the noise: median over the parameters, NaN if
        unknown
    stamps : how far each step's time is off beyond the noise, rms [s]; NaN if unknown
    disagree : steps scatter more than noise explains, and the intervals are theirs
    allowed : intervals allow for coloured noise, by its colour or by whole steps; a structure that
        lacks a motion may leave the truth outside them
    repeats : share of the residual's power that a better linear model would take
    sizes : what poles and delay change by from the smallest to the largest step, where the speed
        does not grow with the step
    smear : what the scatter of the steps' times changes poles and delay by
    simpler : one pole less explains the readings as well
    beginning : residual of the start of a record over the largest of an equal time after it, rms;
        0 where the gimbal was free to move before
    outside : readings left out, more than 1 s before the first or after the last of the axis' own
        commands
    statics : the angles at rest beside a line over the commands; None of a bounded servo
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
    stamps: float
    disagree: bool
    allowed: bool
    repeats: float
    sizes: tuple[Estimate, ...]
    smear: dict[str, float]
    simpler: bool = False
    beginning: float = 0.0
    outside: int = 0
    statics: Statics | None = None

    @property
    def fit(self) -> tuple[float, ...]:
        """NRMSE fit of each record [%], of the angle where any was measured, else of the rate."""
        return self.fit_angle if np.isfinite(self.fit_angle).any() else self.fit_rate


@dataclass(frozen=True, slots=True)
class ServoBounds:
    """Bounds of the servo of one axis.

    Attributes
    ----------
    structure : `speed`: the servo's own loop saturates; `clipped`: the speed of a linear servo is
        clipped; `command`: ramps ahead of the linear part; `set-point`: as `speed`, behind a set
        point of bounded speed and with a limit each way
    losses : on steps held out, of every structure that was tried
    rate_limit : of the output [rad/s]; upward with `set-point`
    dead_band : half width, on the command [rad]
    backlash : total width at the output [rad]
    rate_limit_back, slew : of `set-point`, else None: of the output downward, and of the set point
        at the output [rad/s]
    """

    structure: Structure
    losses: Mapping[Structure, float]
    rate_limit: Estimate
    dead_band: Estimate
    backlash: Estimate
    rate_limit_back: Estimate | None = None
    slew: Estimate | None = None

    @property
    def idle(self) -> bool:
        """Whether no motion of the record reaches any of the limits of speed."""
        speeds = (self.rate_limit, self.rate_limit_back, self.slew)
        return all(e.at_least for e in speeds if e is not None)

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """All that the structure has."""
        every = (self.rate_limit, self.rate_limit_back, self.slew, self.dead_band, self.backlash)
        return tuple(e for e in every if e is not None)


@dataclass(frozen=True, slots=True)
class ChannelFit:
    """One transfer function with the covariance of its parameters.

    Attributes
    ----------
    num, den : descending powers of s; radians per radian
    delay : [s]; below zero if the command was given before the sample that first shows it
    estimates : gain, poles, zeros and delay in the field's own figures
    parameters : what `covariance` is of: ln c of the denominator, delay [s], numerator coefficients
    joint : covariance of the estimates, then of those of the servo's bounds; its diagonal is their
        deviations
    """

    num: tuple[float, ...]
    den: tuple[float, ...]
    delay: float
    estimates: tuple[Estimate, ...]
    parameters: Array = field(repr=False)
    covariance: Array = field(repr=False)
    joint: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
