"""The link over real ptys and sockets."""

import errno
import os
import select
import socket
import threading
import time
import tty
from pathlib import Path

import pytest
import serial

from hardware.frames import HardwareError
from hardware.link import Link, LinkError, session
from hardware.link import port as port_module
from hardware.link.link import RETRY_NS
from hardware.protocol import (
    Arm,
    Command,
    Decoder,
    Mode,
    Ping,
    Telemetry,
    encode,
)

posix = pytest.mark.skipif(os.name != "posix", reason="ptys exist on POSIX only")


class Clock:
    """A clock that the test advances [ns]."""

    def __init__(self) -> None:
        self.now = 0

    def __call__(self) -> int:
        return self.now


class Pty:
    """A device end of a pty behind a fixed name, as udev gives one to an adapter."""

    def __init__(self, name: Path) -> None:
        self.name = name
        self.plug()

    def plug(self) -> None:
        self.device, port = os.openpty()
        tty.setraw(port)
        self.name.symlink_to(os.ttyname(port))
        os.close(port)

    def pull(self) -> None:
        self.name.unlink()
        os.close(self.device)

    def read(self) -> bytes:
        return os.read(self.device, 65536)

    def write(self, data: bytes) -> None:
        os.write(self.device, data)


@pytest.fixture
def pty(tmp_path):
    device = Pty(tmp_path / "ttyNANO")
    yield device
    os.close(device.device)


def _poll(link: Link, count: int = 1, seconds: float = 2.0) -> list:
    frames, deadline = [], time.monotonic() + seconds
    while len(frames) < count and time.monotonic() < deadline:
        frames += link.poll()
    return frames


def _messages(data: bytes) -> list:
    decoder = Decoder()
    decoder.receive_data(data)
    return [frame.message for frame in decoder]


@posix
def test_messages_go_both_ways_over_a_pty(pty):
    with Link(str(pty.name)) as link:
        pty.write(encode(Ping(5), 3))
        assert [f.message for f in _poll(link)] == [Ping(5)]
        assert [link.send(Arm()), link.send(Ping(9))] == [0, 1]
        data = pty.read()
        while len(_messages(data)) < 2:  # a pty may give out one write at a time
            data += pty.read()
        # The delimiter first: it ends whatever the device had half received.
        assert data[:1] == b"\0"
        assert _messages(data) == [Arm(), Ping(9)]


@posix
@pytest.mark.realtime
def test_polling_an_idle_port_returns_at_once(pty):
    with Link(str(pty.name)) as link:
        start = time.perf_counter()
        for _ in range(100):
            assert link.poll() == []
        # 5 ms each would be a blocking read; a select and a read take some tens of µs.
        assert time.perf_counter() - start < 0.5


@posix
def test_an_idle_port_is_neither_read_nor_waited_for(pty, monkeypatch):
    # On a terminal both wait for a thread of the kernel, 18 ms at worst, see `Link.poll`.
    def refuse(*_):
        raise AssertionError

    with Link(str(pty.name)) as link:
        monkeypatch.setattr(link._port, "read", refuse)
        monkeypatch.setattr(select, "select", refuse)
        assert link.poll() == []
        assert link.send(Arm()) == 0


@posix
@pytest.mark.realtime
def test_a_message_that_a_full_line_took_in_part_is_completed_first(pty):
    os.set_blocking(pty.device, False)

    def taken() -> bytes:
        data, quiet = b"", time.monotonic()
        while time.monotonic() < quiet + 0.1:  # the kernel carries bytes over in its own time
            try:
                data += pty.read()
                quiet = time.monotonic()
            except BlockingIOError:
                time.sleep(0.001)
        return data

    with Link(str(pty.name)) as link:
        sent = 0
        while link.send(Ping(sent)) is not None:
            sent += 1
        data = taken()
        assert link.send(Arm()) is not None
        assert _messages(data + taken()) == [*map(Ping, range(sent)), Arm()]


@posix
def test_losses_and_errors_are_counted_over_all_connections(pty):
    clock = Clock()
    with Link(str(pty.name), clock=clock) as link:
        pty.write(encode(Ping(1), 1) + encode(Ping(2), 3))
        _poll(link, 2)
        pty.pull()
        link.poll()
        pty.plug()
        clock.now += RETRY_NS
        assert link.poll() == []
        broken = bytearray(encode(Ping(4), 8))
        broken[4] ^= 0x40
        pty.write(encode(Ping(3), 7) + bytes(broken) + encode(Ping(5), 9))
        _poll(link, 2)
        counted = link.statistics.decoder
        assert (counted.frames, counted.lost, counted.crc_errors) == (4, 2, 1)


