"""The reader: what it gives back, and what it refuses."""

import contextlib
import io
import struct
import subprocess
import time

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis import schema
from analysis.recording import RecordingError, TimeSeries, rrd
from analysis.recording import reader as recording
from tests.twin.recorder import runs
from twin import viewer
from twin.recorder import Recorder
from twin.viewer import process


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "flight.rrd"
    runs.fly(path, 3.0)
    return path


def test_values_come_back_in_si(flight):
    series = recording.read(flight)["gimbal/command"]
    expected = np.array([runs.angle(t) for t in series.time])
    # an ulp in the argument of the sine, one each way through degrees
    np.testing.assert_allclose(series.values, expected, rtol=1e-14, atol=1e-16)
    assert series.unit == "rad"
    assert series.components == ("x", "y")


def test_time_comes_back_to_the_nanosecond(tmp_path):
    rng = np.random.default_rng(3)
    stamps = np.cumsum(rng.integers(1, 10**12, 2000))  # every gap different
    stamps = stamps[stamps < 2**50]  # 13 days, the documented range
    with Recorder(tmp_path / "a.rrd", signals=["link/lost"], properties={}) as recorder:
        for stamp in stamps.tolist():
            recorder.row[:] = 1.0
            recorder.commit(stamp, stamp)
    assert np.array_equal(recording.read(tmp_path / "a.rrd")["link/lost"].time_ns, stamps)


def test_properties_events_and_missing_samples_come_back(flight):
    run = recording.read(flight)
    assert run.properties == {"seed": 7, "configuration": {"motor": "H13", "gain": 0.1}}
    assert [event.text for event in run.events] == ["ignition"]
    assert run["gimbal/measured"].time[0] == 0.1  # nothing was measured before
    assert len(run["gimbal/command"].time) - len(run["gimbal/measured"].time) == 25
    assert np.isfinite(run["gimbal/measured"].values).all()


@pytest.mark.parametrize("cut", [False, True])
def test_long_properties_survive_optimising_and_repair(tmp_path, cut):
    """Rerun's optimiser splits properties of this length into one chunk for each."""
    whole, mended = tmp_path / "whole.rrd", tmp_path / "mended.rrd"
    properties = {"model": [f"{k:08x}" for k in range(20_000)]}
    with Recorder(whole, signals=["vehicle/mass"], properties=properties) as recorder:
        for tick in range(2000):
            recorder.row[:] = tick
            recorder.commit(tick * runs.PERIOD_NS, tick)
    if cut:
        content = whole.read_bytes()
        whole.write_bytes(content[: int(0.97 * len(content))])
        mended = viewer.repaired(whole)
    else:
        options = ["rrd", "optimize", whole, "-o", mended]
        subprocess.run([process.binary(), *options], check=True, capture_output=True)
    found = [b for _, b in rrd.batches(mended, {recording.PROPERTIES})]
    assert len(found) == 2, "the file is not of the kind this test is about"
    run = recording.read(mended)
    assert run.properties == properties
    kept = run["vehicle/mass"].values[:, 0]
    assert len(kept) > 1000
    assert np.array_equal(kept, np.arange(len(kept)))


def test_what_is_read_cannot_be_written(flight):
    series = recording.read(flight)["gimbal/command"]
    with pytest.raises(ValueError, match="read-only"):
        series.values[0, 0] = 1.0


def test_a_signal_that_was_not_recorded_is_answered_with_those_that_were(flight):
    with pytest.raises(RecordingError, match=r"'gimbal/comand'.*did you mean 'gimbal/command'"):
        recording.read(flight)["gimbal/comand"]


def test_thirty_thousand_rows_of_forty_scalars_read_fast(tmp_path, capsys):
    signals = list(runs.SIGNALS)
    with Recorder(tmp_path / "long.rrd", signals=signals, properties={}) as recorder:
        recorder.row[:] = 1.0
        for tick in range(30_000):
            recorder.commit(tick * runs.PERIOD_NS, tick)
    took = []
    for _ in range(3):
        start = time.process_time()  # others may take the processor
        run = recording.read(tmp_path / "long.rrd")
        took.append(time.process_time() - start)
    width = sum(len(series.components) for series in run.series.values())
    with capsys.disabled():
        print(f"\n30 000 x {width} read in {1e3 * min(took):.0f} ms")
    assert min(took) < 1.0  # 0.15 s of CPU; the bound only catches another order


