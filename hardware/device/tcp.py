"""A TCP port on loopback for one host at a time, which must prove that it has the session key."""

import contextlib
import hmac
import secrets
import socket
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from hardware import key as session
from hardware.device.inbox import Inbox
from hardware.device.ports import ServerError
from hardware.protocol import (
    DELIMITER,
    Challenge,
    Decoder,
    Disarm,
    Message,
    Proof,
    Refusal,
    Refused,
    Welcome,
    default_config,
    encode,
)

GREETING_NS = 2_000_000_000  # until a connection has proved that it has the key
IDLE_NS = 30_000_000_000  # a host sends PING five times a second
GUESTS = 8  # connections that have not proved it yet; the oldest makes room
LEFT = DELIMITER + encode(default_config(), 0) + encode(Disarm(), 1)
"""What a board receives when its host has left: settings as after boot, disarmed."""
_WAITING = 128  # connections that the system keeps until they are accepted
_CHUNK = 4096
_MOST_READS = 64  # of the socket in one call
_PROOF = encode(Proof((0,) * session.NONCE, (0,) * session.KEY), 0)
_BEGIN = _PROOF[:2]  # of every PROOF: type, stuffed, before the first zero


class _Guest:
    """A connection that has not proved yet that it has the key."""

    def __init__(self, line: socket.socket, now: int) -> None:
        self.line = line
        self.since = now
        self.challenge = secrets.token_bytes(session.NONCE)
        self.received = b""
        self.say(Challenge(tuple(self.challenge)))

    def say(self, message: Message) -> None:
        with contextlib.suppress(OSError):
            self.line.send(encode(message, 0))

    def listen(self, key: bytes) -> "str | Proof | None":
        """Return PROOF once it is there, the reason to end the connection, or None."""
        try:
            data = self.line.recv(len(_PROOF) - len(self.received))
        except BlockingIOError:
            return None
        except OSError:
            data = b""
        self.received += data
        if not data:
            return "closed without a greeting"
        if not self.received.startswith(_BEGIN[: len(self.received)]):
            return "no greeting"
        if len(self.received) < len(_PROOF):
            return None
        decoder = Decoder()
        decoder.receive_data(self.received)
        frame = decoder.next_event()
        if frame is None or not isinstance(frame.message, Proof):
            return "no greeting"
        wanted = session.proof(key, session.HOST, self.challenge, bytes(frame.message.nonce))
        right = hmac.compare_digest(wanted, bytes(frame.message.proof))
        return frame.message if right else "wrong key"


