"""The other end of the line for the benchmarks: an echo, or a rig without any delay.

    python -m tests.benchmarks.desk_peer echo|rig|prompt pty|tcp

`prompt` answers a PING the moment it arrives; the two others see to the line when they wake.

The rig's stamp is the moment its frame's last byte enters the pseudo-terminal, where the reader
has it at once; whatever a mirror adds to that stamp is the mirror's own.
"""

import json
import select
import socket
import sys
import time
from typing import NoReturn

from hardware.device import Device, PtyPort, Sample, TcpPort
from hardware.protocol import Board
from twin.loop import realtime

PERIOD_S = 0.002


def main() -> None:
    """Serve until terminated, with what rights there are."""
    if sys.argv[1:] == ["echo", "tcp"]:
        _bare_echo()
    port = PtyPort() if sys.argv[2:] != ["tcp"] else TcpPort()
    with realtime.requested():
        print(json.dumps({"port": port.url}), flush=True)
        {"echo": _echo, "rig": _rig, "prompt": _prompt}[sys.argv[1]](port)


def _wait(port: PtyPort | TcpPort, seconds: float | None) -> None:
    """Until the host has sent something."""
    if isinstance(port, PtyPort):
        files = [port._ours]
    else:
        files = [port._listener, port._host, *(guest.line for guest in port._guests)]
    select.select([f for f in files if f is not None], [], [], seconds)


def _bare_echo() -> NoReturn:
    """A plain socket: `TcpPort` serves no host without a session key, and pyserial has none."""
    with socket.create_server(("127.0.0.1", 0)) as listener, realtime.requested():
        print(json.dumps({"port": f"socket://127.0.0.1:{listener.getsockname()[1]}"}), flush=True)
        line = listener.accept()[0]
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        while data := line.recv(65536):
            line.sendall(data)
    sys.exit()


def _echo(port: PtyPort | TcpPort) -> None:
    while True:
        _wait(port, None)
        port.write(port.read())


def _prompt(port: PtyPort | TcpPort) -> None:
    rig = Device(Board.EMULATOR, 1)
    begin = time.monotonic()
    due = begin + PERIOD_S
    while True:
        _wait(port, max(0.0, due - time.monotonic()))
        now = round((time.monotonic() - begin) * 1e6)
        if data := port.read():
            rig.receive(data, now, now)
            _flush(rig, port)
        if time.monotonic() >= due:
            due += PERIOD_S
            rig.update(now)
            rig.report(_sample(now))
            _flush(rig, port)


def _rig(port: PtyPort | TcpPort) -> None:
    rig = Device(Board.EMULATOR, 1)
    begin = time.monotonic()
    due = begin
    while True:
        now = round((time.monotonic() - begin) * 1e6)
        if data := port.read():
            rig.receive(data, now, now)
        rig.update(now)
        _flush(rig, port)  # answers go first, so that nothing stands before the frame
        now = round((time.monotonic() - begin) * 1e6)
        rig.report(_sample(now))
        _flush(rig, port)
        due += PERIOD_S
        time.sleep(max(0.0, due - time.monotonic()))


def _flush(rig: Device, port: PtyPort | TcpPort) -> None:
    port.write(bytes(rig.transmit))
    rig.transmit.clear()


def _sample(now: int) -> Sample:
    k = now // 2000 % 7  # a frozen gyro would be found out
    return Sample(
        device_us=now,
        frame_us=0,
        potentiometer=(512, 511, 512, 511),
        imu=[k - 3, 3 - k, k, 0, 0, -8192, k, 0, 0, 0, 0, -8192],
        imu_age_us=(0, 0),
        imu_fresh=(True, True),
        pulse=(3000, 3000, 3000),
        switches=0,
        joystick=(512, 512),
    )


if __name__ == "__main__":
    main()
