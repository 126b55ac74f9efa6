"""The firmware's peripheral code on fake registers, for what a simulated chip does not show.

simavr takes any baud rate, ignores the ADC's reference and lets go of the bus by itself.
Formulas and bits: ATmega328P data sheet, DS40002061B.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from hardware.firmware.build import SKETCH
from hardware.protocol import constants

HERE = Path(__file__).parent
UNITS = ("adc", "bus", "servos", "uart", "core", "framing")
CPU = 16_000_000


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Run one part of the driver; gives its lines as lists of words."""
    if shutil.which("g++") is None:
        assert not os.environ.get("CI"), "g++ is missing in CI"
        pytest.skip("g++ is not installed")
    program = tmp_path_factory.mktemp("registers") / "registers"
    sources = [HERE / "register_driver.cpp", *(SKETCH / f"{unit}.cpp" for unit in UNITS)]
    command = ["g++", "-std=gnu++11", "-O0", f"-DF_CPU={CPU}UL", f"-I{HERE / 'fake_avr'}"]
    subprocess.run([*command, f"-I{SKETCH}", *map(str, sources), "-o", str(program)], check=True)

    def part(name):
        done = subprocess.run([program, name], capture_output=True, text=True, check=True)
        return [line.split() for line in done.stdout.splitlines()]

    return part


def _values(words):
    return {name: float(value) for name, value in zip(words[::2], words[1::2], strict=True)}


def test_the_serial_line_runs_at_500_000_baud_with_8_bits_and_no_parity(run):
    (line,) = run("uart")
    registers = {k: int(v) for k, v in _values(line).items()}
    divisor = 8 if registers["UCSR0A"] & 1 << 1 else 16  # U2X0; table 20-1
    assert CPU / (divisor * (registers["UBRR0"] + 1)) == constants.BAUD == 500_000
    assert registers["UCSR0C"] == 0b110  # asynchronous, no parity, one stop bit, UCSZ = 3
    assert registers["UCSR0B"] & 0b11000 == 0b11000  # receiver and transmitter on


def test_every_conversion_is_against_the_supply_of_the_potentiometers(run):
    lines = run("adc")
    muxes = [int(value) for name, value in lines if name == "ADMUX"]
    assert [mux >> 6 for mux in muxes] == [0b01] * 10  # AVcc; 00 would be AREF, 11 the 1.1 V
    assert not any(mux & 1 << 5 for mux in muxes)  # right-adjusted
    channels = [mux & 15 for mux in muxes]
    assert sorted(channels[::5]) == [6, 7]  # one axis of the joystick, alternating
    assert channels[1:5] == channels[6:] == [0, 1, 2, 3]
    (control,) = [int(value) for name, value in lines if name == "ADCSRA"]
    assert CPU / 2 ** (control & 7) <= 200_000  # for ten bits, section 24.4
    assert [int(value) for name, value in lines if name == "count"] == [
        100,
        101,
        102,
        103,
        106,
        107,
    ]


def test_the_bus_runs_at_400_khz(run):
    registers = _values(run("bus")[0])
    prescaler = 4 ** (int(registers["TWSR"]) & 3)
    assert CPU / (16 + 2 * registers["TWBR"] * prescaler) == 400_000  # section 22.5.2
    assert int(registers["PORTC"]) & 0b110000 == 0b110000  # pull-ups of SDA and SCL


def test_a_slave_that_needs_up_to_nine_clocks_lets_go_of_the_bus(run):
    for words in run("bus")[1:]:
        shown = _values(words)
        assert shown["held"] == 0
        assert shown["clocks"] == 9  # UM10204 3.1.16
        assert shown["driven_high"] == 0  # open drain
        assert shown["while_on"] == 0  # the peripheral would own the pins
        assert shown["half_us"] >= 4.7  # of a slave of 100 kHz, UM10204 table 10
        assert int(shown["TWCR"]) & 1 << 2  # on again


def test_a_command_while_the_frames_interrupt_is_pending_waits_for_the_next_frame(run):
    """What telemetry reports as in force is what the double-buffered timer puts out."""
    lines = [" ".join(words) for words in run("servos")]
    first, second, third = ("in_force " + f"{n} {n} {n}" for n in (3000, 3100, 3200))
    assert lines == [
        "taken 1",  # 3100, in the middle of a frame
        first,
        "taken 1",  # 3200, after a frame has started with 3100
        second,
        second,  # its interrupt runs late and must not take 3200 for in force
        "taken 0",  # 3900, in the last 20 µs of the frame
        second,
        third,  # the next frame
        third,
        third,
        "OCR1 3199 3199",  # high for OCR + 1 ticks
    ]
