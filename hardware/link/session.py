"""The host's end of the greeting on TCP: proves that it has the session key of the server."""

import hmac
import secrets
from urllib.parse import urlsplit

from hardware import key as session
from hardware.link.port import LinkError
from hardware.protocol import (
    Challenge,
    Message,
    Proof,
    Refusal,
    Refused,
    Unknown,
    Welcome,
    encode,
)

GREETING_NS = 1_000_000_000  # a server that has not sent CHALLENGE by then asks for no key


class Greeting:
    """One greeting; pass in what arrives, send what `answer` returns, until `done`.

    A line without CHALLENGE, such as a serial port behind a TCP bridge, needs none.

    Parameters
    ----------
    url : of a socket
    now : time of the connection [ns]

    Attributes
    ----------
    done : frames of the board follow
    begun : CHALLENGE has arrived
    """

    def __init__(self, url: str, now: int) -> None:
        self.url = url
        self.done = self.begun = False
        self._end = now + GREETING_NS
        self._wanted = b""

    def wait(self, now: int) -> None:
        """Pass time: a server that has asked for no key is one without.

        Raises
        ------
        LinkError : it asked, and does not answer
        """
        if now < self._end or self.done:
            return
        if self.begun:
            raise LinkError(f"{self.url}: the server does not answer the session key")
        self.done = True

    def answer(self, message: Message | Unknown) -> bytes:
        """Return what to send after a message from the server.

        Raises
        ------
        LinkError : the server refuses, or one of both lacks the key
        """
        match message:
            case Challenge(nonce):
                return self._prove(bytes(nonce))
            case Welcome(proof):
                if not self.begun or not hmac.compare_digest(bytes(proof), self._wanted):
                    raise LinkError(f"{self.url}: the server does not have its own session key")
                self.done = True
            case Refused(Refusal.BUSY):
                raise LinkError(f"{self.url}: in use by another program; close that program")
            case Refused():
                raise LinkError(f"{self.url}: the server has another session key; {self._remedy()}")
            case _:
                self.done = not self.begun
        return b""

    def _prove(self, challenge: bytes) -> bytes:
        self.begun = True
        address = urlsplit(self.url)
        path = session.find(address.hostname or "", address.port or 0)
        if path is None:
            raise LinkError(f"{self.url}: the server asks for its session key; {self._remedy()}")
        try:
            key = session.load(path)
        except session.KeyFileError as error:
            raise LinkError(f"{self.url}: {error}") from None
        nonce = secrets.token_bytes(session.NONCE)
        self._wanted = session.proof(key, session.DEVICE, challenge, nonce)
        ours = session.proof(key, session.HOST, challenge, nonce)
        return encode(Proof(tuple(nonce), tuple(ours)), 0)

    def _remedy(self) -> str:
        return f"set {session.VARIABLE} to the key file that it printed, or to a copy of it"
