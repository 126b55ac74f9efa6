"""Switch events to maps: synthetic rigs with exact truth, and the emulated rig."""

import re
from dataclasses import replace
from math import degrees, radians
from types import SimpleNamespace

import numpy as np
import pytest

from hardware.calibration import (
    CalibrationError,
    CalibrationRig,
    Event,
    GyroMap,
    Log,
    PotentiometerMap,
    Procedure,
    nominal,
)
from hardware.calibration.axis import KA, KB, M1, M2, MINUS, OA, OB, PLUS, C, first_guess, tabulate
from hardware.calibration.result import EXACT
from hardware.calibration.solve import _check_axis, _deviation, _maps, _mean, solve
from hardware.emulator import Emulator, parse, sample_rig
from hardware.emulator.truth import exact_calibration
from hardware.frames import SensorFrame
from hardware.protocol import Flags
from hardware.rig import in_process
from tests.hardware.trial import calibrate

RIG = CalibrationRig()
QUICK = CalibrationRig(repeats=1, offsets=(80e-6, -80e-6))


class _Rig:
    """A gimbal in five lines of algebra: what a switch event looks like without any servo."""

    def __init__(self, seed):
        rng = self.rng = np.random.default_rng(seed)
        scale = radians(1) / 23e-6
        self.matrix = scale * (np.diag(rng.uniform(0.95, 1.05, 2)))
        self.matrix[0, 1], self.matrix[1, 0] = scale * rng.uniform(-0.04, 0.04, 2)
        self.zero = 1.5e-3 + rng.uniform(-40e-6, 40e-6, 2)
        self.hysteresis = np.radians(rng.uniform(0.3, 1.2, 2))
        self.differential = np.radians(rng.uniform(0.2, 0.6, 2))
        self.closing = np.array(RIG.switch_angle) + rng.normal(0, RIG.switch_sigma, 4)
        self.gain = rng.uniform(0.95, 1.05, 4) * radians(240) * np.array([1, -1, 1, -1])
        self.centre = 0.5 + rng.uniform(-0.015, 0.015, 4)
        self.gyro = np.diag(rng.uniform(0.97, 1.03, 2)) + rng.normal(0, 0.005, (2, 2))
        self.bias = np.zeros(2)
        self.integral, self.time = np.zeros(2), 0.0
        self.angle = np.zeros(2)

    def event(self, switch, closed, offset):
        axis, sign = switch // 2, 1 - 2 * (switch % 2)
        way = sign if closed else -sign
        angle = self.closing[switch] - (0 if closed else sign * self.differential[axis])
        pulses = self.zero + offset
        rest = angle + way * self.hysteresis[axis] / 2
        other = 1 - axis
        pulses[axis] = (
            self.zero[axis]
            + (rest - self.matrix[axis, other] * (pulses[other] - self.zero[other]))
            / self.matrix[axis, axis]
        )
        # the step of 2 µs that passed the switch ended anywhere behind it; play of a servo 0.2 µs
        settled = pulses.copy()
        settled[axis] += way * self.rng.uniform(0, RIG.fine) + self.rng.normal(0, 0.2e-6)
        true = self.matrix @ (settled - self.zero)
        true[axis] -= way * self.hysteresis[axis] / 2
        settled[axis] += self.rng.normal(0, 0.2e-6)
        met = settled.copy()
        met[axis] -= way * RIG.fine / 2
        move = true - self.angle
        self.integral += self.gyro @ (move * [np.cos((true[1] + self.angle[1]) / 2), 1])
        self.integral += self.bias  # of the second that an event takes
        self.angle, self.time = true, self.time + 1
        noise = self.rng.normal(0, 1e-4, 4)  # 0.6 LSB over 50 frames
        reading = self.centre + true[[0, 0, 1, 1]] / self.gain + noise
        return Event(
            switch,
            closed,
            tuple(met),
            tuple(settled),
            tuple(reading),
            self.time,
            (*self.integral, 0.0),
        )

    def log(self):
        events = [
            self.event(switch, closed, offset)
            for offset in RIG.offsets
            for _ in range(RIG.repeats)
            for switch in range(4)
            for closed in (True, False)
        ]
        return Log(events=events)


