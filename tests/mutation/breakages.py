"""Planted breakages: single wrong lines that people have written, or that a review once missed.

Each names the tests that must turn red. The first group was planted in the product by hand while
the whole suite stayed green; their tests have an independent truth.
"""

from tests.mutation.runner import Mutant

_NATIVE = "tests/twin/physics/test_native.py"
_AERO = "tests/twin/physics/test_aerodynamics.py"
_CONTROL = "tests/twin/loop/test_control.py"
_FUSION = "tests/hardware/test_fusion.py"
_CALIBRATION = "tests/hardware/test_calibration.py"
_FAULTS = "tests/hardware/test_faults.py"
_REGISTERS = "tests/hardware/test_firmware_registers.py"
_CORE = "tests/hardware/test_firmware_core.py"
_PROTOCOL = "tests/hardware/test_protocol.py"
_PI = "tests/hardware/test_raspberry_pi.py"
_PARTS = "tests/hardware/test_parts.py"
_FLIGHT = "tests/twin/physics/test_one_axis.py"
_AVR = "hardware/firmware/tvc_gimbal/"

PLANTED = (
    Mutant(
        "gyro low-pass delay of setting 4",
        "hardware/parts.py", "4.8e-3, 8.3e-3", "4.8e-3, 9.3e-3", (_PARTS,),
    ),
    Mutant(
        "gyro low-pass delay of setting 2",
        "hardware/parts.py", "1.9e-3, 2.8e-3", "1.9e-3, 1.8e-3", (_PARTS,),
    ),
    Mutant(
        "gyro delay of the successors",
        "hardware/parts.py", "2.9e-3, 3.9e-3", "2.9e-3, 4.9e-3", (_PARTS,),
    ),
    Mutant(
        "covariance of every identified model × 0.25",
        "analysis/identify/evidence/uncertainty.py",
        "return np.asarray(slope @ cov @ slope.T)", "return np.asarray(slope @ cov @ slope.T) / 4",
        ("tests/analysis/test_identify_fit.py", "-k", "propagated"),
    ),
    Mutant(
        "covariance of the white noise × 0.25",
        "analysis/identify/evidence/uncertainty.py",
        "hermitian=True) / np.outer(scale, scale))",
        "hermitian=True) / np.outer(scale, scale)) / 4",
        ("tests/analysis/test_identify_coverage.py", "-k", "scores or uncertain"),
    ),
    Mutant(
        "shipped gimbal with 10 ms more delay",
        "mjcf/gimbal.json", "0.017966642773786703", "0.0279666427737867",
        ("tests/twin/hil/test_hil.py", "-k", "fly_alike"),
    ),
    Mutant(
        "no ω×r in the normal force",
        "twin/physics/aerodynamics/body.py",
        "ux, uy = vx + wy * r, vy - wx * r\n    fx, fy = -scale",
        "ux, uy = vx, vy\n    fx, fy = -scale",
        (_AERO, "-k", "normal_force or damping"),
    ),
    Mutant(
        "axial drag + 30 %",
        "twin/physics/aerodynamics/body.py",
        "drag: float = -scale * np.abs(vz) * vz", "drag: float = -1.3 * scale * np.abs(vz) * vz",
        (_FLIGHT,),
    ),
    Mutant(
        "launch altitude ignored in the density",
        "twin/physics/native/recovery.py",
        "return float(air.density(height + value(data, index, _ALTITUDE)))",
        "return float(air.density(height))",
        (_FLIGHT,),
    ),
    Mutant(
        "inertia of the propellant never updated",
        "twin/physics/motor/depletion.py",
        "    fuel.inertia[0] = transverse\n    fuel.inertia[1] = transverse\n", "",
        ("tests/twin/physics/test_motor.py", "-k", "mass_matrix or books"),
    ),
    Mutant(
        "masses above the propellant never updated",
        "twin/physics/motor/depletion.py", "fuel.subtree[fuel.chain[k]] += change", "pass",
        ("tests/twin/physics/test_motor.py", "-k", "mass_matrix or books"),
    ),
    Mutant(
        "friction of the gimbal × 4",
        "mjcf/mechanism.xml", 'frictionloss="0.001"', 'frictionloss="0.004"',
        ("tests/twin/plant/test_plant_gimbal.py", "-k", "triangle"),
    ),
    Mutant(
        "no conditional integration",
        "twin/control/pid.py", "if (wanted - output) * push <= 0.0:", "if True:",
        (_CONTROL, "-k", "integra or bounded"),
    ),
    Mutant(
        "conditional integration the wrong way round",
        "twin/control/pid.py",
        "if (wanted - output) * push <= 0.0:", "if (wanted - output) * push >= 0.0:",
        (_CONTROL, "-k", "integra or bounded"),
    ),
    Mutant(
        "vehicle follows the oldest estimate of a tick",
        "twin/hil/gimbal.py",
        "state = self.readings.states[-1] if", "state = self.readings.states[0] if",
        ("tests/twin/hil/test_rig_gimbal.py",),
    ),
    Mutant(
        "controller is given the rate of the simulation",
        "twin/hil/turntable.py",
        "self.rate[0] = rate[0] + faster * bx", "self.rate[0] = rate[0]",
        ("tests/twin/hil/test_turntable.py", "-k", "rate_given"),
    ),
    Mutant(
        "sign of the gyro-bias correction in calibration",
        "hardware/calibration/solve.py",
        "np.array(before.gyro) - centre * duration", "np.array(before.gyro) + centre * duration",
        (_CALIBRATION, "-k", "gyro"),
    ),
    Mutant(
        "gyro-bias fault threshold × 2",
        "hardware/faults/drift.py",
        "COMMON_DRIFT = radians(0.3)", "COMMON_DRIFT = radians(0.6)",
        (_FAULTS, "-k", "smallest"),
    ),
    Mutant(
        "gyro-bias fault threshold / 2",
        "hardware/faults/drift.py",
        "COMMON_DRIFT = radians(0.3)", "COMMON_DRIFT = radians(0.15)",
        (_FAULTS, "-k", "largest or healthy"),
    ),
    Mutant(
        "µm stored × 1000",
        "analysis/schema.py", '("m", "µm"): 1e6', '("m", "µm"): 1e9',
        ("tests/analysis/test_schema.py",),
    ),
    Mutant(
        "correlation of two potentiometers on one supply dropped",
        "hardware/fusion/estimator.py", "covariance=(a * b, c * d)", "covariance=(0.0, 0.0)",
        (_FUSION, "-k", "supply"),
    ),
    Mutant(
        "cos y of the ring's gyro dropped",
        "hardware/fusion/estimator.py", "gyro_gain=cos(x[STATES + ANGLE])", "gyro_gain=1.0",
        (_FUSION, "-k", "cosine"),
    ),
    Mutant("UBRR for 1 Mbaud", _AVR + "uart.cpp", "wire::BAUD - 1;", "wire::BAUD / 2;",
           (_REGISTERS,)),
    Mutant("ADC reference AREF", _AVR + "adc.cpp", "AVCC = _BV(REFS0)", "AVCC = 0", (_REGISTERS,)),
    Mutant("bus recovery with one clock", _AVR + "bus.cpp", "pulse < 9", "pulse < 1",
           (_REGISTERS,)),
    Mutant(
        "early-latch bookkeeping", _AVR + "servos.cpp",
        "if (!latched_early) latch();", "latch();", (_REGISTERS,),
    ),
    Mutant(
        "early latch never made", _AVR + "servos.cpp",
        "(TIFR1 & _BV(TOV1)) && !latched_early", "false", (_REGISTERS,),
    ),
    Mutant(
        "Pi: period below a standing duty", "hardware/raspberry_pi/pwm.py",
        '        _write(folder / "duty_cycle", 0)\n        _write(folder / "period", PERIOD_NS)',
        '        _write(folder / "period", PERIOD_NS)', (_PI, "-k", "duty"),
    ),
    Mutant(
        "Pi: frame phase of 0 without the flag that says so", "hardware/raspberry_pi/gateway.py",
        "self.device.flags |= Flags.PULSE_UNTIMED", "pass", (_PI, "-k", "telemetry or untimed"),
    ),
    # Others of the same kinds.
    Mutant("density falls too fast", "twin/physics/aerodynamics/atmosphere.py",
           "LAPSE: Final = 0.0065", "LAPSE: Final = 0.0075", (_AERO, "-k", "density")),
    Mutant("crossflow without the turn", "twin/physics/aerodynamics/body.py",
           "ux, uy = vx + wy * r, vy - wx * r\n        drag", "ux, uy = vx, vy\n        drag",
           (_AERO, "-k", "quadrature or turning or energy")),
    Mutant("jet damping of half the size", "twin/physics/native/forces.py",
           "load = (-2.0 * flow", "load = (-1.0 * flow", (_NATIVE, "-k", "gas or momentum")),
    Mutant("wind in the wrong direction", "twin/physics/native/forces.py",
           "velocity[0] - wind[0]", "velocity[0] + wind[0]",
           (_NATIVE, "-k", "formulas or recorded_flow")),
    Mutant("dead band of a servo twice as wide", "twin/physics/native/servo.py",
           "max(-half, min(half, error))", "max(-2 * half, min(2 * half, error))",
           ("tests/twin/physics/test_actuator.py", "tests/twin/physics/test_mechanism.py",
            "-k", "dead or servo")),
    Mutant("gyro's delay left out of the filter", "hardware/fusion/kalman.py",
           "e = exp(-dt / delay) if delay > 0 else 0.0\n    return", "e = 0.0\n    return",
           (_FUSION, "-k", "discretisation")),
    Mutant("covariance of a potentiometer map", "hardware/calibration/solve.py",
           "[0.0, -gain * gain]", "[0.0, gain]", (_CALIBRATION, "-k", "intervals")),
    Mutant("hysteresis added on the wrong side", "hardware/calibration/solve.py",
           "d + came * hysteresis / 2", "d - came * hysteresis / 2",
           (_CALIBRATION, "-k", "approach")),
    Mutant("CRC of another polynomial", _AVR + "framing.cpp", "0x1021", "0x8005", (_CORE,)),
    Mutant("time-out never ends a command", _AVR + "core.cpp",
           "if (static_cast<int32_t>(now_us - deadline_us_) < 0) return;", "return;", (_CORE,)),
    Mutant("pulses are not clamped", _AVR + "core.cpp",
           "wanted > config_.maximum[i] ? config_.maximum[i]",
           "wanted > config_.maximum[i] ? wanted", (_CORE,)),
    Mutant("lost frames counted twice", "hardware/protocol/codec.py",
           "self._lost += missed if missed < 0x8000 else 0",
           "self._lost += 2 * missed if missed < 0x8000 else 0", (_PROTOCOL,)),
    Mutant("sequence without a wrap", "hardware/protocol/codec.py",
           "self.sequence = (self.sequence + 1) & 0xFFFF", "self.sequence = self.sequence + 1",
           (_PROTOCOL, "-k", "wrap or numbers")),
)  # fmt: skip
