"""Gain, phase and coherence over frequency, with the band the record allows."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Line, Panel, Plot, Section
from analysis.report.spectrum import FrequencyResponse


def frequency(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:  # noqa: ARG001
    """One column an axis; nothing if no command excited enough frequencies."""
    names = list(dict.fromkeys(name for n in numbers.runs for name in n.responses))
    if not names:
        return None
    panels: list[Panel] = []
    lines: list[Line] = []
    for column, name in enumerate(names):
        first = len(panels)
        panels += [
            Panel(f"axis {name}: gain", "gain [dB]", 0, column),
            Panel("phase", "phase [°]", 1, column),
            Panel("coherence", "coherence", 2, column),
        ]
        for k, entry in enumerate(numbers.runs):
            if name in entry.responses:
                lines += _lines(entry.label, f"run{k}", entry.responses[name], first)
    averages = {r.averages for n in numbers.runs for r in n.responses.values()}
    plot = Plot(
        "frequency",
        f"From command to angle, {'/'.join(map(str, sorted(averages)))} averages; bands are 95 % "
        "intervals (Bendat and Piersol 2010, eq. 9.90); they contain scatter, not the leakage of a "
        "short record. Shown where the command had power and the coherence is at least 0.5. It is "
        "the response at this amplitude; with backlash or a speed limit it depends on it.",
        "frequency [Hz]",
        tuple(panels),
        tuple(lines),
        x_log=True,
        panel_height=190,
    )
    return Section("frequency", "Frequency response", (), (plot,))


def _lines(label: str, role: str, found: FrequencyResponse, panel: int) -> list[Line]:
    f, error = found.frequency, found.error
    gaps = np.flatnonzero(np.diff(f) > 3.0 * np.median(np.diff(f))) + 1
    gain, phase = 20.0 * np.log10(found.gain), np.degrees(found.phase)
    low = 20.0 * np.log10(found.gain * np.maximum(1.0 - error, 1e-3))
    high = 20.0 * np.log10(found.gain * (1.0 + error))
    half = np.degrees(error)
    broken = [
        np.insert(v, gaps, math.nan)
        for v in (gain, low, high, phase, phase - half, phase + half, found.coherence)
    ]
    x = np.insert(f, gaps, f[gaps - 1] if len(gaps) else [])
    return [
        Line(label, x, broken[0], role, panel, "line", broken[1], broken[2]),
        Line(label, x, broken[3], role, panel + 1, "line", broken[4], broken[5]),
        Line(label, x, broken[6], role, panel + 2),
    ]