@pytest.fixture(scope="module")
def solved():
    rigs = [_Rig(seed) for seed in range(100)]
    return [(rig, solve(rig.log(), RIG, 7)) for rig in rigs]


def _coverage(z):
    return (np.abs(z) < 1.96).mean()


def test_zero_and_matrix_are_within_claim_on_every_synthetic_rig(solved):
    for rig, got in solved:
        zero = rig.matrix @ (np.array(got.zero) - rig.zero)
        assert np.abs(zero).max() < radians(0.15)
        error = (np.array(got.matrix) - rig.matrix) / np.diag(rig.matrix)[:, None]
        # two switches held to 0.03° are 18° ± 0.042° apart: 0.24 %, four of it
        assert np.abs(error).max() < 0.01


def _on_track(track, seed=3):
    """A rig whose potentiometers have this travel [°], and the calibration rig that is told it."""
    rig = _Rig(seed)
    rig.gain *= track / 240.0
    return rig, replace(RIG, track=radians(track))


@pytest.mark.parametrize("track", [200.0, 300.0, 333.3, 345.0])
def test_a_track_of_the_stated_travel_is_measured(track):
    rig, told = _on_track(track)
    got = solve(rig.log(), told, 7)
    gains = [m.gain for m in got.potentiometers]
    assert np.abs(np.array(gains) / rig.gain - 1).max() < 0.01
    assert got.track == radians(track)


def test_a_travel_that_was_not_stated_is_asked_for():
    with pytest.raises(CalibrationError, match=r"about 3[34]\d°, not 240°, .*--potentiometer-deg"):
        solve(_on_track(333.3)[0].log(), RIG, 7)


@pytest.mark.parametrize("track", [240.0, 333.3])
def test_a_shaft_that_follows_by_three_quarters_is_loose_on_any_track(track):
    rig, told = _on_track(track)
    rig.gain[1] /= 0.75
    with pytest.raises(CalibrationError, match=r"potentiometer_x_b turned 1\d\.\d° .*loose"):
        solve(rig.log(), told, 7)


def _read(seed, change, index=0):
    """Events of a rig whose potentiometer's readings (n,) are changed."""
    log = _Rig(seed).log()
    seen = change(np.array([e.potentiometer[index] for e in log.events]))
    events = []
    for event, f in zip(log.events, seen, strict=True):
        readings = [*event.potentiometer]
        readings[index] = float(f)
        events.append(replace(event, potentiometer=tuple(readings)))
    return Log(events=events)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        # 9° is 0.0375 of the track; at zero 0.5, moved to where the track ends behind +5°
        (lambda f: np.minimum(f + 0.5 - 5 / 240, 1.0), r"_x_a reads 1\.000 .* \+x: the end"),
        (lambda f: np.maximum(f - 0.5 + 5 / 240, 0.0), r"_x_a reads 0\.000 .* -x: the end"),
        (lambda f: np.minimum(f + 0.47 - 7 / 240, 0.97), r"_x_a stops turning .* \+x: the end"),
        (lambda f: 0 * f, "_x_a reads ground at both switches; it is not wired"),
        (lambda f: 0 * f + 1.0, "_x_a reads the supply at both switches; it is not wired"),
        (lambda f: np.where(np.arange(len(f)) % 5 == 0, 0.0, f), "_x_a jumps by .* wire is loose"),
        (lambda f: np.sign(f - 0.5) * np.abs(f - 0.5) ** 0.5 / 6 + 0.5, "x_b are .* worn"),
    ],
    ids=["end", "start", "stops", "ground", "supply", "loose", "worn"],
)
def test_end_of_track_and_broken_wires_are_told_apart(change, words):
    with pytest.raises(CalibrationError, match=words):
        solve(_read(3, change), RIG, 7)


