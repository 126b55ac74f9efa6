"""What a person must know of recordings before believing figures made of them."""

from collections.abc import Sequence

from analysis.recording.reader import Recording

# What a run was told to do; two motions that answer different questions are no test of each other.
ASKED = (
    "signal", "axis", "amplitude_deg", "repeats", "hold_s", "band_hz", "smallest_deg",
    "rate_limit_deg_s", "programme", "target", "target_range_m", "off_axis_deg", "at_s", "about",
)  # fmt: skip
KNOWN = ("step", "fly")
LONGEST, MOST = 200, 5  # characters of one caveat, and caveats of one kind


def caveats(
    recordings: Sequence[Recording], labels: Sequence[str], *, together: bool = True
) -> tuple[str, ...]:
    """One line for each reason to doubt runs, or a comparison of them with the first.

    Parameters
    ----------
    labels : what each recording is called
    together : whether they should have been asked for the same
    """
    found: list[str] = []
    for recording, label in zip(recordings, labels, strict=True):
        found += [_short(f"{label}: {reason}") for reason in _own(recording)]
    if together:
        for recording, label in zip(recordings[1:], labels[1:], strict=True):
            found += [_short(t) for t in _other(recordings[0], labels[0], recording, label)]
    return tuple(found)


def _own(recording: Recording) -> list[str]:
    reasons = recording.timing.get("reasons")
    told = [r for r in reasons if isinstance(r, str)] if isinstance(reasons, list) else []
    found = []
    if recording.timing.get("verdict") == "invalid":
        found.append("; ".join(["its timing was judged invalid", *told]))
    failed = [e for e in recording.events if e.level == "ERROR"]
    return found + [f"at {e.time:.3f} s {e.text}" for e in failed[:MOST]]


def _other(reference: Recording, name: str, other: Recording, label: str) -> list[str]:
    commands = [r.properties.get("command") for r in (reference, other)]
    if not all(c in KNOWN for c in commands):
        return []  # a table or a mirror: who knows what it was asked for
    if commands[0] != commands[1]:
        a, b = commands
        return [f"{label} is of {b}, {name} of {a}: they were asked for different motions"]
    asked = ((k, reference.setting(k), other.setting(k)) for k in ASKED)
    different = [
        # None stands for whatever that version did, which a replay may spell out
        f"{k} {theirs}, not {ours}"
        for k, ours, theirs in asked
        if None not in (ours, theirs) and ours != theirs
    ]
    return [f"{label} was asked for {', '.join(different)} as {name}"] if different else []


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"
