"""Session key of a rig on TCP: its file, and the proof that the other end has read it.

The proof is an HMAC (RFC 2104) over a random number of each end, so that a recorded conversation
is useless in the next one.
"""

import contextlib
import hmac
import os
import secrets
import socket
import stat
from pathlib import Path

from hardware.frames import HardwareError

VARIABLE = "TVC_KEY_FILE"  # names a key file for clients and servers
NONCE = 16  # bytes
KEY = 32  # bytes, in the file as hexadecimal digits
HOST, DEVICE = b"tvc host", b"tvc device"  # keep one end's proof from serving as the other's
_LONGEST = 1024  # bytes of a key file that are read
_LOCAL = ("127.0.0.1", "localhost")


class KeyFileError(HardwareError):
    """A key file cannot be used; the message is one line with the remedy."""


def proof(key: bytes, side: bytes, challenge: bytes, nonce: bytes) -> bytes:
    """Return the 32 bytes with which one end shows that it has the key.

    Parameters
    ----------
    key : of the server
    side : `HOST` or `DEVICE`, the end that proves
    challenge, nonce : random numbers of the device and of the host, (16,) each
    """
    return hmac.digest(key, side + challenge + nonce, "sha256")


def folders() -> list[Path]:
    """Folders for key files: of the user's session where there is one, and of the user."""
    session = os.environ.get("XDG_RUNTIME_DIR")
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    bases = [Path(session)] if session else []
    return [base / "tvc-twin" for base in [*bases, Path(state)]]


def configured() -> Path | None:
    """Return the key file that the environment names, if any."""
    name = os.environ.get(VARIABLE)
    return Path(name) if name else None


def create(name: str) -> Path:
    """Write a new key to a file that only the user can read, and return its path.

    Files of servers that were killed are removed.

    Parameters
    ----------
    name : of the file, in the first of `folders` that can be written

    Raises
    ------
    KeyFileError : there is none
    """
    error: OSError | None = None
    for folder in folders():
        try:
            _make_private(folder)
            path = folder / name
            path.unlink(missing_ok=True)
            _remove_stale(folder)
            _write(path)
        except OSError as caught:
            error = caught
            continue
        return path
    assert error is not None
    raise KeyFileError(
        f"no place for the session key ({error}); set XDG_STATE_HOME to a folder that only you"
        " can write"
    )


def keep(path: Path, key: bytes) -> None:
    """Write the key of a running server again where its file is gone.

    Another server removes it that starts while the first one's port is closed.

    Raises
    ------
    KeyFileError : it cannot be written
    """
    try:
        _make_private(path.parent)
        if not path.exists():
            _write(path, key)
    except OSError as error:
        raise KeyFileError(f"{path}: the session key cannot be written ({error})") from None


def load_or_create(path: Path) -> bytes:
    """Return the key in a file, which is written if it does not exist and then kept.

    Raises
    ------
    KeyFileError : it cannot be written or used
    """
    if not path.exists():
        try:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            _write(path)
        except OSError as error:
            raise KeyFileError(f"{path}: no session key can be written ({error})") from None
    with contextlib.suppress(OSError):
        os.utime(path)  # the newest counts, see `find`
    return load(path)


def load(path: Path) -> bytes:
    """Return the key in a file.

    Raises
    ------
    KeyFileError : missing, readable by others, or not a key
    """
    try:
        file = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        try:
            status = os.fstat(file)
            text = os.read(file, _LONGEST) if stat.S_ISREG(status.st_mode) else b""
        finally:
            os.close(file)
        key = bytes.fromhex(text.decode("ascii"))
    except OSError as error:
        raise KeyFileError(f"{path}: the session key cannot be read ({error.strerror})") from None
    except ValueError:
        key = b""
    if len(key) != KEY:
        raise KeyFileError(f"{path}: not a session key; must be {2 * KEY} hexadecimal digits")
    if os.name == "posix" and status.st_mode & 0o077:
        raise KeyFileError(f"{path}: other users may read this key; run `chmod 600 {path}`")
    return key


def find(host: str, port: int) -> Path | None:
    """Return the key file for an address: the one configured, or that of a server on this machine.

    Where several servers of this machine have used the port, the one that started last counts.
    """
    if (path := configured()) is not None:
        return path
    if host not in _LOCAL:
        return None
    paths = [folder / name for folder in folders() for name in (file_name(port), kept_name(port))]
    return max((p for p in paths if p.is_file()), key=lambda p: p.stat().st_mtime, default=None)


def file_name(port: int | str) -> str:
    """Return the name of the key file of a server that makes a new key at every start."""
    return f"port-{port}.key"


def kept_name(port: int) -> str:
    """Return the name of the key file of a server that keeps its key."""
    return f"gateway-{port}.key"


def _make_private(folder: Path) -> None:
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    status = folder.lstat()
    if os.name != "posix":
        return
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.geteuid():
        raise PermissionError(f"{folder} belongs to another user")
    if status.st_mode & 0o077:
        folder.chmod(0o700)


def _remove_stale(folder: Path) -> None:
    """Remove the keys of ports on which no server listens; one that does has bound its port."""
    for path in folder.glob(file_name("*")):
        number = path.stem.removeprefix("port-")
        with contextlib.suppress(OSError, ValueError, OverflowError), socket.socket() as probe:
            probe.bind(("127.0.0.1", int(number)))
            path.unlink()


def _write(path: Path, key: bytes | None = None) -> None:
    """Write a key, a new one if none is given, to a file that does not exist."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    file = os.open(path, flags, 0o600)
    try:
        os.write(file, (key or secrets.token_bytes(KEY)).hex().encode("ascii") + b"\n")
    finally:
        os.close(file)