def test_a_clipped_track_that_looks_like_a_longer_one_is_named_as_that():
    """It turns by 0.89 of the angle: within what tracks are sold to."""
    with pytest.raises(CalibrationError, match=r"_x_a stops turning before switch \+x"):
        solve(_read(3, lambda f: np.minimum(f, 0.5 + 7 / 240) + 0.42), RIG, 7)


def test_a_mirrored_potentiometer_is_calibrated_and_noted():
    rig = _Rig(3)
    assert "mirrored" not in solve(rig.log(), RIG, 7).note
    rig.gain[1] = -rig.gain[1]
    got = solve(rig.log(), RIG, 7)
    assert got.potentiometers[1].gain == pytest.approx(rig.gain[1], rel=0.01)
    assert "both potentiometers of x rise the same way: one is mounted mirrored" in got.note


def test_an_emulated_track_that_ends_before_its_switch_is_named():
    unit = sample_rig(4)
    a, *others = unit.sensors.potentiometers
    ended = (replace(a, zero=1 - 7 / 240), *others)
    unit = replace(unit, sensors=replace(unit.sensors, potentiometers=ended))
    with pytest.raises(CalibrationError, match=r"_x_a reads 0\.99\d .* \+x: the end of its track"):
        calibrate(unit, replace(QUICK, offsets=(0.0,)), seed=4)


def test_stated_intervals_cover_the_truth_as_often_as_they_say(solved):
    z_zero, z_matrix, z_hysteresis, z_gain = [], [], [], []
    for rig, got in solved:
        z_zero.append((np.array(got.zero) - rig.zero) / np.sqrt(np.diag(got.zero_covariance)))
        z_matrix.append(
            (np.array(got.matrix) - rig.matrix).ravel() / np.sqrt(np.diag(got.matrix_covariance))
        )
        z_hysteresis.append((np.array(got.hysteresis) - rig.hysteresis) / got.hysteresis_sigma)
        z_gain.append(
            [
                (m.gain - g) / m.covariance[1][1] ** 0.5
                for m, g in zip(got.potentiometers, rig.gain, strict=True)
            ]
        )
    for z in (z_zero, z_matrix, z_hysteresis, z_gain):
        # 200 and more values: 95 % scatters by 1.5 %
        assert 0.90 < _coverage(np.array(z)) <= 0.99


def test_gyro_scale_and_misalignment_are_found(solved):
    for rig, got in solved:
        assert np.abs(np.array(got.gyro.matrix) - rig.gyro).max() < 0.015


def test_the_tilted_gyro_sees_the_ring_turn_by_the_cosine_of_the_tilt(solved):
    """Mean over 100 rigs: 70 µs of the other axis's servo tilt by 3°, cos² 3° is 0.9973."""
    off = np.mean([np.array(got.gyro.matrix) - rig.gyro for rig, got in solved], axis=0)
    assert np.abs(off).max() < 3e-4


def test_covariance_of_a_potentiometers_map_is_that_of_random_slopes():
    """The map holds zero and gain 1/k; the axis was solved for zero and slope k."""
    value, covariance = np.zeros(11), np.zeros((11, 11))
    value[[OA, KA, OB, KB]] = 0.5, 0.24, 0.51, -0.23
    covariance[np.ix_([OA, KA], [OA, KA])] = [[4e-8, 3e-8], [3e-8, 9e-8]]
    covariance[np.ix_([OB, KB], [OB, KB])] = [[4e-8, -2e-8], [-2e-8, 9e-8]]
    maps = _maps(SimpleNamespace(value=value, covariance=covariance))
    rng = np.random.default_rng(0)
    for k, (o, slope) in enumerate(((OA, KA), (OB, KB))):
        own = covariance[np.ix_([o, slope], [o, slope])]
        zero, random = rng.multivariate_normal(value[[o, slope]], own, 100_000).T
        # 100 000 scatter by 0.5 % of the deviations' product
        expected = np.cov(zero, 1 / random)
        bound = 0.03 * np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        assert (np.abs(np.array(maps[k].covariance) - expected) < bound).all()


