"""Attempts that run something: faulty rigs, strangers, bad outputs, full disk, signals."""

import contextlib
import io
import json
import os
import shutil
import signal
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from itertools import combinations, count
from pathlib import Path
from random import Random

import numpy as np

import twin
from analysis.recording import read as read_recording
from analysis.recording import tables
from hardware.device import tcp
from hardware.emulator.injection import VALID
from tests.abuse.attempt import Attempt
from tests.abuse.children import Children
from tests.hardware import strangers
from tests.twin.cli import test_outputs as outputs_of
from tests.twin.cli.test_mutations import mutated
from tests.twin.physics.test_mechanism_build import LARGE
from twin.cli.main import main

WRITES = {
    **{verb: suffix for verb, suffix in outputs_of.VERBS.items() if verb != "converge"},
    "export run.rrd --to csv": ".csv",
    "export run.rrd --to parquet": ".parquet",
    "export run.rrd --to mat": ".mat",
    "mechanism build own.toml": ".xml",
}
ENDLESS = ("converge", "demo", "rig", "campaign run gains --workers 1", "mirror --clock wall")
SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGKILL)
ENDS = (0, 1, 128 + signal.SIGINT, 128 + signal.SIGTERM)
ENDING = 30.0  # s that a verb may take to end after a signal
LONGEST = 80.0  # s that a whole verb may take, calibrate some 5 s on a quiet processor
LATEST = 1.5  # s after its beginning at which a verb gets its signal


def faults(chance: Random, folder: Path) -> Iterator[Attempt]:
    """Flights with an emulated rig in lockstep: every fault alone, then pairs of two."""
    every = [f"{target}:{kind}" for target, kinds in VALID.items() for kind in kinds]
    _flown(folder / "flight.rrd", (), "ignore")  # compiles
    while True:
        alone = [(fault,) for fault in every]
        pairs = list(combinations(every, 2))
        chance.shuffle(alone)
        chance.shuffle(pairs)
        for chosen in [*alone, *pairs[: len(alone)]]:
            timed = [f"{fault}@{chance.choice((0, 0.05, 0.15))}" for fault in chosen]
            then = chance.choice(("end", "neutral", "ignore"))
            yield Attempt(
                f"fly --gimbal emulator {timed} --on-fault {then}",
                lambda f=timed, t=then: _flown(folder / "flight.rrd", f, t),
            )


def _flown(path: Path, chosen: list[str] | tuple[()], then: str) -> None:
    path.unlink(missing_ok=True)
    try:
        twin.fly(
            gimbal="emulator", duration_s=0.25, no_check=True, fault=chosen, on_fault=then, out=path
        )
    finally:
        if path.exists():
            flight = read_recording(path)
            for name in ("vehicle/position", "gimbal/command"):
                assert np.isfinite(flight[name].values).all(), f"{name} is not finite"


def peers(chance: Random, folder: Path) -> Iterator[Attempt]:
    """Strangers on the port of a rig that its owner flies."""
    before, tcp.GREETING_NS = tcp.GREETING_NS, 50_000_000
    target = strangers.Target("emulator", folder)
    try:
        with strangers.flight(target):
            while True:
                data = mutated(strangers.hostile() * 3, chance)
                attack = chance.choice((*strangers.ATTACKS, None))
                yield Attempt(
                    attack.__name__ if attack else "noise",
                    lambda a=attack, d=data: _attacked(target, a, d),
                    data,
                )
    finally:
        target.close()
        tcp.GREETING_NS = before


def _attacked(target: strangers.Target, attack, data: bytes) -> None:
    before = target.port.refused.total()
    if attack:
        attack(target)
    else:
        with strangers._connect(target) as line, contextlib.suppress(ConnectionError):
            line.sendall(data)
    target.until(lambda: target.port.refused.total() > before)
    # an owner that a loaded machine keeps waiting leaves its servos at neutral
    assert target.pulses <= {strangers.FLOWN, strangers.NEUTRAL}


def outputs(chance: Random, folder: Path) -> Iterator[Attempt]:
    """Every verb with `--out` on every kind of path that is not its own."""
    for k in count():
        place = _place(folder, f"{k}")
        command, suffix = chance.choice(list(outputs_of.VERBS.items()))
        paths = outputs_of.kinds(place, suffix)
        for path in chance.sample(paths[1:], 4):  # the first is a folder, which takes any name
            arguments = [*command.split(), "--out", str(path)]
            yield Attempt(" ".join(arguments), lambda a=arguments, p=place: _refused(a, p))
        shutil.rmtree(place)


