"""What an identified model says about a record it may never have seen."""

from collections.abc import Sequence

import numpy as np

from analysis.array import Array
from analysis.identify.errors import IdentificationError
from analysis.identify.model import IdentifiedModel
from analysis.identify.problem.basis import Denominator, denominator, over_single, parameters_of
from analysis.identify.problem.layout import Layout
from analysis.identify.problem.modal import modal_response
from analysis.identify.problem.states import free_motion
from analysis.identify.problem.weights import free_weights
from analysis.identify.servo.response import servo_motion_of
from analysis.recording.measurements import Measurement


def predict(model: IdentifiedModel, record: Measurement) -> tuple[Array, Array]:
    """Angle [rad] and rate [rad/s] (n, outputs) under a record's commands, from rest.

    A command that the record lacks is taken as never given.

    Raises
    ------
    IdentificationError : the record has commands that the model lacks
    """
    if not set(record.inputs) <= set(model.inputs):
        raise IdentificationError(
            f"{record.name}: commands {', '.join(record.inputs)}; "
            f"the model has {', '.join(model.inputs)}"
        )
    angle = np.zeros((len(record.time), len(model.outputs)))
    rate = np.zeros_like(angle)
    for i, row in enumerate(model.channels):
        for j, channel in enumerate(row):
            if model.inputs[j] not in record.inputs:
                continue
            column = record.inputs.index(model.inputs[j])
            if model.servo is not None and i == j:
                motion = servo_motion_of(channel, model.servo[i], record, column)
            elif model.servo is not None:
                continue
            else:
                motion = _linear(channel.num, channel.den, channel.delay, record, column)
            angle[:, i] += motion[0]
            rate[:, i] += motion[1]
    return angle, rate


def fit_to(model: IdentifiedModel, records: Sequence[Measurement]) -> Array:
    """NRMSE fit [%] of the prediction (records, outputs); NaN where nothing was measured.

    Around each record's own offset, which is the sensor's and not the model's, and with the motion
    in which a record with a free start began; of the angle where it was measured, otherwise of the
    rate.
    """
    return np.array([_fit_percent(model, r) for r in records])


def _fit_percent(model: IdentifiedModel, record: Measurement) -> Array:
    """NRMSE fit of a record [%] (outputs,); NaN for axes the record lacks."""
    angle, rate = predict(model, record)
    found = np.full(len(model.outputs), np.nan)
    for i, name in enumerate(model.outputs):
        if name not in record.outputs:
            continue
        for what, series in record.sensors:
            measured = series.select((name,)).known()
            if len(measured.time) > 1:
                said = (angle if what == "angle" else rate)[:, i]
                at = np.searchsorted(record.time, measured.time)
                moved = said[at]
                if record.initial == "free" and model.servo is None:
                    moved = moved + _free_motion(
                        model, i, measured.time - record.time[0], measured.value - moved, what
                    )
                found[i] = nrmse_fit(measured.value, moved)
                break
    return found


def _free_motion(model: IdentifiedModel, axis: int, time: Array, left: Array, what: str) -> Array:
    """Motion (n,) with which a record began, as far as the poles of an axis explain what is left.

    As the fit takes it (`problem`): one of each channel's poles, beside the sensor's offset.
    """
    columns = [np.ones((len(time), 1))]
    for channel in model.channels[axis]:
        if any(channel.num):
            den = denominator(parameters_of(np.roots(channel.den)))
            layout = Layout(den.order, 0, 1, own=True, delays=(0.0,), frequency=abs(den.poles[0]))
            states = free_motion(time, den)
            columns.append(states @ free_weights(den, layout)[what == "rate"])
    basis = np.hstack(columns)
    found = np.linalg.lstsq(basis, left, rcond=1e-9)[0]
    return np.asarray(basis[:, 1:] @ found[1:])


def nrmse_fit(measured: Array, predicted: Array) -> float:
    """100·(1 − |error|/|measured − mean|) [%] around the mean error; NaN for a constant."""
    error = measured - predicted
    if np.ptp(measured) == 0.0:  # the mean of a constant is off by rounding
        return float("nan")
    spread = float(np.linalg.norm(measured - measured.mean()))
    return 100.0 * (1.0 - float(np.linalg.norm(error - error.mean())) / spread)


def _linear(
    num: tuple[float, ...], den: tuple[float, ...], delay: float, record: Measurement, column: int
) -> tuple[Array, Array]:
    d: Denominator = denominator(parameters_of(np.roots(den)))
    command = record.command.values[:, column]
    single, _, held = modal_response(
        record.time, record.command.time, command - command[0], d.poles, delay
    )
    both = []
    for numerator in (np.array([num]), np.array([[*num, 0.0]])):
        weights, through = over_single(numerator / den[0], d)
        both.append((single @ weights).real[:, 0] + held * through[0])
    return both[0] + command[0] * num[-1] / den[-1], both[1]