def test_deviation_counts_every_place_where_an_axis_stood_held():
    """Straight maps, and potentiometers 0.2° off: up at one place and down at another."""
    value = np.zeros(11)
    value[[M1, OA, KA, OB, KB]] = radians(1) / 23e-6, 0.5, 0.24, 0.5, 0.24
    across = value.copy()
    across[[M1, M2]] = 0.0, value[M1]
    events = []
    for offset, astray in ((70e-6, 0.2), (-70e-6, -0.2)):
        angle = value[M1] * offset + radians(astray)
        reading = (0.5 + 0.24 * angle,) * 2 + (0.5,) * 2
        events.append(Event(2, True, (offset, 0), (offset, 0), reading, 0.0, (0.0,) * 3, came=0))
        events.append(Event(0, True, (0, 0), (0, 0), (0.5,) * 4, 0.0, (0.0,) * 3, came=0))
    axes = SimpleNamespace(value=value), SimpleNamespace(value=across)
    assert _deviation(Log(events=events), axes, RIG) == pytest.approx((radians(0.2), 0.0))


@pytest.mark.parametrize("measured", [(8.0, -15.0), (8.4, -15.5)])
def test_bias_of_the_gyro_is_taken_out_of_its_integral_and_what_is_left_is_found(measured):
    """8 and −15 °/s in the readings; measured at rest exactly, and off by some tenths."""
    rig = _Rig(3)
    rig.bias = np.radians([8.0, -15.0])
    log = rig.log()
    log.gyro_bias = (*np.radians(measured), 0.0)
    got = solve(log, RIG, 7)
    assert np.degrees(got.gyro.bias[:2]) == pytest.approx([8.0, -15.0], abs=0.05)
    assert np.abs(np.array(got.gyro.matrix) - rig.gyro).max() < 0.015


@pytest.mark.parametrize("way", [1, -1])
def test_an_approach_from_one_side_is_set_right_by_half_the_hysteresis(way):
    """Held from below the axis stands half the play low, from above half of it high."""
    held, play = 0.01, 0.004
    both = [(1, held - play / 2), (-1, held + play / 2)]
    assert _mean(both, play) == pytest.approx(held)
    assert _mean([p for p in both if p[0] == way], play) == pytest.approx(held)


@pytest.fixture(scope="module")
def emulated():
    """A unit whose tracks are not of the usual 240°."""
    unit = sample_rig(4)
    scaled = (replace(p, scale=p.scale * 240 / 345) for p in unit.sensors.potentiometers)
    unit = replace(unit, sensors=replace(unit.sensors, potentiometers=tuple(scaled)))
    return unit, calibrate(unit, replace(QUICK, track=radians(345)), seed=4)


@pytest.mark.thorough
def test_emulated_rig_is_calibrated_to_the_claim(emulated):
    parameters, got = emulated
    true = exact_calibration(parameters)
    M = np.array(got.matrix)
    assert np.abs(M @ (np.array(got.zero) - true.zero)).max() < radians(0.15)
    assert np.abs((M - true.matrix) / np.diag(true.matrix)[:, None]).max() < 0.01
    for a, b in zip(got.potentiometers, true.potentiometers, strict=True):
        # step of the ADC 0.34° at 345°, averaged by its noise of 0.6 of it; waviness 0.05°
        assert abs(a.angle(b.fraction(0.1)) - 0.1) < radians(0.2)
    backlash = [abs(parameters.plant.linkage[i][i]) for i in (0, 1)]
    for i, servo in enumerate(parameters.plant.servos[:2]):
        least = backlash[i] * servo.backlash
        # the servo's dead band on both sides comes on top
        assert least < got.hysteresis[i] < least + 0.444 * 2 * (servo.dead_band + radians(0.4))


def test_missing_switch_is_named():
    parameters = sample_rig(4)
    far = replace(parameters.sensors, switch_angle=(0.14, -9.0, 0.14, -0.14))
    with pytest.raises(CalibrationError, match="switch -x never closed"):
        calibrate(replace(parameters, sensors=far), QUICK)


