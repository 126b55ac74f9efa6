"""Files of every kind with changes in them: read, or refused in one line; never anything else."""

import io
import json
import os
import random
import re

import numpy as np
import pytest
from scipy.io import savemat

from analysis.export.tables import write_csv
from analysis.recording import Recording, TimeSeries, tables
from analysis.recording import read as read_recording
from analysis.schema import AnalysisError
from analysis.transfer_function import TransferFunctionModel
from hardware.calibration import read as read_calibration
from hardware.calibration import write as write_calibration
from hardware.frames import HardwareError
from tests.conftest import ROOT
from tests.twin.physics.test_mechanism_build import LARGE
from tests.twin.physics.test_openrocket import design, packed
from tests.twin.recorder import runs
from twin.campaigns.sampling import study
from twin.config.overrides import parse
from twin.errors import TwinError
from twin.hil import nominal_calibration
from twin.physics import guard, motor, openrocket
from twin.physics import vehicle as vehicles
from twin.physics.mechanism import dimensions
from twin.plant.model.model import ModelConfig, load

HOSTILE = ROOT.parent / "shared" / "cases" / "hostile"
REFUSED = (TwinError, AnalysisError, HardwareError)
EXAMPLES = guard.SHIPPED / "examples"
TOKENS = (
    b"nan", b"-1", b"0", b"1e999", b"1e-320", b"999999999999999999999", b"", b"\0", b"\xff\xfe",
    b"<", b">", b'"', b"{", b"[", b",", b"\n", b"\r", b"../x", b"/dev/zero", b"true", b"null",
)  # fmt: skip
NUMBER = re.compile(rb"-?\d+\.?\d*")


def mutated(data, chance):
    """A copy with one to four changes, in places and of kinds that `chance` picks."""
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(data) + 1)
        end = min(len(data), at + chance.choice((1, 1, 2, 8, 100, 1000)))
        what = chance.randrange(7)
        if what == 0:
            data = data[:at] + bytes(chance.randrange(256) for _ in range(end - at)) + data[end:]
        elif what == 1:
            data = data[:at] + data[end:]
        elif what == 2:
            data = data[:end] + data[at:end] + data[end:]
        elif what == 3:
            data = data[:at] + chance.choice(TOKENS) + data[at:]
        elif what == 4 and (found := list(NUMBER.finditer(data))):
            number = chance.choice(found)
            data = data[: number.start()] + chance.choice(TOKENS[:6]) + data[number.end() :]
        elif what == 5:
            data = data[:at]
        elif at < len(data):
            data = data[:at] + bytes([data[at] ^ 1 << chance.randrange(8)]) + data[at + 1 :]
    return data


def recording_bytes(folder):
    runs.fly(folder / "whole.rrd", 0.2)
    return (folder / "whole.rrd").read_bytes()


def calibration_bytes(folder):
    bench = load(ModelConfig(scene="bench")).mj
    write_calibration(folder / "whole.json", nominal_calibration(bench))
    return (folder / "whole.json").read_bytes()


def mat_bytes(folder):
    file = io.BytesIO()
    savemat(file, {"t": np.arange(50.0), "y": np.ones((50, 2)), "log": {"u": np.zeros(50)}})
    return file.getvalue()


def table_bytes(folder):
    return b"t,u,y\n" + b"".join(b"%d,%d,%d.5\n" % (k, k % 3, k % 5) for k in range(60))


def rse_bytes(folder):
    points = "".join(f'<eng-data t="{t}" f="{f}"/>' for t, f in ((0, 0), (0.1, 9), (1, 0)))
    attributes = 'code="A1" mfg="X" dia="29" len="100" propWt="20" initWt="50"'
    return (
        f"<engine-list><engine {attributes}><data>{points}</data></engine></engine-list>".encode()
    )


def parquet_bytes(folder):
    import pyarrow
    from pyarrow import parquet

    file = io.BytesIO()
    parquet.write_table(pyarrow.table({"t": np.arange(50.0), "y": np.ones(50)}), file)
    return file.getvalue()


def exported_bytes(folder):
    time, turn = 0.004 * np.arange(30.0), np.linspace(0.0, 0.1, 60).reshape(30, 2)
    names = "gimbal/command", "gimbal/measured"
    signals = [TimeSeries(name, time, turn, "rad", ("x", "y")) for name in names]
    write_csv(Recording({"command": "step"}, {s.name: s for s in signals}), folder / "whole.csv")
    return (folder / "whole.csv").read_bytes()


