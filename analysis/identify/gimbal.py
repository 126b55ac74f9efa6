"""A whole gimbal: each axis by its own command, and the cross channels only where there are any."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from analysis.array import Array
from analysis.identify.channels import nothing
from analysis.identify.evidence.evidence import ChannelFit
from analysis.identify.identification import identify
from analysis.identify.model import IdentifiedModel
from analysis.identify.prediction import predict
from analysis.recording.measurements import Measurement
from analysis.transfer_function.servo import Structure

Coupling = Literal["auto", "none", "full"]

# Motion of an axis with the other's command, over its own. Below, a cross channel's poles and delay
# are fitted to what friction leaves; the MPU6050's cross-axis sensitivity alone is 2 %.
_WORTH_A_CHANNEL = 0.02
_REST = 1.0  # s kept before and after an axis' own commands


def identify_gimbal(
    records: Sequence[Measurement],
    poles: int = 2,
    zeros: int = 0,
    delay: Literal["free"] | float = "free",
    *,
    servo: bool | Structure = False,
    coupling: Coupling = "auto",
    max_delay: float | None = None,
) -> IdentifiedModel:
    """Identify every axis of a gimbal; as `identify`, but without channels that nothing passes.

    Parameters
    ----------
    coupling : `full` fits all channels together, `none` each axis from its own command,
        `auto` the former where an axis follows another's command by more than 2 %; with a servo
        `none` is all there is

    Raises
    ------
    IdentificationError : records no model can come from, and orders that are not possible
    """
    inputs, outputs = (records[0].inputs, records[0].outputs) if records else ((), ())
    square = len(inputs) == len(outputs)
    if not square or len(inputs) < 2 or (coupling == "full" and not servo):
        return identify(records, poles, zeros, delay, servo=servo, max_delay=max_delay)

    def fitted(k: int, servo: bool | Structure) -> IdentifiedModel:
        own = own_records(records, k)
        model = identify(own, poles, zeros, delay, servo=servo, max_delay=max_delay)
        outside = sum(_readings(r, k) for r in records) - sum(_readings(r, 0) for r in own)
        return replace(model, axes=(replace(model.axes[0], outside=outside),))

    alone = [fitted(k, servo) for k in range(len(inputs))]
    if servo is True and len({m.servo[0].structure for m in alone if m.servo}) > 1:
        # servos of one make: the steps of both axes tell more than those of one
        shared = shared_structure([m.servo[0].losses for m in alone if m.servo])
        alone = [
            m if m.servo and m.servo[0].structure == shared else _also(fitted(k, shared), m)
            for k, m in enumerate(alone)
        ]
    model = IdentifiedModel(
        inputs,
        outputs,
        tuple(_row(m.channels[0][0], k, len(inputs)) for k, m in enumerate(alone)),
        tuple(b for m in alone for b in m.servo or ()) or None,
        tuple(m.axes[0] for m in alone),
        tuple(dict.fromkeys(w for m in alone for w in m.warnings)),  # what is said of both, once
    )
    if coupling == "none":
        return model
    crossed = cross_gains(model, records)
    if np.abs(crossed).max() <= _WORTH_A_CHANNEL:
        return model
    if not servo:
        return identify(records, poles, zeros, delay, max_delay=max_delay)
    found = [
        f"axis '{outputs[i]}' also follows command '{inputs[j]}', by {100 * crossed[i, j]:.2g} % of"
        " what its own axis does; a servo model has no such channel"
        for i, j in np.argwhere(np.abs(crossed) > _WORTH_A_CHANNEL)
    ]
    return replace(model, warnings=(*model.warnings, *found))


def cross_gains(model: IdentifiedModel, records: Sequence[Measurement]) -> Array:
    """How far each axis (rows) moves with each other command, over that axis' own (q, q).

    Least squares of what the model leaves of an axis on the motions of all axes; the diagonal is 0.
    """
    size = len(model.outputs)
    parts = []
    for r in records:
        angle, rate = predict(model, r)
        what, measured = r.sensors[0]
        said = (angle if what == "angle" else rate)[np.searchsorted(r.time, measured.time)]
        parts.append((measured.values - said, said))
    found = np.zeros((size, size))
    for i in range(size):
        left = np.concatenate([e[:, i] for e, _ in parts])
        there = np.concatenate([y - y.mean(axis=0) for _, y in parts])
        good = np.isfinite(left)
        regressors = np.column_stack([there[good], np.ones(good.sum())])
        found[i] = np.linalg.lstsq(regressors, left[good], rcond=None)[0][:size]
    np.fill_diagonal(found, 0.0)
    return found


def shared_structure(losses: Sequence[Mapping[Structure, float]]) -> Structure:
    """The structure that every axis was tried with and that predicts steps held out best."""
    tried = [s for s in losses[0] if all(s in axis for axis in losses)]
    return min(tried, key=lambda s: math.prod(axis[s] / min(axis.values()) for axis in losses))


def _also(shared: IdentifiedModel, own: IdentifiedModel) -> IdentifiedModel:
    """An axis fitted with the shared structure, with what its own best one says of it.

    That is the loss of every structure, and a warning where the figures of its own one differ.
    """
    if not shared.servo or not own.servo:
        return shared
    bounds, best = shared.servo[0], own.servo[0].structure
    bounds = replace(bounds, losses={**own.servo[0].losses})
    changed = [
        abs(own.estimate(e.name).value - e.value) > 1.96 * e.std
        for e in (*shared.channels[0][0].estimates, bounds.rate_limit)
        if not (e.at_least or own.estimate(e.name).at_least)
    ]
    if not any(changed):
        return replace(shared, servo=(bounds,))
    said = (
        f"axis '{shared.outputs[0]}': '{best}' predicts its steps better than '{bounds.structure}'"
    )
    said += f", which suits all axes best, and its figures differ (--structure {best});"
    warnings = (*shared.warnings, f"{said} record steps of more sizes")
    return replace(shared, servo=(bounds,), warnings=warnings)


def own_records(records: Sequence[Measurement], k: int) -> list[Measurement]:
    """Each record's axis k with its own command, around the time in which that changes."""
    return [_own(r, k) for r in records]


def _row(channel: ChannelFit, place: int, size: int) -> tuple[ChannelFit, ...]:
    return tuple(channel if j == place else nothing(channel) for j in range(size))


def _readings(r: Measurement, k: int) -> int:
    return sum(int(np.isfinite(series.values[:, k]).sum()) for _, series in r.sensors)


def _own(r: Measurement, k: int) -> Measurement:
    one = r.select((r.inputs[k],), (r.outputs[k],))
    rows = one.command.changes()
    if not len(rows) or r.initial == "free":
        return one
    low, high = one.command.time[rows[0]] - _REST, one.command.time[rows[-1]] + _REST
    near = one.between(low, high)
    return near if len(near.time) > 2 else one