@pytest.mark.thorough
def test_loose_potentiometer_is_named():
    fault = parse("potentiometer_y_b:stuck")
    with pytest.raises(CalibrationError, match=r"potentiometer_y_b turned 0\.0°"):
        calibrate(sample_rig(4), QUICK, injections=(fault,))


def _frame(switches=(False,) * 4):
    return SensorFrame(
        0, 0, (0.5,) * 4, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3,
        (1.5e-3, 1.5e-3, 0.0), switches, (0.0, 0.0), int(Flags.HOLDER_IMU),
    )  # fmt: skip


def _feed(procedure, switches, frames=2000):
    for k in range(frames):
        noise = (0.0, 0.0, 1e-4 * (k % 2))
        pulse = (*procedure._pulses, 0.0)
        frame = replace(_frame(switches(procedure)), device_us=2000 * k, gyro=noise, pulse=pulse)
        procedure.step(frame)


@pytest.mark.parametrize("minimal", [False, True])
@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("imu:unplug:100", "(0x68) does not answer; check VCC, GND, SDA, SCL and AD0"),
        ("imu:unplug:100@10", "(0x68) does not answer"),
        ("gyro:frozen", "(0x68) repeats one reading"),
    ],
)
def test_a_silent_imu_is_named_within_a_second(fault, says, minimal):
    rig, injections = replace(QUICK, minimal=minimal), (parse(fault),)
    with pytest.raises(CalibrationError, match=re.escape(says)):
        calibrate(sample_rig(4), rig, injections=injections)


def test_an_imu_that_is_away_for_less_than_a_second_spoils_nothing():
    fault = parse("imu:unplug:0.8@0.1")
    assert calibrate(sample_rig(4), QUICK, injections=(fault,)).gyro.matrix[0][0] > 0.9


def test_a_horn_one_tooth_off_is_thought_of_where_a_switch_is_closed_at_neutral():
    """A spline of 21 to 25 teeth: 17.1° to 14.4° a tooth, 7.6° of the gimbal by a gain of 0.444."""
    with pytest.raises(CalibrationError, match=r"\+x is closed at neutral.*a tooth is 15° to 18°"):
        calibrate(sample_rig(3), QUICK, injections=(parse("servo_x:slipped:17"),))


def stalled(parameters, rig, stall_ms, often):
    """Calibrate while the host takes no frame and sends nothing for a while, at random."""
    rng = np.random.default_rng(0)
    device = Emulator(parameters)
    seat = in_process(device, fuse=False)
    procedure = Procedure(rig, seat.connect().serial)
    while not procedure.done:
        device.advance_us(1000 * stall_ms if rng.random() < often else 10_000)
        pulses = [procedure.step(frame) for frame in seat.poll()]
        seat.send_pulses(*pulses[-1])
    return procedure.result()


@pytest.mark.parametrize(("stall_ms", "often"), [(70, 0.1), (300, 0.003)])
def test_frames_that_come_late_do_not_spoil_a_calibration(stall_ms, often):
    """The servos return to neutral 0.1 s after the last command; such an approach is repeated."""
    parameters = sample_rig(4)
    got, true = stalled(parameters, QUICK, stall_ms, often), exact_calibration(parameters)
    M = np.array(got.matrix)
    assert np.abs(M @ (np.array(got.zero) - true.zero)).max() < radians(0.15)
    assert np.abs((M - true.matrix) / np.diag(true.matrix)[:, None]).max() < 0.01


def test_a_computer_that_is_always_late_is_named_and_not_a_switch():
    with pytest.raises(CalibrationError, match=r"came late .* this computer is too busy"):
        stalled(sample_rig(4), QUICK, 300, 0.3)


def test_switch_closed_at_neutral_is_named():
    with pytest.raises(CalibrationError, match=r"switch \+y is closed at neutral"):
        _feed(Procedure(), lambda _: (False, False, True, False))


def test_swapped_plugs_are_named():
    def swapped(procedure):
        x, _ = procedure._pulses
        return (False, False, x > 1.6e-3, False)

    with pytest.raises(CalibrationError, match=r"\+y closed while servo x moved"):
        _feed(Procedure(), swapped)


