"""Exact calibration of an emulated rig, from its parameters."""

import numpy as np

from hardware.calibration.result import Calibration, GyroMap, PotentiometerMap
from hardware.emulator.bench import RigParameters
from hardware.emulator.emulator import identity
from hardware.emulator.servo import PULSE_CENTRE
from hardware.frames import Pair
from hardware.parts import POTENTIOMETER_TRAVEL
from hardware.protocol import constants


def exact_calibration(parameters: RigParameters) -> Calibration:
    """Return the maps of a rig with these parameters, without backlash and waviness."""
    plant, sensors = parameters.plant, parameters.sensors
    shaft = np.diag([s.travel for s in plant.servos[:2]]) / (1 + parameters.skew)
    matrix = np.array(plant.linkage) @ shaft
    centre = np.array([(PULSE_CENTRE + s.trim) * (1 + parameters.skew) for s in plant.servos[:2]])
    zero = centre - np.linalg.solve(matrix, np.array(plant.offset))
    half_step = 0.5 / constants.ADC_LEVELS  # the ADC rounds down
    maps = tuple(
        PotentiometerMap(p.zero - half_step, p.direction * POTENTIOMETER_TRAVEL / p.scale)
        for p in sensors.potentiometers
    )
    imu = sensors.imus[0]
    gyro = np.array(imu.gyro_matrix)[:2, :2]
    return Calibration(
        rig=identity(parameters),
        zero=_pair(zero),
        matrix=(_pair(matrix[0]), _pair(matrix[1])),
        potentiometers=(maps[0], maps[1], maps[2], maps[3]),
        gyro=GyroMap(
            bias=imu.gyro_bias,
            matrix=(_pair(gyro[0]), _pair(gyro[1])),
            sigma=0.003,
            bias_sigma=0.01,
        ),
        switch_angle=sensors.switch_angle,
    )


def _pair(values: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]") -> Pair:
    return float(values[0]), float(values[1])