class TcpPort:
    """A listening socket on loopback for one host at a time, with a session key.

    A connection must send PROOF of the key first; all others are closed and counted. While a host
    is connected others are refused. A host that leaves is followed by `LEFT`.

    Parameters
    ----------
    port : 0 takes a free one
    key_file : key to use, written if missing; a new key in the user's session if omitted
    clock : monotonic nanoseconds

    Attributes
    ----------
    url : address for hosts
    key_file : file with the session key
    refused : number of connections that were closed, by reason

    Raises
    ------
    ServerError : the port is taken or forbidden
    KeyFileError : the key cannot be written or read
    """

    def __init__(
        self,
        port: int = 0,
        key_file: Path | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        if not 0 <= port <= 65535:
            raise ServerError(f"TCP port {port}: must be 0…65535")
        self.refused: Counter[str] = Counter()
        self._port = port
        self._clock = clock
        self._host: socket.socket | None = None
        self._heard_ns = 0
        self._left = False
        self._guests: list[_Guest] = []
        self._listener: socket.socket | None = None
        self._key = b""
        self.restore()
        try:
            self._own_key = key_file is None
            self.key_file = key_file or session.create(session.file_name(self._port))
            self._key = session.load_or_create(self.key_file)
        except session.KeyFileError:
            self.drop()
            raise

    def restore(self) -> None:
        """Listen, again on the same port number and with the same key."""
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", self._port))
        except OSError as error:
            listener.close()
            raise ServerError(
                f"cannot listen on 127.0.0.1:{self._port}: {error.strerror}"
            ) from None
        listener.listen(_WAITING)
        listener.setblocking(False)
        self._listener = listener
        self._port = listener.getsockname()[1]
        self.url = f"socket://127.0.0.1:{self._port}"
        if self._key and self._own_key:
            session.keep(self.key_file, self._key)

    def read(self) -> bytes:
        """Return what the host has sent, up to 256 KiB."""
        data = self._received() if self._host is not None else b""
        if self._left:
            self._left = False
            data += LEFT
        self._admit()  # after that, so that the next host may follow at once
        return data

    def _received(self) -> bytes:
        assert self._host is not None
        data = b""
        for _ in range(_MOST_READS):
            try:
                piece = self._host.recv(_CHUNK)
            except BlockingIOError:
                break
            except OSError:
                piece = b""
            if not piece:
                self._leave()
                return data
            data += piece
            if len(piece) < _CHUNK:
                break
        if data:
            self._heard_ns = self._clock()
        elif self._clock() - self._heard_ns > IDLE_NS:
            self.refused["silent for 30 s"] += 1
            self._leave()
        return data

    def _admit(self) -> None:
        """Accept connections, and process what those that wait have sent."""
        self._accept()
        for guest in list(self._guests):
            answer = guest.listen(self._key)
            if answer is None and self._clock() - guest.since > GREETING_NS:
                answer = "no greeting within 2 s"
            if isinstance(answer, Proof):
                self._welcome(guest, answer)
            elif answer is not None:
                if answer == "wrong key":
                    guest.say(Refused(Refusal.KEY))
                self._refuse(guest, answer)

    def _accept(self) -> None:
        for _ in range(GUESTS):
            if self._listener is None:
                return
            try:
                line, _ = self._listener.accept()
            except OSError:
                return
            line.setblocking(False)
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if len(self._guests) >= GUESTS:
                self._refuse(self._guests[0], "too many at once")
            self._guests.append(_Guest(line, self._clock()))

    def _welcome(self, guest: _Guest, answer: Proof) -> None:
        if self._host is not None:
            guest.say(Refused(Refusal.BUSY))
            self._refuse(guest, "in use")
            return
        nonce = bytes(answer.nonce)
        ours = session.proof(self._key, session.DEVICE, guest.challenge, nonce)
        guest.say(Welcome(tuple(ours)))
        self._guests.remove(guest)
        self._host, self._heard_ns = guest.line, self._clock()

    def _refuse(self, guest: _Guest, reason: str) -> None:
        self.refused[reason] += 1
        self._guests.remove(guest)
        guest.line.close()

    def write(self, data: bytes) -> None:
        """Send to the host."""
        if self._host is None:
            return
        try:
            self._host.send(data)
        except BlockingIOError:
            pass
        except OSError:
            self._leave()

    def drop(self) -> None:
        """Close all connections and refuse new ones."""
        self._leave()
        for guest in self._guests:
            guest.line.close()
        self._guests.clear()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def _leave(self) -> None:
        if self._host is not None:
            self._host.close()
            self._host, self._left = None, True

    def close(self) -> None:
        """Stop listening, and remove a key that was made for this port."""
        self.drop()
        if self._own_key:
            self.key_file.unlink(missing_ok=True)


def refusals(port: object, inbox: Inbox) -> str:
    """Return what a port has refused, and what its inbox has dropped, in one line; "" for nothing.

    Parameters
    ----------
    port : only a `TcpPort` refuses connections
    inbox : of the board behind it
    """
    closed = sorted(port.refused.items()) if isinstance(port, TcpPort) else []
    parts = []
    if closed:
        each = ", ".join(f"{count} {reason}" for reason, count in closed)
        parts.append(f"connections closed: {each}")
    if inbox.lost:
        parts.append(f"{inbox.lost} bytes dropped that came faster than the line carries")
    return "; ".join(parts)