def test_unfinished_run_has_no_result():
    procedure = Procedure()
    procedure.step(_frame())
    with pytest.raises(CalibrationError, match="not finished"):
        procedure.result()


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda log: _shift(log, 0, radians(3.0)), "not repeatable|closes|apart"),
        (lambda log: _shift(log, 3, radians(-3.0)), "not repeatable|closes|apart"),
        (lambda log: _scatter(log, 1), "switch -x is not repeatable"),
    ],
)
def test_implausible_switch_is_refused(spoil, words):
    with pytest.raises(CalibrationError, match=words):
        solve(spoil(_Rig(0).log()), RIG, 0)


def test_switches_that_the_gyro_finds_too_far_apart_are_told_with_both_distances():
    rig, x = _Rig(0), RIG.switch_angle[:2]
    told = replace(RIG, switch_angle=(*x, 0.9 * x[0], 0.9 * x[1]))
    rig.closing += np.array(told.switch_angle) - RIG.switch_angle
    rig.closing[0] += radians(3.0)
    apart = degrees((rig.closing[0] - rig.closing[1]) * rig.gyro[0, 0])
    with pytest.raises(CalibrationError) as caught:
        solve(rig.log(), told, 0)
    by = re.search(r"\+x and -x are (.*)° apart by the gyro, (.*)° by the", str(caught.value))
    assert by is not None
    assert float(by[1]) == pytest.approx(apart, abs=0.2)  # the bound on its scale, of 21°
    assert by[2] == "18.0"


@pytest.mark.parametrize(
    "mounted",
    [
        [[0, 1], [-1, 0]],
        [[0, -1], [1, 0]],
        [[-1, 0], [0, -1]],
        [[1, 0], [0, -1]],
        [[-1, 0], [0, 1]],
    ],
    ids=["quarter turn", "other quarter", "half turn", "chip to the motor", "and turned"],
)
def test_an_imu_that_is_mounted_another_way_round_is_refused(mounted):
    rig = _Rig(0)
    rig.gyro = np.array(mounted, float)
    with pytest.raises(CalibrationError, match="mounted another way round"):
        solve(rig.log(), RIG, 0)


def test_a_slight_turn_of_the_imu_is_measured():
    rig, turn = _Rig(0), radians(8.0)
    rig.gyro = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    gyro = solve(rig.log(), RIG, 0).gyro
    np.testing.assert_allclose(gyro.matrix, rig.gyro, atol=0.01)


@pytest.mark.parametrize(("place", "off", "says"), [(PLUS, 0.2, "+x"), (MINUS, -0.3, "-x")])
def test_a_switch_that_closes_off_its_place_is_told_with_the_angle(place, off, says):
    value = np.zeros(11)
    value[M1], value[place] = 1.0, radians(off)
    axis = SimpleNamespace(value=value, scatter=np.zeros(2 * len(RIG.offsets) * RIG.repeats * 2))
    with pytest.raises(CalibrationError, match=re.escape(f"switch {says} closes {off:+.2f}°")):
        _check_axis(0, axis, _Rig(0).log(), RIG)


def test_the_first_guess_is_exact_where_all_is_straight():
    """Pulses about the neutral ones, no hysteresis: M p − c is the switch's angle."""
    rng, wanted = np.random.default_rng(0), np.array([760.0, 30.0, 0.02])
    events = []
    for k, other in enumerate(rng.uniform(-8e-5, 8e-5, 12)):
        own = (RIG.switch_angle[k % 2] + wanted[2] - wanted[1] * other) / wanted[0]
        pulses = (RIG.neutral[0] + own, RIG.neutral[1] + other)
        reading = tuple(0.5 + g * RIG.switch_angle[k % 2] for g in (0.24, -0.23, 0, 0))
        events.append(Event(k % 2, True, pulses, pulses, reading, 0.0, (0.0,) * 3))
    guess = first_guess(tabulate(Log(events=events), RIG, 0))
    assert guess[[M1, M2, C]] == pytest.approx(wanted, rel=1e-9)
    assert guess[[OA, KA, OB, KB]] == pytest.approx([0.5, 0.24, 0.5, -0.23])


