"""A repeated run takes its files from its recording: none that the recording names is opened."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.recording import read
from tests.twin.plant.test_model import TETRAHEDRON, with_mesh
from twin.config import Fly, Replay, Step
from twin.errors import TwinError
from twin.experiments.flight.fly import fly
from twin.experiments.replay import replay
from twin.experiments.step import step
from twin.physics import guard
from twin.plant.model.packing import unpack

MOTOR = guard.SHIPPED / "motors" / "reference.eng"


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A step test of a mechanism with a mesh, whose folder is gone."""
    folder = tmp_path_factory.mktemp("replay")
    (folder / "own").mkdir()
    mechanism = with_mesh(folder / "own", TETRAHEDRON)
    step(Step(out=folder / "a.rrd", mechanism=mechanism, repeats=1, axis="x", hold_s=0.05))
    shutil.rmtree(folder / "own")
    return folder / "a.rrd"


@pytest.mark.thorough
def test_a_mechanism_whose_files_are_gone_is_repeated_to_the_last_bit(bench):
    found = replay(Replay(bench))
    assert found.identical
    assert found.changed == {}
    # and once more from the repetition
    assert replay(Replay(Path(found.replayed))).identical
    before, after = (read(path).properties for path in (bench, found.replayed))
    assert before["files"] == after["files"]
    assert before["configuration"]["mechanism"] == after["configuration"]["mechanism"]


def test_a_described_vehicle_and_its_motor_are_repeated_from_the_recording(tmp_path):
    own = tmp_path / "own" / "deeper"
    own.mkdir(parents=True)
    shutil.copy(MOTOR, own.parent / "m.eng")
    text = (guard.SHIPPED / "examples" / "reference.toml").read_text()
    assert 'file = "../motors/reference.eng"' in text
    text = text.replace("../motors/reference.eng", "../m.eng")
    (own / "v.toml").write_text(f'drag_table = "drag.csv"\n{text}')
    (own / "drag.csv").write_text("mach,drag\n0,0.5\n1,0.9\n")
    out = tmp_path / "a.rrd"
    fly(Fly(out=out, vehicle=own / "v.toml", duration_s=0.1))
    shutil.rmtree(own.parent)
    assert replay(Replay(out)).identical


def test_one_motor_of_several_is_repeated_from_the_recording(tmp_path):
    text = MOTOR.read_text()
    (tmp_path / "two.eng").write_text(f"{text}\n{text.replace('Reference 29', 'Other 29')}")
    out = tmp_path / "a.rrd"
    fly(Fly(out=out, motor=Path(f"{tmp_path / 'two.eng'}:Other"), duration_s=0.1))
    (tmp_path / "two.eng").unlink()
    assert replay(Replay(out)).identical


@pytest.mark.parametrize("setting", ["motor", "vehicle", "mechanism", "model", "scene"])
def test_a_file_that_a_recording_only_names_is_not_opened(tmp_path, monkeypatch, setting):
    """A FIFO would block the process that opens it."""
    out = tmp_path / "a.rrd"
    fly(Fly(out=out, gimbal="transfer-function", duration_s=0.05))
    fifo = tmp_path / ("trap.toml" if setting == "vehicle" else "trap.xml")
    os.mkfifo(fifo)
    old = read(out)
    settings = {**old.properties["configuration"], setting: str(fifo)}
    changed = replace(old, properties={**old.properties, "configuration": settings})
    monkeypatch.setattr("twin.experiments.replay.read", lambda _: changed)
    with pytest.raises(TwinError, match=rf"names the {setting} .*does not contain it") as caught:
        replay(Replay(out))
    assert "\n" not in str(caught.value)
    with pytest.raises((TwinError, ValueError), match=r"not a regular file|no scene|cannot read"):
        replay(Replay(out, force=True))


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"main.xml": b"<mujoco/>", "../a": b"x"}, "is called"),
        ({"main.xml": b"<mujoco/>", "/etc/a": b"x"}, "is called"),
        ({"main.xml": b'<mujoco><include file="/etc/passwd"/></mujoco>'}, "refers to"),
        ({"main.xml": b'<mujoco><asset><mesh file="/dev/zero"/></asset></mujoco>'}, "refers to"),
        ({"main.xml": b'<mujoco><compiler meshdir="/"/></mujoco>'}, "refers to"),
        (
            {"main.xml": b'<mujoco><asset><model file="package:../../x"/></asset></mujoco>'},
            "refers to",
        ),
        ({"main.xml": b"<mujoco><"}, "not well-formed"),
    ],
)
def test_a_packed_model_names_nothing_outside_the_pack(tmp_path, files, said):
    with pytest.raises(TwinError, match=said):
        unpack(files, tmp_path / "main.xml")
