"""The rooms whose lines are mutated by rule: files, tests in the order in which they are tried."""

_T, _H = "tests/twin/physics/test_", "tests/hardware/test_"
_LAUNCH = "tests/twin/plant/test_launch.py"
_VERB = "tests/twin/experiments/test_mechanism_verb.py"
_LOOP = "tests/twin/loop/test_"

_CALLBACKS = (f"{_T}native.py", f"{_T}air.py", _LAUNCH, f"{_T}one_axis.py")
_VEHICLE = (f"{_T}vehicle_shape.py",)

ROOMS: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = (
    (
        tuple(f"twin/physics/aerodynamics/{n}.py" for n in ("atmosphere", "body")),
        (f"{_T}aerodynamics.py", f"{_T}air.py"),
    ),
    (
        tuple(f"twin/physics/aerodynamics/{n}.py" for n in ("revolve", "silhouette")),
        (f"{_T}aerodynamics.py",),
    ),
    (("twin/physics/aerodynamics/fit.py",), _VEHICLE),
    (("twin/physics/aerodynamics/stability.py",), (f"{_T}stability.py",)),
    (
        tuple(f"twin/physics/native/{n}.py" for n in ("forces", "rigid_body", "ramp", "recovery")),
        _CALLBACKS,
    ),
    (
        tuple(f"twin/physics/native/{n}.py" for n in ("hold", "inverse", "actuator", "servo")),
        (f"{_T}actuator.py", f"{_T}mechanism.py"),
    ),
    (
        tuple(f"twin/physics/motor/{n}.py" for n in ("curve", "depletion", "grain", "eng", "rse")),
        (f"{_T}motor.py", f"{_T}motor_files.py"),
    ),
    (
        tuple(f"twin/physics/mechanism/{n}.py" for n in ("kinematics", "mobility", "torque")),
        (f"{_T}mechanism.py", _VERB),
    ),
    (
        tuple(f"twin/physics/vehicle/{n}.py" for n in ("barrowman", "lumps", "outline", "drag")),
        _VEHICLE,
    ),
    (
        tuple(f"hardware/fusion/{n}.py" for n in ("kalman", "estimator", "base")),
        (f"{_H}fusion.py", f"{_H}base.py", f"{_H}rig.py"),
    ),
    (
        ("hardware/calibration/solve.py", "hardware/calibration/axis.py"),
        (f"{_H}calibration.py", f"{_H}calibration_map.py"),
    ),
    (
        ("hardware/calibration/linearisation.py", "hardware/calibration/result.py"),
        (f"{_H}calibration_linearisation.py", f"{_H}calibration.py", f"{_H}calibration_map.py",
         f"{_H}calibration_file.py"),
    ),
    (
        tuple(f"hardware/protocol/{n}.py" for n in ("codec", "wire", "defaults")),
        (f"{_H}protocol.py", f"{_H}conformance.py"),
    ),
    (
        tuple(f"hardware/firmware/tvc_gimbal/{n}.cpp" for n in ("core", "framing")),
        (f"{_H}firmware_core.py",),
    ),
    (
        ("twin/control/pid.py", "twin/control/attitude.py"),
        (f"{_LOOP}control.py", f"{_LOOP}attitude_loop.py"),
    ),
)  # fmt: skip
