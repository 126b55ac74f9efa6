"""Attempts that only parse: frames of the wire, files of every kind, settings of every verb."""

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from pathlib import Path
from random import Random

import numpy as np

from hardware.protocol import Unknown, encode
from tests.abuse.attempt import Attempt, Kind
from tests.hardware.test_protocol import _decode, _telemetry
from tests.twin.cli import test_mutations as mutations
from tests.twin.cli import test_settings as of_settings

# what is read from these has no empty places, so no number in it may be NaN or infinite
COMPLETE = ("motor", "rocksim", "identified", "calibration", "parameters", "mechanism")


def codec(chance: Random, _: Path) -> Iterator[Attempt]:
    """Streams of changed frames and noise, decoded whole and in pieces."""
    while True:
        frames = [encode(_telemetry(chance), k) for k in range(chance.randint(1, 4))]
        data = mutations.mutated(b"".join(frames), chance)
        if chance.random() < 0.3:
            data += chance.randbytes(chance.randint(1, 400)) + b"\0" + frames[0]
        piece = chance.randint(1, 64)
        yield Attempt(f"frames, in pieces of {piece}", lambda d=data, p=piece: _decoded(d, p), data)


def _decoded(data: bytes, piece: int) -> None:
    whole, decoder = _decode(data)
    cut, other = _decode(data, piece=piece)
    assert whole == cut
    assert decoder.counters == other.counters
    for frame in whole:  # each was sent as the bytes of its one encoding
        assert isinstance(frame.message, Unknown) or encode(frame.message, frame.sequence) in data


def files(kind: str) -> Kind:
    """Changed copies of a valid file of one kind."""
    suffix, make, read, _ = mutations.KINDS[kind]

    def attempts(chance: Random, folder: Path) -> Iterator[Attempt]:
        whole, path = make(folder), folder / f"mutated{suffix}"
        path.write_bytes(whole)
        read(path)
        while True:
            data = mutations.mutated(whole, chance)
            yield Attempt(path.name, lambda d=data: _read(d, path, read, kind), data)

    return attempts


def _read(data: bytes, path: Path, read: Callable[[Path], object], kind: str) -> None:
    path.write_bytes(data)
    value = read(path)
    if kind in COMPLETE:
        assert finite(value), f"accepted what is not finite: {value}"


def finite(value: object) -> bool:
    """Whether every number in a result is finite."""
    if dataclasses.is_dataclass(value):
        return all(finite(getattr(value, f.name)) for f in dataclasses.fields(value))
    if isinstance(value, Mapping):
        return all(map(finite, value.values()))
    if isinstance(value, np.ndarray):
        return bool(np.all(np.isfinite(value))) if value.dtype.kind == "f" else True
    if isinstance(value, tuple | list):
        return all(map(finite, value))
    return math.isfinite(value) if isinstance(value, float) else True


def settings(chance: Random, _: Path) -> Iterator[Attempt]:
    """Every numeric setting of every verb with every number that means nothing."""
    named = [(p.id, *p.values) for p in of_settings.numeric_settings()]
    while True:
        pairs = list(product(named, of_settings.NONSENSE))
        chance.shuffle(pairs)
        for (name, kind, field), number in pairs:
            yield Attempt(
                f"{name} {str(number)[:9]}",
                lambda k=kind, f=field, n=number: of_settings.refused_or_meaningful(k, f, n),
            )
