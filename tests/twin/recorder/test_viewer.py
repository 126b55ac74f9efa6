"""What a person sees: real pictures of recordings, in the native and in the web viewer."""

import io
import os
import shutil
import socket
import urllib.error
import urllib.request
from pathlib import Path

import mujoco
import numpy as np
import psutil
import pytest
from PIL import Image

from analysis.recording import reader as recording
from tests import browser, headless
from tests.twin.recorder import runs
from twin import viewer
from twin.recorder import Recorder, style
from twin.viewer import opening, process

pytestmark = pytest.mark.looks
SIZE = (1000, 620)  # a small window


def needed(found: bool, what: str) -> None:
    """Skip without the tool, but never where green must mean seen."""
    if not found:
        message = f"needs {what} (`bash .ci/test-tools` installs it)"
        pytest.fail(message) if os.environ.get("CI") else pytest.skip(message)


@pytest.fixture(scope="session")
def vulkan():
    folders = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
    needed(any(any(f.glob("*.json")) for f in folders if f.is_dir()), "mesa-vulkan-drivers")


@pytest.fixture(scope="session")
def chromium():
    needed(any(map(shutil.which, browser.NAMES)), "chromium")


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    path = tmp_path_factory.mktemp("viewer") / "flight.rrd"
    runs.fly(path, 12.0)
    return path


def scene(picture: Path) -> np.ndarray:
    """Pixels (h, w, 3) of the view of the vehicle: upper left, beside that of the gimbal."""
    image = Image.open(io.BytesIO(picture.read_bytes())).convert("RGB")
    width, height = image.size
    return np.asarray(image.crop((0, 66, round(0.222 * width), round(0.46 * height))), dtype=float)


def vehicle(pixels: np.ndarray) -> np.ndarray:
    """Mask of the vehicle's red: shading changes brightness, not hue."""
    red, green, blue = np.moveaxis(pixels, -1, 0)
    return (red > 60) & (red > 2.5 * green) & (red > 2.5 * blue)


def assert_in_frame(picture: Path) -> None:
    mask = vehicle(scene(picture))
    rows, columns = np.nonzero(mask)
    height, width = mask.shape
    assert len(rows) > 100, f"{picture.name}: {len(rows)} pixels of the vehicle"
    # whole, not cut off: the edge of the view is free of it
    assert 0 < rows.min() < rows.max() < height - 1, picture.name
    assert 0 < columns.min() < columns.max() < width - 1, picture.name
    # large enough to see how it points, small enough to see where
    assert 0.25 < np.hypot(np.ptp(rows), np.ptp(columns)) / height < 0.9, picture.name


@pytest.fixture(scope="module")
def seen(flight, tmp_path_factory, vulkan):
    """The flight in the native viewer at 0, 5 and 11.9 s, and again at 5 s, between two rows."""
    times = [0.0, 5.0, 11.9, 5.001]
    return headless.screenshot(flight, times, tmp_path_factory.mktemp("seen"), SIZE)


@pytest.mark.thorough
def test_the_native_viewer_shows_the_vehicle_at_three_times(seen):
    assert seen.reports == ()
    assert seen.complaints == ()
    for picture in seen.pictures:
        assert Image.open(picture).size == SIZE
        assert_in_frame(picture)


def test_the_picture_changes_with_time_and_repeats_itself(seen):
    _, early, late, again = map(scene, seen.pictures)
    assert np.abs(late - early).mean() > 0.5
    assert np.array_equal(early, again)


