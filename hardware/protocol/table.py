"""Generated from the message table: its checksum, the firmware's header."""

from hardware.protocol import messages as m
from hardware.protocol.codec import MAX_ENCODED, MAX_PAYLOAD, crc16
from hardware.protocol.wire import C_TYPES, Field, Layout, layout


def _canonical() -> str:
    """Names, types and order of all fields; descriptions are left out."""
    lines = [f"protocol {m.PROTOCOL}"]
    for cls in m.MESSAGES:
        place = layout(cls)
        lines.append(f"{place.type_id:02x} {cls.__name__}")
        lines += [f"{f.name} {f.wire.count}{f.wire.code} {f.wire.unit}" for f in place.fields]
    return "\n".join(lines)


LAYOUT = crc16(_canonical().encode())
"""Checksum of the table; HELLO carries it, and the host refuses a mismatch."""

_SCALARS = {
    "PROTOCOL": "uint16_t",
    "BAUD": "uint32_t",
    "CLOCK_HZ": "uint32_t",
    "TICK_NS": "uint16_t",
    "PWM_PERIOD_US": "uint16_t",
    "PULSE_NEUTRAL": "uint16_t",
    "PULSE_MINIMUM": "uint16_t",
    "PULSE_MAXIMUM": "uint16_t",
    "PULSE_LOWEST": "uint16_t",
    "PULSE_HIGHEST": "uint16_t",
    "TIMEOUT_LONGEST_MS": "uint16_t",
    "TELEMETRY_PERIOD_MS": "uint8_t",
    "TELEMETRY_PERIOD_SHORTEST_MS": "uint8_t",
    "TELEMETRY_PERIOD_LONGEST_MS": "uint8_t",
    "ADC_LEVELS": "uint16_t",
    "GYRO_RANGE_DPS": "uint16_t",
    "ACCELEROMETER_RANGE_G": "uint8_t",
    "SERIAL_NONE": "uint32_t",
    "SERIAL_BLANK": "uint32_t",
    "DLPF": "uint8_t",
    "DLPF_HIGHEST": "uint8_t",
}
_ARRAYS = {
    "FIRMWARE": m.FIRMWARE,
    "SERVO_PINS": m.SERVO_PINS,
    "POTENTIOMETER_PINS": m.POTENTIOMETER_PINS,
    "JOYSTICK_PINS": m.JOYSTICK_PINS,
    "SWITCH_PINS": m.SWITCH_PINS,
    "IMU_ADDRESSES": m.IMU_ADDRESSES,
}


def _comment(field: Field) -> str:
    unit = f"[{field.wire.unit}] " if field.wire.unit else ""
    return f"{unit}{field.wire.about}"


def _struct(name: str, about: str, place: Layout) -> list[str]:
    lines = ["", f"// {about}", f"struct __attribute__((packed)) {name} {{"]
    lines.append(f"  enum : uint8_t {{ TYPE = 0x{place.type_id:02x} }};")
    for f in place.fields:
        extent = f"[{f.wire.count}]" if f.wire.count > 1 else ""
        lines.append(f"  {C_TYPES[f.wire.code]} {f.name}{extent};  // {_comment(f)}")
    lines.append("};")
    if place.size:
        lines.append(f'static_assert(sizeof({name}) == {place.size}, "padded");')
    return lines


def cpp_header() -> str:
    """Return the firmware's `protocol.h`."""
    lines = [
        "// Generated from hardware/protocol by `python -m hardware.firmware`; edit that instead.",
        "#pragma once",
        "#include <stdint.h>",
        "",
        "namespace wire {",
        "",
    ]
    lines += [f"static constexpr {c} {n} = {getattr(m, n)};" for n, c in _SCALARS.items()]
    lines.append(f"static constexpr uint16_t LAYOUT = 0x{LAYOUT:04x};")
    lines.append(f"static constexpr uint8_t MAX_PAYLOAD = {MAX_PAYLOAD};")
    lines.append(f"static constexpr uint8_t MAX_ENCODED = {MAX_ENCODED};")
    for name, values in _ARRAYS.items():
        body = ", ".join(str(v) for v in values)
        lines.append(f"static constexpr uint8_t {name}[] = {{{body}}};")
    for enum, width in ((m.Board, "uint8_t"), (m.Mode, "uint8_t"), (m.Flags, "uint16_t")):
        body = ", ".join(f"{enum.__name__.upper()}_{e.name} = {e.value}" for e in enum)
        lines += ["", f"enum {enum.__name__} : {width} {{ {body} }};"]
    for cls in m.MESSAGES:
        lines += _struct(cls.__name__, (cls.__doc__ or "").splitlines()[0], layout(cls))
    lines += ["", "}  // namespace wire", ""]
    return "\n".join(lines)
