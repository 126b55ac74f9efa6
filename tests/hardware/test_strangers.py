"""Nobody but the owner of a TCP connection moves the servos, on every board that serves one."""

import base64
import http.server
import os
import shutil
import socket
import threading
import time
from contextlib import ExitStack

import pytest

from hardware import key as session
from hardware.device import tcp as tcp_module
from hardware.device.inbox import ROOM, Inbox
from hardware.emulator import Emulator
from hardware.link import Link, LinkError
from hardware.protocol import Arm, Config, HelloRequest, constants, default_config, encode
from hardware.rig import Rig, RigError, in_process
from hardware.simavr import nano as simavr
from tests import browser
from tests.hardware.strangers import (
    ATTACKS,
    BOARDS,
    FLOWN,
    NEUTRAL,
    STRANGE,
    Target,
    answer,
    drive,
    flight,
    hostile,
)

STRANGE_CONFIG = Config(10, 5, (3500,) * 3, (1000,) * 3, (5000,) * 3)


@pytest.fixture(autouse=True)
def _short_greeting(monkeypatch):
    monkeypatch.setattr(tcp_module, "GREETING_NS", 100_000_000)


@pytest.fixture(scope="module", params=BOARDS)
def target(request, tmp_path_factory):
    if request.param == "firmware" and simavr.missing():
        assert not os.environ.get("CI"), "the AVR tools are missing in CI"
        pytest.skip(f"the simulated Nano needs {simavr.PACKAGES}")
    board = Target(request.param, tmp_path_factory.mktemp("board"))
    yield board
    board.close()


@pytest.fixture(scope="module")
def emulator(tmp_path_factory):
    board = Target("emulator", tmp_path_factory.mktemp("board"))
    yield board
    board.close()


@pytest.mark.parametrize("attack", ATTACKS)
def test_a_stranger_neither_moves_a_pulse_nor_ends_a_flight(target, attack):
    with flight(target) as link:
        before = target.port.refused.total()
        attack(target)
        target.until(lambda: target.port.refused.total() > before)
        received = link.statistics.received
        target.until(lambda: link.statistics.received > received)
        assert link.statistics.gaps == ()
    assert target.pulses == {FLOWN}


def test_without_an_owner_a_stranger_moves_nothing_either(target):
    target.until(lambda: target.port._host is None and target.pulse() == NEUTRAL)
    target.pulses.clear()
    for attack in ATTACKS:
        attack(target)
    time.sleep(0.05)
    assert target.pulses == {NEUTRAL}


def test_a_newcomer_is_refused_in_one_line_and_the_owner_stays(target):
    with flight(target) as link:
        with pytest.raises(LinkError, match="in use by another program") as caught:
            Link(target.port.url)
        assert link.statistics.gaps == ()
    assert "\n" not in str(caught.value)
    assert target.pulses == {FLOWN}


def test_settings_and_arming_of_a_host_end_with_its_connection(target):
    target.until(lambda: target.port._host is None)
    with Link(target.port.url) as link:
        for message in (Arm(), STRANGE_CONFIG, drive(STRANGE)):
            link.send(message)
        target.until(lambda: target.pulse() == STRANGE)
    target.until(lambda: target.pulse() == NEUTRAL)
    target.pulses.clear()
    with Link(target.port.url) as link:
        rig = Rig(link, arm=False, fuse=False)
        hello = rig.connect()
    assert hello.neutral == NEUTRAL
    assert hello.dlpf == default_config().dlpf
    assert target.pulses == {NEUTRAL}


def test_settings_that_another_program_has_left_are_restored_at_connection():
    device = Emulator()
    device.device.config = STRANGE_CONFIG
    assert in_process(device, arm=False).connect().neutral == (3500,) * 3  # a watcher sets nothing
    hello = in_process(device).connect()
    assert device.device.config == default_config()
    assert (hello.neutral, hello.maximum) == (NEUTRAL, (constants.PULSE_MAXIMUM,) * 3)


def test_a_rig_that_keeps_its_settings_is_refused(monkeypatch):
    device = Emulator()
    device.device.config = STRANGE_CONFIG
    monkeypatch.setattr("hardware.device.device.plausible", lambda _: False)
    with pytest.raises(RigError, match="does not take this run's settings"):
        in_process(device).connect()


