"""Figures of the parts against the makers' tables, typed off a second time."""

from hardware import parts


def test_delays_of_the_gyros_low_pass_are_those_of_the_register_maps():
    """MPU-6000/6050 register map 4.2, register 26; MPU-6500 register map 2.1, register 26 [ms]."""
    mpu6050 = {0: 0.98, 1: 1.9, 2: 2.8, 3: 4.8, 4: 8.3, 5: 13.4, 6: 18.6}
    mpu6500 = {0: 0.97, 1: 2.9, 2: 3.9, 3: 5.9, 4: 9.9, 5: 17.85, 6: 33.48}
    for table, delays in ((mpu6050, parts.GYRO_DELAY_S), (mpu6500, parts.GYRO_DELAY_6500_S)):
        assert [round(1e3 * d, 9) for d in delays] == [table[k] for k in range(7)]
