"""Serve the Pi's gimbal on a TCP port of loopback."""

import argparse
import signal
import sys

from hardware.device import TcpPort
from hardware.frames import HardwareError
from hardware.raspberry_pi.gateway import PORT, Gateway, serial_number
from hardware.raspberry_pi.pwm import KernelPwm
from hardware.raspberry_pi.sensors import open_adc, open_bus


def main(arguments: list[str] | None = None) -> int:
    """Run the gateway; return the exit code, 2 if the Pi's hardware cannot be used."""
    parser = argparse.ArgumentParser(prog="python -m hardware.raspberry_pi", description=__doc__)
    parser.add_argument("--port", type=int, default=PORT, help="TCP port on 127.0.0.1")
    parser.add_argument("--bus", type=int, default=1, help="number of the I²C bus")
    options = parser.parse_args(arguments)
    try:
        bus = open_bus(options.bus)
        port = TcpPort(options.port)
        gateway = Gateway(KernelPwm(), bus, port, open_adc(), serial=serial_number())
    except HardwareError as error:
        print(error, file=sys.stderr)
        return 2
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: gateway.stop())
    print(
        f"gimbal at {gateway.port.url}; reach it with `ssh -L {options.port}:127.0.0.1:"
        f"{options.port} PI`",
        file=sys.stderr,
    )
    try:
        gateway.run()
    except HardwareError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