@posix
def test_a_cable_pulled_and_put_back_three_times_is_three_gaps_and_no_error(pty):
    clock = Clock()
    with Link(str(pty.name), clock=clock) as link:
        for turn in range(3):
            assert link.connected
            assert link.generation == turn + 1
            pty.pull()
            clock.now += 1_000
            pulled_ns = clock.now
            assert link.poll() == []
            assert not link.connected
            assert link.send(Command((3000, 3000, 0), 100, Mode.DRIVE)) is None
            clock.now += RETRY_NS
            assert link.poll() == []  # still away
            pty.plug()
            assert link.poll() == []  # tries are 0.2 s apart
            assert not link.connected
            clock.now += RETRY_NS
            link.poll()
            assert link.connected
            gap = link.statistics.gaps[-1]
            assert (gap.start_ns, gap.end_ns) == (pulled_ns, clock.now)
            pty.write(encode(Ping(turn), 0))
            assert [f.message for f in _poll(link)] == [Ping(turn)]
        assert len(link.statistics.gaps) == 3
        assert link.statistics.refused == 3


@posix
def test_a_closed_link_stays_closed(pty):
    clock = Clock()
    link = Link(str(pty.name), clock=clock)
    link.close()
    link.close()
    clock.now += 10 * RETRY_NS
    assert link.poll() == []
    assert link.send(Arm()) is None
    assert not link.connected


@posix
@pytest.mark.realtime
def test_a_device_that_never_reads_refuses_messages_and_does_not_hang(pty):
    with Link(str(pty.name)) as link:
        deadline = time.monotonic() + 5
        while link.send(Command((3000, 3000, 0), 100, Mode.DRIVE)) is not None:
            assert time.monotonic() < deadline
        assert link.connected
        assert link.statistics.refused >= 1
        start = time.monotonic()
        link.send(Ping(0))
        # 2 ms is its own limit; the rest is for a busy machine.
        assert time.monotonic() - start < 0.2


@posix
def test_a_port_that_is_not_there_is_told_with_those_that_are(tmp_path):
    with pytest.raises(LinkError, match=r"ttyUSB9: no such port; must be one of: "):
        Link(str(tmp_path / "ttyUSB9"))


@posix
def test_a_port_held_by_another_is_told_as_busy(pty):
    with Link(str(pty.name)), pytest.raises(LinkError, match="in use by another program"):
        Link(str(pty.name))


@posix
def test_a_file_is_told_to_be_no_serial_port(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("hello")
    with pytest.raises(LinkError, match="not a serial port; must"):
        Link(str(path))


@posix
@pytest.mark.parametrize("found", [{"/dev/ttyS0": ""}, {}, {"/dev/ttyS0": "", "/dev/ttyUSB1": ""}])
def test_ports_without_any_usb_adapter_are_told_as_that(monkeypatch, found):
    monkeypatch.setattr(port_module, "available", lambda: found)
    with pytest.raises(LinkError, match="no such port") as refusal:
        Link("/dev/ttyUSB9")
    assert ("no USB adapter found" in str(refusal.value)) == ("/dev/ttyUSB1" not in found)


def test_a_forbidden_port_is_told_with_the_group_to_join(monkeypatch):
    # Root may open anything, so the operating system's answer is played.
    def refuse(*_args, **_settings):
        raise serial.SerialException(errno.EACCES, "could not open port: Permission denied")

    monkeypatch.setattr(port_module.serial, "serial_for_url", refuse)
    with pytest.raises(LinkError, match="usermod -aG dialout"):
        Link("/dev/ttyUSB0")


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("nonsense://x", "protocol 'nonsense' not known"),
        ("socket://127.0.0.1", "must be socket://HOST:PORT"),
        ("socket://", "must be socket://HOST:PORT"),
        ("socket://:5555", "must be socket://HOST:PORT"),
        ("socket://127.0.0.1:0", "port from 1 to 65535"),
        ("socket://127.0.0.1:x", "port from 1 to 65535"),
        ("socket://127.0.0.1:99999", "port from 1 to 65535"),
        ("socket://127.0.0.1:9?logging=debug", "must be socket://HOST:PORT"),
    ],
)
def test_a_bad_url_is_reported_with_examples_in_one_line(url, message):
    with pytest.raises(LinkError, match=message) as caught:
        Link(url)
    assert "socket://127.0.0.1:5555" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, HardwareError)


