"""HELLO and settings of a board after boot, for the firmware and every board in Python."""

from hardware.protocol import messages as m
from hardware.protocol.messages import Board, Config, Hello, Pair, Triple
from hardware.protocol.table import LAYOUT


def _three(value: int) -> Triple:
    return (value, value, value)


def default_config() -> Config:
    """Return the settings in force after boot."""
    return Config(
        telemetry_period_ms=m.TELEMETRY_PERIOD_MS,
        dlpf=m.DLPF,
        neutral=_three(m.PULSE_NEUTRAL),
        minimum=_three(m.PULSE_MINIMUM),
        maximum=_three(m.PULSE_MAXIMUM),
    )


def hello(
    board: Board,
    build: int,
    config: Config,
    reset_cause: int = 1,
    serial: int = m.SERIAL_NONE,
    imu_identity: Pair = (0, 0),
) -> Hello:
    """Return the HELLO of a device of this version.

    Parameters
    ----------
    board : kind of board
    build : identity of its program, u32
    config : settings in force
    reset_cause : bits of MCUSR
    serial : serial number, u32; 0 without one
    imu_identity : WHO_AM_I of holder and base; 0 before it is read
    """
    return Hello(
        protocol=m.PROTOCOL,
        layout=LAYOUT,
        firmware=m.FIRMWARE,
        build=build,
        serial=serial,
        board=board,
        reset_cause=reset_cause,
        servo_pins=m.SERVO_PINS,
        potentiometer_pins=m.POTENTIOMETER_PINS,
        joystick_pins=m.JOYSTICK_PINS,
        switch_pins=m.SWITCH_PINS,
        imu_addresses=m.IMU_ADDRESSES,
        tick_ns=m.TICK_NS,
        pwm_period_us=m.PWM_PERIOD_US,
        adc_levels=m.ADC_LEVELS,
        gyro_range_dps=m.GYRO_RANGE_DPS,
        accelerometer_range_g=m.ACCELEROMETER_RANGE_G,
        telemetry_period_ms=config.telemetry_period_ms,
        dlpf=config.dlpf,
        neutral=config.neutral,
        minimum=config.minimum,
        maximum=config.maximum,
        imu_identity=imu_identity,
    )


def plausible(config: Config) -> bool:
    """Return whether the firmware accepts these settings; it refuses them as a whole."""
    pulses = zip(config.minimum, config.neutral, config.maximum, strict=True)
    return (
        m.TELEMETRY_PERIOD_SHORTEST_MS
        <= config.telemetry_period_ms
        <= m.TELEMETRY_PERIOD_LONGEST_MS
        and 0 <= config.dlpf <= m.DLPF_HIGHEST
        and all(m.PULSE_LOWEST <= a <= b <= c <= m.PULSE_HIGHEST for a, b, c in pulses)
    )