class _Moving(_Rig):
    """Switch -x sits loose in its holder: its angle differs at every approach."""

    def event(self, switch, closed, offset):
        own = self.closing[1]
        self.closing[1] += self.rng.normal(0, radians(0.7))
        event = super().event(switch, closed, offset)
        self.closing[1] = own
        return event


def test_a_loose_switch_is_not_taken_for_a_loose_potentiometer():
    with pytest.raises(CalibrationError, match="switch -x is not repeatable"):
        solve(_Moving(3).log(), RIG, 0)


def _shift(log, switch, angle):
    """Move one switch: potentiometers and pulses agree, the gyro's scale gives it away."""
    rig = _Rig(0)
    rig.closing = rig.closing.copy()
    rig.closing[switch] += angle
    return rig.log()


def _scatter(log, switch):
    rng = np.random.default_rng(0)
    events = [
        replace(e, pulses=(e.pulses[0] + rng.normal(0, 2e-5), e.pulses[1]))
        if e.switch == switch
        else e
        for e in log.events
    ]
    return replace_events(log, events)


def replace_events(log, events):
    return Log(events=events, gyro_bias=log.gyro_bias)


def test_pulses_and_angles_are_inverse(emulated):
    _, got = emulated
    for angle in [(0.0, 0.0), (0.1, -0.05), (-0.13, 0.13)]:
        np.testing.assert_allclose(got.angles(got.pulses(angle)), angle, atol=1e-15)


def test_map_sigma_is_zero_without_covariance_and_grows_with_angle():
    maps = [
        PotentiometerMap(0.5, radians(240)),
        PotentiometerMap(0.5, radians(240), ((1e-8, 0), (0, 1e-4))),
    ]
    exact, loose = (replace(nominal(), potentiometers=(m,) * 4) for m in maps)
    assert exact.potentiometer_sigma(0, 0.1) == 0
    assert loose.potentiometer_sigma(0, 0.2) > loose.potentiometer_sigma(0, 0.0) > 0


def test_deviation_and_linearisation_add_in_squares_to_the_map_of_the_pulses():
    bent = replace(nominal().linearisation, sigma=0.003)
    known = replace(nominal(), covariance=EXACT, deviation=(0.004, 0.0), linearisation=bent)
    assert known.sigma((0.1, -0.05)) == pytest.approx((0.005, 0.003))
    zero = replace(known, covariance=tuple(np.diag([4e-10, 0.0, 0.0, 0.0, 0.0, 0.0])))
    turned = 2e-5 * zero.matrix[0][0]  # 20 µs of zero
    assert zero.sigma((0.0, 0.0)) == pytest.approx((np.hypot(0.005, turned), 0.003))


def test_gyro_map_inverts_scale_and_misalignment():
    gyro = GyroMap(bias=(0.1, 0.2, 0.3), matrix=((1.02, 0.01), (-0.02, 0.97)))
    reading = np.array(gyro.matrix) @ [1.5, -0.7] + gyro.bias[:2]
    np.testing.assert_allclose(gyro.rates((*reading, 0.3)), (1.5, -0.7), atol=1e-12)
    assert degrees(gyro.bias_sigma) == pytest.approx(20.0)


def test_spread_of_the_designed_values_is_that_of_uniform_tolerances():
    """Trim ±40 µs and assembly ±1.5° of the gimbal; travel ±4 %, linkage ±4 % each way."""
    design = nominal()
    gain = design.matrix[0][0]
    zero = np.hypot(40e-6, radians(1.5) / gain) / np.sqrt(3)
    own, across = gain * np.hypot(0.04, 0.04) / np.sqrt(3), gain * 0.04 / np.sqrt(3)
    sigmas = np.sqrt(np.diag(design.covariance))
    # stated with two digits
    assert sigmas == pytest.approx([zero, zero, own, across, across, own], rel=0.03)