@pytest.fixture
def server(monkeypatch):
    # it asks for no session key, which a link else waits a second for
    monkeypatch.setattr(session, "GREETING_NS", 20_000_000)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener


def _url(listener: socket.socket) -> str:
    return f"socket://127.0.0.1:{listener.getsockname()[1]}"


def test_an_address_without_a_listener_is_reported_with_the_command_to_start():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        url = _url(listener)
    with pytest.raises(LinkError, match="twin rig"):
        Link(url)


def test_a_connection_that_closes_at_once_is_a_tunnel_without_a_gateway(server):
    def close():
        server.accept()[0].close()

    threading.Thread(target=close).start()
    with pytest.raises(LinkError, match="tunnel without a gateway behind it") as caught:
        Link(_url(server))
    assert "\n" not in str(caught.value)


@pytest.mark.realtime
def test_messages_go_both_ways_over_a_socket(server):
    with Link(_url(server)) as link:
        peer, _ = server.accept()
        with peer:
            peer.sendall(encode(Ping(5), 3))
            assert [f.message for f in _poll(link)] == [Ping(5)]
            link.send(Arm())
            time.sleep(0.05)
            assert _messages(peer.recv(4096)) == [Arm()]


def test_small_messages_over_a_socket_are_not_held_back(server):
    with Link(_url(server)) as link:
        peer, _ = server.accept()
        with peer:
            raw = link._port._socket
            assert raw.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_a_server_that_goes_and_comes_back_is_a_gap(server):
    clock = Clock()
    with Link(_url(server), clock=clock) as link:
        peer, _ = server.accept()
        peer.close()
        deadline = time.monotonic() + 2
        while link.connected and time.monotonic() < deadline:
            link.poll()
        assert not link.connected
        clock.now += RETRY_NS
        link.poll()
        peer, _ = server.accept()
        with peer:
            peer.sendall(encode(Ping(6), 0))
            assert [f.message for f in _poll(link)] == [Ping(6)]
            assert link.connected


@posix
@pytest.mark.realtime
def test_a_500_hz_stream_arrives_whole(pty):
    blank = Telemetry(
        *(0, 0, (0,) * 4, *[(0,) * 3] * 4, (0, 0), (3000,) * 3, 0, (0, 0), 0, 0, 0, 0, 0, 0)
    )

    def stream() -> None:
        for sequence in range(250):
            pty.write(encode(blank, sequence))
            time.sleep(0.002)

    with Link(str(pty.name)) as link:
        source = threading.Thread(target=stream)
        source.start()
        frames = _poll(link, 250, seconds=5)
        source.join()
        assert [f.sequence for f in frames] == list(range(250))
        assert link.statistics.decoder.lost == 0


def test_of_a_flood_only_the_newest_frames_are_processed_and_no_loss_is_counted(server):
    count = 60_000
    with Link(_url(server)) as link:
        peer, _ = server.accept()
        sender = threading.Thread(
            target=peer.sendall, args=(b"".join(encode(Ping(k), k & 0xFFFF) for k in range(count)),)
        )
        sender.start()
        newest, polls, processed = 0, 0, 0
        while newest < count - 1:
            if frames := link.poll():
                polls, processed = polls + 1, processed + len(frames)
                newest = frames[-1].message.host_ns
        sender.join()
        peer.close()
        counted = link.statistics
    assert counted.dropped > counted.received / 2
    assert (counted.decoder.lost, counted.decoder.crc_errors) == (0, 0)
    assert processed <= polls * 1024 // len(encode(Ping(0), 1)) + polls


@pytest.mark.realtime
def test_a_lost_socket_is_closed_without_holding_up_the_loop(server):
    link = Link(_url(server))
    began = time.monotonic()
    link.close()
    # pyserial's own close sleeps 0.3 s; ten times less is still a hundred times what is needed
    assert time.monotonic() - began < 0.03