# suffix, content of a valid file, reader, how many are tried in the short form
KINDS = {
    "motor": (".eng", lambda _: (guard.SHIPPED / "motors/reference.eng").read_bytes(),
              motor.load, 150),
    "rocksim": (".rse", rse_bytes, motor.load, 150),
    "table": (".csv", table_bytes, tables.read, 150),
    "mat": (".mat", mat_bytes, tables.read, 2),
    "recording": (".rrd", recording_bytes, read_recording, 60),
    "identified": (".json", lambda _: (guard.SHIPPED / "gimbal.json").read_bytes(),
                   TransferFunctionModel.read, 150),
    "calibration": (".json", calibration_bytes, read_calibration, 150),
    "parameters": (".json", lambda _: json.dumps({"wind_speed": 3.0, "a[1]": 2}).encode(),
                   lambda path: parse((), path), 150),
    "description": (".toml", lambda _: (EXAMPLES / "large_rocket.toml").read_bytes(),
                    vehicles.described, 100),
    "OpenRocket": (".ork", lambda _: design().encode(),
                   lambda path: openrocket.imported(openrocket.document(path)), 100),
    "OpenRocket archive": (".ork",
                           lambda folder: packed(folder / "whole.ork", design()).read_bytes(),
                           openrocket.document, 100),
    "study": (".toml", lambda _: (study.SHIPPED / "limits.toml").read_bytes(),
              lambda path: study.read(str(path)), 100),
    "mechanism": (".toml", lambda _: LARGE.encode(), dimensions.read, 100),
    "parquet": (".parquet", parquet_bytes, tables.read, 2),
    "exported": (".csv", exported_bytes, read_recording, 2),
    "model counted": (".xml", lambda _: (EXAMPLES / "direct_drive.xml").read_bytes(),
                      lambda path: guard.examine([path]), 100),
    "model": (".xml", lambda _: (EXAMPLES / "direct_drive.xml").read_bytes(),
              lambda path: load(ModelConfig(scene="bench", mechanism=path)), 2),
}  # fmt: skip


def fault(read, path):
    """What a reader says against a file; None where it takes it."""
    try:
        read(path)
    except REFUSED as error:
        return str(error)
    return None


def tries(kind, folder, count, seed):
    suffix, make, read, _ = KINDS[kind]
    whole, path, chance = make(folder), folder / f"mutated{suffix}", random.Random(seed)
    path.write_bytes(whole)
    read(path)
    refused, lines = 0, set()
    for _ in range(count):
        path.write_bytes(mutated(whole, chance))
        line = fault(read, path)
        refused += line is not None
        lines.add(line or "")
    assert not [line for line in lines if "\n" in line]
    return refused


@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
def test_a_changed_file_is_read_or_refused_in_one_line(tmp_path, kind):
    count = KINDS[kind][3]
    refused = tries(kind, tmp_path, count, seed=1)
    assert refused > count / 20  # else nothing was tried


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_five_hundred_changed_files_are_read_or_refused_in_one_line(tmp_path, kind):
    assert tries(kind, tmp_path, 500, seed=2) > 25


@pytest.mark.skipif(not HOSTILE.is_dir(), reason="../shared/cases is not on this machine")
def test_a_matlab_file_that_broke_the_program_is_refused_in_one_line():
    # two messages: what lies in the child's memory decides whether the file corrupts it into a
    # crash, or the child lives to refuse the file
    with pytest.raises(
        AnalysisError, match=r"mat_segv\.mat: is (damaged or hostile|not a readable)"
    ):
        tables.read(HOSTILE / "mat_segv.mat")


@pytest.mark.parametrize("name", ["fifo", "device", "link", "folder", "missing", "x" * 300])
@pytest.mark.parametrize("kind", [k for k in KINDS if k != "model"])
def test_what_is_not_a_regular_file_is_refused_in_one_line(tmp_path, kind, name):
    """Opening a FIFO blocks for ever, reading a device never ends."""
    suffix, _, read, _ = KINDS[kind]
    path = tmp_path / f"{name}{suffix}"
    if name == "fifo":
        os.mkfifo(path)
    elif name in ("device", "link"):
        (tmp_path / "link").symlink_to("/dev/zero")
        path.symlink_to("/dev/zero" if name == "device" else tmp_path / "link")
    elif name == "folder":
        path.mkdir()
    with pytest.raises(REFUSED) as caught:
        read(path)
    assert "\n" not in str(caught.value)