def test_a_flood_of_the_owner_is_dropped_and_ends_with_it(target):
    """Each drives for 2 s at most; the queue behind it adds 80 ms, not minutes."""
    target.until(lambda: target.port._host is None)
    lost = target.inbox.lost
    with Link(target.port.url) as link:
        link.send(Arm())
        target.until(lambda: not target.inbox._bytes)
        line = link._port._socket
        line.setblocking(True)
        burst = encode(drive(STRANGE), 0) * 5000
        end = time.monotonic() + 0.3
        while time.monotonic() < end:
            line.sendall(burst)
        assert len(target.inbox._bytes) <= ROOM
    target.until(lambda: target.port._host is None)
    target.until(lambda: target.pulse() == NEUTRAL, 1.5)  # before the last command ends
    assert target.inbox.lost > lost


def test_the_inbox_drops_whole_frames_and_keeps_the_newest():
    inbox, frame = Inbox(), encode(HelloRequest(), 0)
    inbox.add(frame * 1000 + encode(Arm(), 7))
    kept = inbox.take(10**9)
    assert ROOM - len(frame) < len(kept) <= ROOM
    assert kept.startswith(frame)
    assert kept.endswith(encode(Arm(), 7))
    assert inbox.lost == 1000 * len(frame) + len(encode(Arm(), 7)) - len(kept)


def test_an_idle_owner_loses_the_port(monkeypatch):
    now = [0]
    port = tcp_module.TcpPort(clock=lambda: now[0])
    with socket.create_connection(("127.0.0.1", port._port)) as line:
        _greet(port, line)
        now[0] += tcp_module.IDLE_NS + 1
        assert port.read() == tcp_module.LEFT
        assert port._host is None
    assert port.refused == {"silent for 30 s": 1}
    port.close()


def _greet(port, line):
    line.settimeout(5)
    while not port._guests:
        port.read()
    line.sendall(answer(port._guests[0].challenge, port._key))
    while port._host is None:
        port.read()


class TestKeyFile:
    """The file with the session key."""

    def test_only_the_user_can_read_it_and_it_goes_with_its_server(self, monkeypatch, tmp_path):
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
        port = tcp_module.TcpPort()
        assert port.key_file.parent == tmp_path / "tvc-twin"
        assert port.key_file.stat().st_mode & 0o777 == 0o600
        assert port.key_file.parent.stat().st_mode & 0o777 == 0o700
        assert session.find("127.0.0.1", port._port) == port.key_file
        assert session.find("192.0.2.1", port._port) is None
        port.close()
        assert not port.key_file.exists()

    def test_the_next_server_removes_the_key_of_one_that_was_killed(self, monkeypatch, tmp_path):
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
        port = tcp_module.TcpPort()
        with socket.socket() as probe:  # a free number
            probe.bind(("127.0.0.1", 0))
            killed = port.key_file.with_name(session.file_name(probe.getsockname()[1]))
        killed.write_bytes(port.key_file.read_bytes())
        other = killed.with_name("port-x.key")  # not of a server
        other.touch()
        second = tcp_module.TcpPort()
        left = set(killed.parent.iterdir())
        port.close()
        second.close()
        assert left == {port.key_file, second.key_file, other}

    def test_a_server_that_was_unplugged_writes_its_key_again(self, monkeypatch, tmp_path):
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
        first = tcp_module.TcpPort()
        kept = first.key_file.read_bytes()
        first.drop()
        second = tcp_module.TcpPort()
        assert not first.key_file.exists()
        first.restore()
        assert first.key_file.read_bytes() == kept
        assert first.key_file.stat().st_mode & 0o777 == 0o600
        first.close()
        second.close()
        assert not list(second.key_file.parent.iterdir())

    def test_without_a_run_time_folder_it_is_in_the_users_state(self, monkeypatch, tmp_path):
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "missing"))
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
        (tmp_path / "missing").write_text("a file, no folder can be made here")
        path = session.create("port-1.key")
        assert path == tmp_path / "tvc-twin" / "port-1.key"
        assert session.find("localhost", 1) == path

    def test_a_given_file_is_written_once_and_used_from_then_on(self, tmp_path):
        path = tmp_path / "keys" / "pi.key"
        assert session.load_or_create(path) == session.load_or_create(path)
        assert path.stat().st_mode & 0o777 == 0o600

    def test_of_two_servers_on_a_port_the_one_that_started_last_counts(self, monkeypatch, tmp_path):
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "a"))
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "b"))
        gateway = session.folders()[-1] / session.kept_name(5)
        kept = session.load_or_create(gateway)
        rig = session.create(session.file_name(5))
        os.utime(gateway, (1, 1))
        assert session.find("127.0.0.1", 5) == rig
        os.utime(rig, (2, 2))  # ended by SIGKILL, its file is still there
        assert session.load_or_create(gateway) == kept
        assert session.find("127.0.0.1", 5) == gateway

    @pytest.mark.parametrize(
        ("content", "mode", "message"),
        [
            (b"12" * 32, 0o644, "chmod 600"),
            (b"12" * 31, 0o600, "64 hexadecimal digits"),
            (b"\xff" * 64, 0o600, "64 hexadecimal digits"),
            (b"12" * 5000, 0o600, "64 hexadecimal digits"),
            (None, 0, "cannot be read"),
        ],
    )
    def test_a_file_that_is_no_key_is_refused_in_one_line(self, tmp_path, content, mode, message):
        path = tmp_path / "x.key"
        if content is not None:
            path.write_bytes(content)
            path.chmod(mode)
        with pytest.raises(session.KeyFileError, match=message) as caught:
            session.load(path)
        assert "\n" not in str(caught.value)

    def test_a_fifo_is_refused_and_not_waited_for(self, tmp_path):
        os.mkfifo(tmp_path / "x.key", 0o600)
        with pytest.raises(session.KeyFileError, match="not a session key"):
            session.load(tmp_path / "x.key")

    def test_a_client_without_the_key_is_given_the_remedy(self, emulator, monkeypatch, tmp_path):
        monkeypatch.setenv(session.VARIABLE, str(tmp_path / "other.key"))
        with pytest.raises(LinkError, match="cannot be read"):
            Link(emulator.port.url)
        session.load_or_create(tmp_path / "other.key")
        with pytest.raises(LinkError, match=r"another session key.*TVC_KEY_FILE"):
            Link(emulator.port.url)
        monkeypatch.setenv(session.VARIABLE, str(emulator.port.key_file))
        Link(emulator.port.url).close()

    def test_the_proof_is_the_published_hmac_and_each_ends_is_of_its_own(self):
        import hashlib

        key, a, b = bytes(range(32)), bytes(16), bytes([255] * 16)
        # RFC 2104 by hand
        padded = key.ljust(64, b"\0")
        inner = hashlib.sha256(bytes(x ^ 0x36 for x in padded) + b"tvc host" + a + b).digest()
        outer = hashlib.sha256(bytes(x ^ 0x5C for x in padded) + inner).digest()
        assert session.proof(key, session.HOST, a, b) == outer
        assert session.proof(key, session.DEVICE, a, b) != outer