def test_no_recording_is_refused_in_one_line(tmp_path):
    for content in (b"", b"hello", b"RRF2", b"RRF2" + bytes(500), b"RRF2" + b"\xff" * 500):
        path = tmp_path / "bad.rrd"
        path.write_bytes(content)
        with pytest.raises(RecordingError) as caught:
            recording.read(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(RecordingError, match="No such file"):
        recording.read(tmp_path / "nothing.rrd")
    with pytest.raises(RecordingError, match="not a regular file"):
        recording.read(tmp_path)


@pytest.mark.parametrize("keep", [0.3, 0.6, 0.99])
def test_a_file_cut_off_is_refused_with_the_way_out(flight, tmp_path, keep):
    content = flight.read_bytes()
    path = tmp_path / "cut.rrd"
    path.write_bytes(content[: int(keep * len(content))])
    with pytest.raises(RecordingError, match=r"end is missing.*twin view"):
        recording.read(path)


def test_a_chunk_that_claims_to_be_huge_is_refused_before_memory_is_taken(flight, tmp_path):
    """A varint of 2^62 in place of a chunk's uncompressed size."""
    content = flight.read_bytes()
    mark = content.index(bytes([0x10, 2, 0x18]), 200_000)  # compression LZ4, then the size
    huge = content[: mark + 3] + b"\xff" * 8 + b"\x3f" + content[mark + 12 :]
    path = tmp_path / "huge.rrd"
    path.write_bytes(huge)
    with pytest.raises(RecordingError):
        recording.read(path)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_flipped_bytes_never_end_in_anything_but_a_recording_error(flight, tmp_path, data):
    content = bytearray(flight.read_bytes())
    for _ in range(data.draw(st.integers(1, 6))):
        content[data.draw(st.integers(4, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / "flipped.rrd"
    path.write_bytes(content)
    with contextlib.suppress(RecordingError):
        run = recording.read(path)
        assert all(not np.isinf(series.values).any() for series in run.series.values())


def write(
    path, *, version=schema.SCHEMA, text="{}", stamps=(0, 1), values=((0.0, 0.0), (1.0, 1.0))
):
    """A file as a stranger might make it, past the recorder's own care."""
    stream = rr.RecordingStream("stranger", recording_id="x", send_properties=False)
    stream.save(path)
    stream.send_property(schema.PROPERTY, rr.AnyValues(schema=version, json=text))
    times = np.array(stamps, dtype=np.int64).astype("timedelta64[ns]")
    columns = rr.Scalars.columns(scalars=np.array(values))
    stream.send_columns("/gimbal/command", [rr.TimeColumn(schema.TIME, duration=times)], columns)
    stream.flush()
    stream.disconnect()
    return path


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({}, None),
        (
            {"version": "tvc-twin/recording/99"},
            "schema 'tvc-twin/recording/99'; this version reads",
        ),
        ({"text": "{"}, "not JSON"),
        ({"text": "[1]"}, "not a JSON object"),
        ({"text": "[" * 100_000}, "not JSON"),
        (
            {"values": ((0.0, 0.0), (np.nan, 0.0))},
            "gimbal/command is not a finite number at 1e-09 s",
        ),
        ({"values": ((0.0, 0.0), (np.inf, 0.0))}, "not a finite number"),
        ({"values": ((0.0, 0.0, 1.0), (1.0, 1.0, 1.0))}, r"6 values in 2 rows; 2 to a row"),
    ],
)
def test_impossible_content_is_refused_by_name(tmp_path, change, message):
    path = write(tmp_path / "made.rrd", **change)
    if message is None:
        assert recording.read(path)["gimbal/command"].values.shape == (2, 2)
        return
    with pytest.raises(RecordingError, match=message):
        recording.read(path)


def varint(number):
    low, rest = number & 0x7F, number >> 7
    return bytes([low | 0x80]) + varint(rest) if rest else bytes([low])


def text(value):
    return pa.array([[value]], pa.list_(pa.string()))


SOUND = {"schema": text(schema.SCHEMA), "json": text("{}")}
STAMPS, ROWS = pa.array([0, 1], pa.duration("ns")), pa.array([[0.0, 0.0]] * 2)
NAMES = ["time", "Scalars:scalars"]


def assembled(path, *chunks):
    """A file of chunks (entity, names, arrays) put together byte by byte, for what Rerun refuses
    to write: frames of kind, length, protobuf message as in `analysis.recording.rrd`."""

    def member(number, value):
        return varint(number << 3 | 2) + varint(len(value)) + value

    frames = [b"RRF2" + bytes(8)]
    for entity, names, arrays in chunks:
        fields = [pa.field(*pair) for pair in zip(names, (a.type for a in arrays), strict=True)]
        table = pa.schema(fields, {"rerun:entity_path": entity})
        stream = io.BytesIO()
        with pa.ipc.new_stream(stream, table) as writer:
            writer.write_batch(pa.RecordBatch.from_arrays(arrays, schema=table))
        message = member(1, varint(1 << 3) + varint(1)) + member(5, stream.getvalue())
        frames.append(struct.pack("<QQ", 2, len(message)) + message)
    path.write_bytes(b"".join(frames) + struct.pack("<QQ", 0, 0))
    return path


def properties(columns=SOUND):
    return (recording.PROPERTIES, list(columns), list(columns.values()))


def test_chunks_without_rows_are_passed_over(tmp_path):
    empty = [a[:0] for a in (STAMPS, ROWS)]
    path = assembled(
        tmp_path / "a.rrd",
        properties({name: column[:0] for name, column in SOUND.items()}),
        properties(),
        ("/gimbal/command", NAMES, empty),
        ("/gimbal/command", NAMES, [STAMPS, ROWS]),
        ("/gimbal/simulated", NAMES, empty),
        ("/events", ["time", "TextLog:text"], [STAMPS[:0], text("a")[:0]]),
    )
    run = recording.read(path)
    assert {name: len(series.time) for name, series in run.series.items()} == {"gimbal/command": 2}


@pytest.mark.parametrize(
    "chunk",
    [
        ("/gimbal/command", [*NAMES, "time"], [STAMPS, ROWS, STAMPS]),
        ("/gimbal/command", [*NAMES, "Scalars:scalars"], [STAMPS, ROWS, ROWS]),
        (recording.PROPERTIES, ["schema", "schema"], [text(schema.SCHEMA)] * 2),
    ],
)
def test_two_columns_of_one_name_are_refused(tmp_path, chunk):
    path = assembled(tmp_path / "a.rrd", properties(), chunk)
    with pytest.raises(RecordingError, match="two columns of one name"):
        recording.read(path)


def test_properties_that_are_no_text_are_no_properties(tmp_path):
    """A time of an invented zone, which Arrow cannot even turn into a Python object."""
    odd = pa.array([0], pa.timestamp("s", tz="Nowhere/Atall"))
    path = assembled(tmp_path / "a.rrd", properties({"schema": odd, "json": odd}))
    with pytest.raises(RecordingError, match="no recording of the twin"):
        recording.read(path)


def test_pieces_that_overlap_in_time_are_refused(tmp_path):
    stream = rr.RecordingStream("stranger", recording_id="x", send_properties=False)
    stream.save(tmp_path / "two.rrd")
    stream.send_property(schema.PROPERTY, rr.AnyValues(schema=schema.SCHEMA, json="{}"))
    for first in (0, 5):  # two runs in one: 0, 10 ns and 5, 15 ns
        times = np.array([first, first + 10]).astype("timedelta64[ns]")
        columns = rr.Scalars.columns(scalars=np.zeros((2, 2)))
        stream.send_columns("/gimbal/command", [rr.TimeColumn("time", duration=times)], columns)
    stream.disconnect()
    with pytest.raises(RecordingError, match="runs backwards from 1e-08 s to 5e-09 s"):
        recording.read(tmp_path / "two.rrd")


def test_another_programs_rerun_file_is_refused(tmp_path):
    stream = rr.RecordingStream("other", recording_id="x")
    stream.save(tmp_path / "other.rrd")
    stream.log("points", rr.Points3D([[0, 0, 0]]), static=True)
    stream.disconnect()
    with pytest.raises(RecordingError, match="no recording of the twin"):
        recording.read(tmp_path / "other.rrd")


@pytest.mark.parametrize(
    ("stamps", "values", "message"),
    [
        ([0.0, 1.0], [[1.0], [np.inf]], "infinite"),
        ([0.0, np.nan], [[1.0], [1.0]], "not a finite number"),
        ([1.0, 0.0], [[1.0], [1.0]], "backwards"),
        ([0.0, 1.0], [[1.0]], "do not fit"),
        ([0.0], [[1.0, 2.0]], "do not fit"),
    ],
)
def test_a_time_series_checks_itself(stamps, values, message):
    with pytest.raises(RecordingError, match=message):
        TimeSeries("a", np.array(stamps), np.array(values), "rad", ("x",))
