"""Hostile connections to a rig's TCP port, and three boards behind one in this process."""

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from hardware import key as session
from hardware.device import Inbox, Server, TcpPort
from hardware.device import tcp as tcp_module
from hardware.emulator import Emulator
from hardware.link import Link
from hardware.protocol import (
    Arm,
    Challenge,
    Command,
    Config,
    Decoder,
    Encoder,
    Mode,
    Proof,
    constants,
    encode,
)
from hardware.raspberry_pi.gateway import Gateway
from hardware.raspberry_pi.pwm import KernelPwm, find_chip
from tests.hardware.fake_pi import FakeBus, make_sysfs

NEUTRAL = (constants.PULSE_NEUTRAL,) * 3
FLOWN = (3200, 2800, 3000)
STRANGE = (3900, 3900, 3900)
BOARDS = ("emulator", "firmware", "raspberry-pi")


def drive(pulse: tuple[int, int, int]) -> Command:
    """A command that survives a test machine's pauses."""
    return Command(pulse, 2000, Mode.DRIVE)


def hostile() -> bytes:
    """Frames that would arm a board, move its servos and change its settings."""
    encoder = Encoder()
    limits = ((3500,) * 3, (1000,) * 3, (5000,) * 3)
    messages = (Arm(), Config(2, 2, *limits), drive(STRANGE))
    return b"\0" + b"".join(encoder.encode(m) for m in messages)


class Target:
    """A board behind a TCP port in a thread, and every pulse it has put out."""

    def __init__(self, board: str, folder: Path) -> None:
        self.port = TcpPort()
        self.pulses: set[tuple[int, ...]] = set()
        self._open = True
        if board == "raspberry-pi":
            self._pi(folder)
        else:
            self._stepped(board)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _stepped(self, board: str) -> None:
        if board == "firmware":
            from hardware.emulator.nano import FirmwareRig

            rig = FirmwareRig()
            pulse = lambda: tuple(rig._ticks)  # noqa: E731
        else:
            rig = Emulator()
            pulse = lambda: rig._latched  # noqa: E731
        server = Server(rig, self.port)
        self.inbox: Inbox = server.inbox
        self._step, self.pulse, self._release = server.tick, pulse, rig.close

    def _pi(self, folder: Path) -> None:
        gateway = Gateway(KernelPwm(find_chip(make_sysfs(folder))), FakeBus(), self.port)
        self.inbox = gateway.inbox
        self._step, self.pulse = gateway.step, lambda: gateway.device.pulse
        self._release = lambda: None

    def _serve(self) -> None:
        due = time.monotonic()
        while self._open:
            self._step()
            self.pulses.add(self.pulse())
            due = max(due + 1e-3, time.monotonic() - 0.05)
            time.sleep(max(0.0, due - time.monotonic()))

    def close(self) -> None:
        self._open = False
        self._thread.join(10)
        self.port.close()
        self._release()

    @property
    def address(self) -> tuple[str, int]:
        return "127.0.0.1", int(self.port.url.rpartition(":")[2])

    def until(self, condition, seconds: float = 20.0) -> None:
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end
            time.sleep(1e-3)


@contextlib.contextmanager
def flight(target: Target) -> Iterator[Link]:
    """An owner that drives the servos away from neutral; only its pulses may follow."""
    target.until(lambda: target.port._host is None and target.pulse() == NEUTRAL)
    with Link(target.port.url) as link:
        link.send(Arm())
        link.send(drive(FLOWN))
        target.until(lambda: target.pulse() == FLOWN)
        target.pulses.clear()
        running = threading.Event()

        def fly() -> None:
            while not running.wait(0.01):
                link.poll()
                link.send(drive(FLOWN))

        thread = threading.Thread(target=fly)
        thread.start()
        try:
            yield link
        finally:
            running.set()
            thread.join()


def _connect(target: Target) -> socket.socket:
    line = socket.create_connection(target.address, timeout=10)
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return line


def _until_closed(line: socket.socket) -> bytes:
    """What came before the server closed the connection."""
    data = b""
    with contextlib.suppress(ConnectionError):
        while piece := line.recv(4096):
            data += piece
    line.close()
    return data


def post(target: Target) -> None:
    """A web page's form, with frames as its content."""
    body = hostile()
    head = f"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: {len(body)}\r\n\r\n"
    with _connect(target) as line:
        line.sendall(head.encode() + body)
        _until_closed(line)


def upgrade(target: Target) -> None:
    """The beginning of a WebSocket."""
    with _connect(target) as line:
        line.sendall(b"GET / HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\r\n")
        _until_closed(line)


def scan(target: Target) -> None:
    """A port scan: half of the connections are closed, half reset."""
    for k in range(10):
        line = _connect(target)
        if k % 2:
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        line.close()


def keyless(target: Target) -> None:
    """A client of before there was a key."""
    with _connect(target) as line:
        line.sendall(hostile())
        _until_closed(line)


def flood(target: Target) -> None:
    """Half a megabyte of commands without a key."""
    with _connect(target) as line, contextlib.suppress(ConnectionError):
        for _ in range(100):
            line.sendall(hostile() * 100)


def half_open(target: Target) -> None:
    """More connections than there is room for, with half a greeting each."""
    lines = [_connect(target) for _ in range(tcp_module.GUESTS + 4)]
    for line in lines:
        with contextlib.suppress(ConnectionError):
            line.sendall(tcp_module._BEGIN)
    for line in lines:
        _until_closed(line)


def answer(challenge: bytes, key: bytes) -> bytes:
    """PROOF of a key."""
    nonce = bytes(range(session.NONCE))
    proof = session.proof(key, session.HOST, challenge, nonce)
    return encode(Proof(tuple(nonce), tuple(proof)), 0)


def replayed(target: Target) -> None:
    """The bytes of an earlier session of the owner, which answered another challenge."""
    key = session.load(target.port.key_file)
    with _connect(target) as line:
        line.sendall(answer(bytes(session.NONCE), key) + hostile())
        _until_closed(line)


def wrong_key(target: Target) -> None:
    """The right answer by another key."""
    with _connect(target) as line:
        decoder = Decoder()
        while (frame := decoder.next_event()) is None:
            decoder.receive_data(line.recv(64))
        assert isinstance(frame.message, Challenge)
        line.sendall(answer(bytes(frame.message.nonce), bytes(session.KEY)) + hostile())
        _until_closed(line)


ATTACKS = (post, upgrade, scan, keyless, flood, half_open, replayed, wrong_key)