def test_without_the_vehicle_there_is_nothing_red(tmp_path, vulkan):
    """The counter-test: the mask finds the vehicle and nothing else."""
    ground = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="0 0 1" rgba="0.35 0.42 0.33 1"/>'
        '<body name="other"><freejoint/><geom size="0.3" rgba="0.2 0.2 0.9 1"/></body>'
        "</worldbody></mujoco>"
    )
    data = mujoco.MjData(ground)
    mujoco.mj_forward(ground, data)
    path = tmp_path / "empty.rrd"
    with Recorder(path, signals=["gimbal/command"], properties={}, model=ground) as recorder:
        for tick in range(100):
            recorder.row[:] = 0.0
            recorder.commit(tick * runs.PERIOD_NS, tick)
            recorder.commit_pose(tick * runs.PERIOD_NS, data)
    look = headless.screenshot(path, [0.2], tmp_path, SIZE)
    assert look.reports == ()
    assert not vehicle(scene(look.pictures[0])).any()


@pytest.mark.thorough
def test_every_signal_has_a_view_that_reports_nothing(tmp_path, vulkan):
    from analysis import schema

    path = tmp_path / "all.rrd"
    with Recorder(path, signals=list(schema.SIGNALS), properties={}) as recorder:
        for tick in range(500):
            recorder.row[:] = np.sin(tick * 0.02)
            recorder.commit(tick * runs.PERIOD_NS, tick)
        recorder.health(0, "potentiometer x_a: stuck")
    look = headless.screenshot(path, [1.0], tmp_path, SIZE)
    assert look.reports == ()
    assert look.complaints == ()


@pytest.mark.thorough
def test_the_web_viewer_shows_the_recorded_lines(tmp_path, chromium):
    """At the address that a person types; without a 3D scene, whose first picture takes long."""
    path = tmp_path / "lines.rrd"
    with Recorder(path, signals=["gimbal/measured"], properties={}) as recorder:
        for tick in range(500):
            recorder.row[:] = np.radians(5.0) * np.sin(tick * 0.02)
            recorder.commit(tick * runs.PERIOD_NS, tick)

    def line(picture: bytes) -> np.ndarray:
        pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=float)
        # below the header, which has a warning about the renderer in a similar colour
        return np.abs(pixels[50:] - style.MEASURED).max(axis=2) < 25.0

    def across(picture: bytes) -> bool:
        return np.count_nonzero(line(picture).any(axis=0)) > 60

    with viewer.serve_web(path) as url, browser.opened(url, (320, 240)) as page:
        picture = browser.shows(page, across)
    assert across(picture)
    assert not line(picture)[:, :140].any()  # the events, on the left
    assert [c for c in page.complaints if not any(h in c for h in headless.HARMLESS)] == []


@pytest.mark.slow
def test_the_web_viewer_shows_the_vehicle(flight, tmp_path, chromium):
    look = headless.web_screenshot(flight, [0.5], tmp_path, (640, 400))
    assert look.complaints == ()
    for picture in look.pictures:
        assert_in_frame(picture)


@pytest.mark.thorough
def test_a_flown_flight_is_in_frame_and_reports_nothing(tmp_path, vulkan):
    from twin.config import Fly
    from twin.experiments.flight.fly import fly

    path = tmp_path / "flown.rrd"
    fly(Fly(duration_s=3.0, out=path))
    look = headless.screenshot(path, [0.0, 1.5, 2.9], tmp_path, SIZE)
    assert look.reports == ()
    assert look.complaints == ()
    for picture in look.pictures:
        # the tube is light grey, nose and fins red: the red parts span the vehicle
        rows, columns = np.nonzero(vehicle(scene(picture)))
        height, width = scene(picture).shape[:2]
        assert len(rows) > 50, picture.name
        assert 0 < rows.min() < rows.max() < height - 1
        assert 0 < columns.min() < columns.max() < width - 1


def listening() -> set[tuple[str, int]]:
    """Addresses on which this process and its children listen."""
    me = psutil.Process()
    found = [c for p in (me, *me.children(recursive=True)) for c in p.net_connections("inet")]
    return {(c.laddr.ip, c.laddr.port) for c in found if c.status == psutil.CONN_LISTEN}


