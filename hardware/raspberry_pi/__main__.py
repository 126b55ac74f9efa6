"""Serve the Pi's gimbal on a TCP port of loopback."""

import argparse
import signal
import sys
from pathlib import Path

from hardware.device import TcpPort, refusals
from hardware.frames import HardwareError
from hardware.key import VARIABLE, configured, folders, kept_name
from hardware.raspberry_pi.gateway import PORT, Gateway, serial_number
from hardware.raspberry_pi.pwm import KernelPwm
from hardware.raspberry_pi.sensors import open_adc, open_bus


def main(arguments: list[str] | None = None) -> int:
    """Run the gateway; return the exit code, 2 if the Pi's hardware cannot be used."""
    parser = argparse.ArgumentParser(prog="python -m hardware.raspberry_pi", description=__doc__)
    parser.add_argument("--port", type=int, default=PORT, help="TCP port on 127.0.0.1")
    parser.add_argument(
        "--key-file",
        type=Path,
        help="session key that hosts must have, written if missing; else that of"
        f" {VARIABLE}, or {folders()[-1]}/gateway-PORT.key",
    )
    parser.add_argument("--bus", type=int, default=1, help="number of the I²C bus")
    options = parser.parse_args(arguments)
    key = options.key_file or configured() or folders()[-1] / kept_name(options.port)
    try:
        bus = open_bus(options.bus)
        port = TcpPort(options.port, key)
        gateway = Gateway(KernelPwm(), bus, port, open_adc(), serial=serial_number())
    except HardwareError as error:
        print(error, file=sys.stderr)
        return 2
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: gateway.stop())
    print(
        f"gimbal at {gateway.port.url}, session key {key}; copy the key to the other"
        f" computer, set {VARIABLE} to it there, and run"
        f" `ssh -N -L {options.port}:127.0.0.1:{options.port} PI`",
        file=sys.stderr,
    )
    try:
        gateway.run()
    except HardwareError as error:
        print(error, file=sys.stderr)
        return 2
    finally:
        if closed := refusals(port, gateway.inbox):
            print(closed, file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