def _refused(arguments: list[str], place: Path) -> None:
    before = outputs_of.state(place)
    code, errors = _run(arguments, place)
    assert (code, errors.count("\n")) == (2, 1), (code, errors)
    assert outputs_of.state(place) == before


def _run(arguments: list[str], place: Path) -> tuple[int, str]:
    """Exit code and standard error of a verb in this process."""
    errors = io.StringIO()
    with (
        contextlib.chdir(place),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(errors),
        contextlib.suppress(SystemExit),
    ):
        try:
            main(arguments)
        except SystemExit as end:
            return int(end.code or 0), errors.getvalue()
        finally:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
    return 0, errors.getvalue()


def _place(folder: Path, name: str) -> Path:
    """A new folder with the inputs of the verbs; the first one measures them."""
    whole = folder / "run.rrd"
    if not whole.exists():
        twin.step(repeats=1, hold_s=0.1, out=whole)
    place = folder / name
    place.mkdir()
    shutil.copy(whole, place)
    (place / "own.toml").write_text(LARGE)
    return place


def disk(chance: Random, folder: Path) -> Iterator[Attempt]:
    """Processes of verbs whose files cannot grow beyond a random size, as on a full disk."""
    with contextlib.closing(Children()) as children:
        for k, (command, suffix) in enumerate(_shuffled(list(WRITES.items()), chance)):
            room = int(10 ** chance.uniform(0, 5.3))
            arguments = [*command.split(), "--out", f"result{suffix}"]
            place = _place(folder, f"{k}")
            yield Attempt(
                f"{' '.join(arguments)}, with room for {room} bytes",
                lambda a=arguments, p=place, r=room: _filled(children, a, p, r),
            )
            shutil.rmtree(place)


def _shuffled(every: list, chance: Random) -> Iterator:
    """All of them in random order, and again."""
    while True:
        chance.shuffle(every)
        yield from every


def _filled(children: Children, arguments: list[str], place: Path, room: int) -> None:
    inputs = outputs_of.state(place)
    with children.verb(arguments, place, room) as child:
        assert child.ended(LONGEST), f"has not ended after {LONGEST:g} s"
        errors = child.errors()
    _whole(place, inputs)
    assert "Traceback" not in errors, errors
    assert child.code in (0, 1, 2), (child.code, errors)
    assert child.code == 2 or list(place.glob("result*")), f"nothing was written: {errors}"


def kills(chance: Random, folder: Path) -> Iterator[Attempt]:
    """Verbs in processes that get SIGTERM, SIGINT or SIGKILL at a random moment."""
    commands = [*(f"{c} --out result{s}" for c, s in WRITES.items()), *ENDLESS]
    with contextlib.closing(Children()) as children:
        for k, command in enumerate(_shuffled(commands, chance)):
            number, delay = chance.choice(SIGNALS), chance.uniform(0, LATEST)
            place = _place(folder, f"{k}")
            yield Attempt(
                f"{command}, {number.name} after {delay:.2f} s",
                lambda c=command, p=place, n=number, d=delay: _killed(children, c.split(), p, n, d),
            )
            shutil.rmtree(place)


def _killed(
    children: Children, arguments: list[str], place: Path, number: signal.Signals, delay: float
) -> None:
    inputs = outputs_of.state(place)
    with children.verb(arguments, place) as child:
        if not child.ended(delay):
            os.kill(child.pid, number)
        assert child.ended(ENDING), f"has not ended {ENDING:g} s after {number.name}"
        errors = child.errors()
    _whole(place, inputs)
    assert "Traceback" not in errors, errors
    if number != signal.SIGKILL:
        assert child.code in ENDS, (child.code, errors)
        assert not list(place.glob(".*")), f"left behind: {list(place.glob('.*'))}"


def _whole(place: Path, inputs: dict[str, tuple]) -> None:
    """The inputs are unchanged, and every result that is there opens."""
    after = outputs_of.state(place)
    assert {name: after.get(name) for name in inputs} == inputs
    for path in place.glob("result*"):
        _open(path)


def _open(path: Path) -> None:
    match path.suffix:
        case ".rrd":
            read_recording(path)
        case ".csv" | ".parquet" | ".mat":
            tables.read(path)
        case ".json":
            json.loads(path.read_text())
        case ".xml":
            ET.parse(path)
        case ".html":
            assert path.read_text().rstrip().endswith("</html>")
