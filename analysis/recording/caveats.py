"""What a person must know of recordings before believing figures made of them."""

from collections.abc import Sequence

import numpy as np

from analysis.recording.measurements import FOLLOWED, MEASURED, SIMULATED, Measurement
from analysis.recording.series import Recording

# Settings that decide the motion; motions with different settings do not test each other.
ASKED = (
    "signal", "axis", "amplitude_deg", "repeats", "hold_s", "band_hz", "smallest_deg",
    "rate_limit_deg_s", "programme", "target", "target_range_m", "off_axis_deg", "at_s", "about",
)  # fmt: skip
KNOWN = ("step", "fly")
OLD = (
    "recorded by an earlier version: its gimbal/simulated follows the measured angle and is not a"
    " model's; record or replay it again to compare them"
)
ALIKE = 2e-3  # rad, between commands that count as the same
LONGEST, MOST = 200, 5  # characters of one caveat, and caveats of one kind


def caveats(runs: Sequence[Measurement], *, together: bool = True) -> tuple[str, ...]:
    """One line for each reason to doubt runs, or a comparison of them with the first.

    Parameters
    ----------
    together : whether they should have been asked for the same
    """
    found = [
        _short(f"{run.name}: {reason}")
        for run in runs
        for reason in [*_own(run.recording), *([run.note] if run.note else [])]
    ]
    for run in runs[1:] if together else ():
        found += [_short(text) for text in _different(runs[0], run)]
    return tuple(found)


def _own(recording: Recording) -> list[str]:
    reasons = recording.timing.get("reasons")
    texts = [r for r in reasons if isinstance(r, str)] if isinstance(reasons, list) else []
    found = []
    if recording.timing.get("verdict") == "invalid":
        found.append("; ".join(["its timing was judged invalid", *texts]))
    if follows_measured(recording):
        found.append(OLD)
    if differs := _shadow_differs(recording):
        found.append(f"its simulated gimbal is without the rig's {', '.join(differs)}")
    failed = [e for e in recording.events if e.level == "ERROR"]
    return found + [f"at {e.time:.3f} s {e.text}" for e in failed[:MOST]]


def follows_measured(recording: Recording) -> bool:
    """Whether a recording's simulated angle follows the measured one, as before `followed`."""
    both = MEASURED in recording.series and SIMULATED in recording.series
    return both and FOLLOWED not in recording.series


def _shadow_differs(recording: Recording) -> list[str]:
    """Parameters of a simulated rig that the model beside it does not share."""
    shadow = recording.properties.get("shadow")
    names = shadow.get("differs") if isinstance(shadow, dict) else None
    return [n for n in names if isinstance(n, str)][:MOST] if isinstance(names, list) else []


def _different(reference: Measurement, other: Measurement) -> list[str]:
    name, label = reference.name, other.name
    commands = [r.recording.properties.get("command") for r in (reference, other)]
    if not all(c in KNOWN for c in commands):
        return []  # a table or a mirror: who knows what it was asked for
    if commands[0] != commands[1]:
        a, b = commands
        return [f"{label} is of {b}, {name} of {a}: they were asked for different motions"]
    asked = ((k, reference.recording.setting(k), other.recording.setting(k)) for k in ASKED)
    different = [
        # None stands for whatever that version did, which a replay may spell out
        f"{k} {theirs}, not {ours}"
        for k, ours, theirs in asked
        if None not in (ours, theirs) and ours != theirs
    ]
    if different:
        return [f"{label} was asked for {', '.join(different)} as {name}"]
    a, b = reference.command.values, other.command.values
    if commands[0] == "fly" and not (a.shape == b.shape and np.allclose(a, b, atol=ALIKE)):
        return [f"{label} and {name} are flights: each commanded its gimbal by its own attitude"]
    return []


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"
