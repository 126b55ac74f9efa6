"""Rows that the results of several verbs share."""

from typing import TYPE_CHECKING

from twin.config.result import Rows

if TYPE_CHECKING:
    from analysis.timing import Verdict


def timing_rows(timing: "Verdict | None") -> Rows:
    """Rows about a run in real time."""
    if timing is None:
        return []
    rows = [("timing", timing.text())]
    for name, percentiles in (
        ("lateness", timing.lateness),
        ("sensor age", timing.sensor_age),
        ("round trip", timing.round_trip),
    ):
        if percentiles is not None:
            times = (percentiles.p50, percentiles.p99, percentiles.worst)
            median, rare, worst = (t * 1e3 for t in times)
            rows.append((name, f"{median:.3f} ms median, {rare:.3f} ms 99 %, {worst:.3f} ms worst"))
    if timing.lateness is not None:
        rows.append(("overruns", f"{timing.overruns} of {timing.ticks} ticks"))
    if timing.moved is not None:
        by, step = timing.moved.timing.position, timing.moved.step.position
        rows.append(("path change", f"{by:.3g} m by timing, {step:.3g} m by the time step"))
    return rows + [("", f"without {k}: {v}") for k, v in timing.rights.items() if v != "granted"]


def computing_row(wall_s: float, cpu_s: float, steps: int, physics_s: float) -> tuple[str, str]:
    """Row about the time that a run took."""
    share = f"{physics_s:.2f} s of it for {steps} physics steps"
    return ("computing", f"{cpu_s:.2f} s of processor time, {share}; {wall_s:.2f} s in all")


def trouble_rows(fault: str | None, warnings: dict[str, int]) -> Rows:
    """Rows about a rig's fault and MuJoCo's warnings; none where there are none."""
    from hardware.faults.advice import advice

    rows = [] if fault is None else [("FAULT", "; ".join(filter(None, (fault, advice(fault)))))]
    return rows + [("WARNING", f"MuJoCo: {name} ×{n}") for name, n in warnings.items()]


def recording_rows(recording: str) -> Rows:
    """Rows that name a recording and how to look at it."""
    return [("recording", recording), ("", f"twin view {recording}")]