def test_a_recording_is_served_on_one_port_of_loopback_alone(flight):
    before = listening()
    with viewer.serve_web(flight) as url:
        port = int(url.rstrip("/").rsplit(":", 1)[1])
        assert listening() - before == {("127.0.0.1", port)}
        with urllib.request.urlopen(f"{url}recording.rrd") as answer:
            assert answer.read() == flight.read_bytes()
        with urllib.request.urlopen(url) as answer:  # what a person types
            page = answer.read().decode()
            policy = answer.headers["Content-Security-Policy"]
        assert "recording.rrd" in page[: page.index("<link")]
        assert "'self'" in policy
        assert "http" not in policy
        for missing in ("../../etc/passwd", "%2e%2e/flight.rrd", "signed-in"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(url + missing)
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", port)) != 0, "the server outlives its block"


def test_without_a_display_the_browser_is_named(flight, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(viewer.ViewerError, match=r"no display: give --web"):
        viewer.view(flight)


@pytest.mark.parametrize("name", ["cut.rrd", "cut.rrd.partial"])
def test_a_file_cut_off_is_repaired_beside_the_original(flight, tmp_path, name):
    content = flight.read_bytes()
    broken = tmp_path / name
    broken.write_bytes(content[: int(0.6 * len(content))])
    mended = viewer.repaired(broken)
    assert mended == tmp_path / "cut.repaired.rrd"
    kept = recording.read(mended)
    whole = recording.read(flight)["gimbal/command"]
    n = len(kept["gimbal/command"].time)
    assert 0.4 * len(whole.time) < n < len(whole.time)
    assert np.array_equal(kept["gimbal/command"].values, whole.values[:n])
    assert broken.read_bytes() == content[: int(0.6 * len(content))]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([name, "cut.repaired.rrd"])


def test_the_empty_file_of_a_run_killed_at_its_start_is_named_so(tmp_path):
    path = tmp_path / "a.rrd.partial"
    path.touch()
    with pytest.raises(viewer.ViewerError, match="empty; its run was killed before"):
        viewer.repaired(path)


@pytest.mark.parametrize("content", [b"", b"hello", b"RRF2", b"RRF2" + bytes(100)])
def test_what_is_no_recording_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "bad.rrd"
    path.write_bytes(content)
    with pytest.raises(viewer.ViewerError) as caught:
        viewer.repaired(path)
    assert "\n" not in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["bad.rrd"]


@pytest.mark.parametrize("port", [-1, 65536, 10**9])
def test_a_port_that_is_none_is_refused_in_one_line(flight, port):
    with pytest.raises(viewer.ViewerError, match=f"port {port}: must be 1 to 65535"):
        viewer.view(flight, web=True, port=port)


def test_a_taken_port_is_refused_in_one_line(flight):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(viewer.ViewerError, match=f"cannot serve on port {port}: Address"):
            viewer.view(flight, web=True, port=port)


def test_a_cut_recording_where_nothing_may_be_written_is_refused_in_one_line(
    flight, tmp_path, monkeypatch
):
    def refuse(**_):
        raise PermissionError(13, "Permission denied")  # tests may run as root, whom no mode stops

    broken = tmp_path / "cut.rrd"
    broken.write_bytes(flight.read_bytes()[:-5000])
    monkeypatch.setattr(opening.tempfile, "TemporaryDirectory", refuse)
    with pytest.raises(
        viewer.ViewerError, match=r"cut\.repaired\.rrd cannot be written: Permission"
    ):
        viewer.repaired(broken)


def test_the_viewers_exit_status_is_passed_on(flight, tmp_path, monkeypatch):
    program = tmp_path / "rerun"
    program.write_text('#!/bin/sh\n[ "$1" = rrd ] && exit 0\nexit 7\n')
    program.chmod(0o755)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(opening, "binary", lambda: program)
    assert viewer.view(flight) == 7


def test_a_missing_recording_is_refused_in_one_line(tmp_path):
    with pytest.raises(viewer.ViewerError, match="No such file"):
        viewer.view(tmp_path / "nothing.rrd")
    assert process.binary().is_file()