class _Page(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b"<title>a page</title>")

    def log_message(self, *_):
        pass


_SCRIPT = """
(async () => {
  const bytes = Uint8Array.from(atob(CONTENT), c => c.charCodeAt(0));
  for (const port of PORTS) {
    await fetch(`http://127.0.0.1:${port}/`, {method: "POST", mode: "no-cors", body: bytes})
      .catch(() => 0);
    await new Promise(done => {
      const socket = new WebSocket(`ws://127.0.0.1:${port}/`);
      socket.onopen = () => { socket.send(bytes); done(); };
      socket.onerror = done;
    });
  }
  return "tried";
})()
"""


def test_a_page_in_a_real_browser_moves_nothing_on_any_board(tmp_path):
    if not any(map(shutil.which, browser.NAMES)):
        assert not os.environ.get("CI"), "chromium is missing in CI"
        pytest.skip("chromium is not installed")
    boards = [b for b in BOARDS if b != "firmware" or not simavr.missing()]
    with ExitStack() as stack:
        targets = []
        for board in boards:
            (tmp_path / board).mkdir()
            target = Target(board, tmp_path / board)
            stack.callback(target.close)
            targets.append(target)
        pages = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Page)
        threading.Thread(target=pages.serve_forever, daemon=True).start()
        stack.callback(pages.server_close)
        stack.callback(pages.shutdown)
        links = [stack.enter_context(flight(target)) for target in targets]
        page = stack.enter_context(
            browser.opened(f"http://127.0.0.1:{pages.server_port}/", (300, 200))
        )
        ports = [target.address[1] for target in targets]
        script = _SCRIPT.replace("CONTENT", repr(base64.b64encode(hostile()).decode()))
        done = page.send(
            "Runtime.evaluate",
            expression=script.replace("PORTS", repr(ports)),
            awaitPromise=True,
        )
        assert done["result"]["value"] == "tried"
        for target, link in zip(targets, links, strict=True):
            until = time.monotonic() + 10.0  # both have reached the port
            while target.port.refused["no greeting"] < 2 and time.monotonic() < until:
                time.sleep(0.01)
            assert target.port.refused["no greeting"] >= 2
            assert link.statistics.gaps == ()
            assert target.pulses == {FLOWN}
