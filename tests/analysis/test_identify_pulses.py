"""Pulses of a rig for its commands: a made-up rig whose frames, map and motion are closed forms."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from analysis.identify import IdentificationError, identify_gimbal
from analysis.identify.pulses import asked, by_frames, by_pulses, pulse_frames
from analysis.recording import Recording, TimeSeries, measurement_of
from hardware.protocol import Flags

FRAME, OMEGA, ZETA, DELAY = 0.02, 60.0, 0.6, 0.004


@dataclass(frozen=True)
class Rig:
    """Its device clock runs at `pace` and read `boot` when the experiment began [s]."""

    boot: float = 1.2345
    pace: float = 1.002
    late: float = 0.0012  # from a command to the device
    phase: float = 0.0  # of the frames on the device's clock
    age: float = 0.0011  # of the frame at the first reading in it
    lost: float = 0.03

    def recording(self, seed: int = 0, spoil: float = 0.0) -> Recording:
        rng = np.random.default_rng(seed)
        times = np.arange(0.0, 12.0, 0.002)
        levels = wanted(times)
        device_frames = np.arange(math.floor(self.boot / FRAME), 700) * FRAME + self.phase
        begin = (device_frames - self.boot) / self.pace
        row = np.searchsorted(times, begin - self.late + 1e-9, side="right") - 1
        told = np.where(row[:, None] < 0, 0.0, levels[np.clip(row, 0, None)])
        told[rng.random(len(told)) < spoil] = 0.05
        pulse = ticks(1.5e-3 + 1.2e-3 * told + 0.9e-3 * told**2 + 8e-5 * told[:, ::-1])
        asked_for = told
        device = np.arange(self.boot - self.boot % 0.002 + self.age, 13.2, 0.002)
        device = device[(device > self.boot) & (rng.random(len(device)) > self.lost)]
        stamp = (device - self.boot) / self.pace
        frame = np.searchsorted(begin, stamp + 1e-9, side="right") - 1
        angle = moved(begin, asked_for, stamp) + rng.normal(0.0, 1e-4, (len(stamp), 2))
        two, three = ("x", "y"), ("x", "y", "turntable")
        third = np.insert(pulse[frame], 2, 1.5e-3, axis=1)
        series = [
            TimeSeries("gimbal/command", times, levels, "rad", two),
            TimeSeries("gimbal/measured", stamp, angle, "rad", two),
            TimeSeries("sensors/pulse", stamp, third, "s", three),
            TimeSeries("sensors/device_time", stamp, device[:, None], "s", ("time",)),
        ]
        return Recording({}, {s.name: s for s in series})

    @property
    def first(self) -> float:
        """When the first frame after the start began [s]."""
        return (math.ceil(self.boot / FRAME) * FRAME + self.phase - self.boot) / self.pace


def wanted(times):
    """Six lines from 0.7 to 7.9 Hz, three an axis."""
    lines = np.array([[0.7, 3.1, 7.9], [1.1, 4.7, 6.7]])
    return 0.03 * np.sin(2 * np.pi * times[:, None, None] * lines + np.arange(3)).sum(axis=2)


def ticks(pulse):
    return np.round(pulse / 0.5e-6) * 0.5e-6


def moved(begin, told, times):
    """Second order after a delay, as a sum of closed-form step responses."""
    damped = OMEGA * math.sqrt(1.0 - ZETA**2)
    out = np.zeros((len(times), 2))
    for at, jump in zip(begin, np.diff(told, axis=0, prepend=0.0), strict=True):
        t = np.clip(times - at - DELAY, 0.0, None)
        swing = np.cos(damped * t) + ZETA * OMEGA / damped * np.sin(damped * t)
        out += (1.0 - np.exp(-ZETA * OMEGA * t) * swing)[:, None] * jump
    return out


def test_frames_begin_where_the_device_clock_passes_a_multiple_of_twenty_milliseconds():
    """Readings that first show a pulse are 1 to 3 ms late; 1 µs: rounding of the straight line."""
    for age in (0.0004, 0.0011, 0.0019):
        rig = Rig(age=age)
        frames = pulse_frames(rig.recording(), ("x", "y"), "run")
        assert np.abs(frames.begin - rig.first).min() < 1e-6
        np.testing.assert_allclose(np.diff(frames.begin), FRAME / rig.pace, atol=1e-9)


def test_where_the_clock_is_no_multiple_the_readings_tell_the_phase():
    """Half a reading, 1 ms: a new pulse is seen up to 2 ms late."""
    rig = Rig(phase=0.0071)
    frames = pulse_frames(rig.recording(), ("x", "y"), "run")
    assert np.abs(frames.begin - rig.first).min() < 1.0e-3 + 1e-6


@pytest.mark.parametrize("spoil", [0.0, 0.02])
def test_pulses_are_turned_back_into_the_commands_they_carried(spoil):
    """0.0003 rad: half a timer tick of 0.5 µs; frames that carried something else are kept as such.

    The latest command is known to 2 ms, which is how often there is one.
    """
    rig = Rig()
    recording = rig.recording(spoil=spoil)
    frames = pulse_frames(recording, ("x", "y"), "run")
    r = measurement_of(recording)
    found, late = asked(frames, r.command.held, "run")
    assert late == pytest.approx(rig.late, abs=1.1e-3)
    sent = np.floor((frames.begin - rig.late) / 0.002 + 1e-6).clip(0) * 0.002
    off = np.abs(found - wanted(sent)).max(axis=1)[1:]  # the first frame began before the commands
    assert np.mean(off > 3e-4) <= 1.5 * spoil


@pytest.mark.thorough
def test_a_model_from_pulses_is_that_of_the_servo_without_the_wait():
    """Made with 4 ms: commands add 10 ± 1 ms of wait and a bad fit, pulses nothing. 1 %: noise."""
    recording = Rig().recording()
    by_pulse = identify_gimbal([by_pulses(measurement_of(recording))])
    by_command = identify_gimbal([measurement_of(recording)])
    for axis in "xy":
        value = {k: by_pulse.estimate(f"{axis}/{axis} {k}").value for k in ("gain", "damping")}
        assert value == pytest.approx({"gain": 1.0, "damping": ZETA}, rel=0.01)
        omega = by_pulse.estimate(f"{axis}/{axis} natural frequency").value
        assert omega == pytest.approx(OMEGA, rel=0.01)
        own, both = (m.estimate(f"{axis}/{axis} delay").value for m in (by_pulse, by_command))
        assert own == pytest.approx(DELAY, abs=2e-4)
        assert both == pytest.approx(DELAY + 0.0012 + FRAME / 2, abs=1.5e-3)
    assert by_pulse.fit > 99.5 > by_command.fit


def test_pulses_that_follow_no_command_are_refused():
    recording = Rig().recording(spoil=0.5)
    with pytest.raises(IdentificationError, match="% of the pulses do not follow the commands"):
        by_pulses(measurement_of(recording))


def test_pulses_of_a_board_that_does_not_report_when_they_begin_are_refused():
    whole = Rig().recording()
    time = whole["sensors/pulse"].time
    flags = np.full((len(time), 1), float(Flags.ARMED | Flags.PULSE_UNTIMED))
    flags[0] = np.nan
    series = {
        **whole.series,
        "sensors/flags": TimeSeries("sensors/flags", time, flags, "1", ("f",)),
    }
    with pytest.raises(IdentificationError, match="Raspberry Pi"):
        by_pulses(measurement_of(Recording({}, series)))
    sure = TimeSeries("sensors/flags", time, np.ones_like(flags), "1", ("f",))
    by_pulses(measurement_of(Recording({}, {**series, "sensors/flags": sure})))


def test_a_recording_without_a_rig_has_no_pulses():
    whole = Rig().recording()
    series = {k: v for k, v in whole.series.items() if k.startswith("gimbal")}
    with pytest.raises(IdentificationError, match="no sensors/pulse"):
        by_pulses(measurement_of(Recording({}, series)))


@pytest.mark.parametrize(
    ("rig", "wait"),
    [
        (Rig(), 0.0112),  # its clock drifts through all phases: 10 ms, and the way to the device
        (Rig(boot=1.24, pace=1.0, late=0.0), 0.009),  # 0, 2 … 18 ms
        (Rig(boot=1.24, pace=1.0, late=0.0004), 0.011),  # 2, 4 … 20 ms
    ],
)
def test_a_delay_from_commands_is_that_of_the_gimbal_and_the_mean_wait_for_a_frame(rig, wait):
    """Commands every 2 ms; the way to the device is searched in steps of 0.25 ms."""
    run = measurement_of(rig.recording()).between(0.5, 12.0)  # its first command is a jump
    run = replace(run, initial="free")
    model = identify_gimbal(by_frames([run]), coupling="none")
    for axis in "xy":
        value = {k: model.estimate(f"{axis}/{axis} {k}").value for k in ("gain", "damping")}
        assert value == pytest.approx({"gain": 1.0, "damping": ZETA}, rel=0.01)
        delay = model.estimate(f"{axis}/{axis} delay")
        assert delay.value == pytest.approx(DELAY + wait, abs=2.5e-4)
    assert model.fit > 99.0


def test_a_recording_whose_pulses_are_not_timed_keeps_the_stamps_of_its_commands():
    recording = Rig().recording()
    run = measurement_of(recording)
    none = {k: v for k, v in recording.series.items() if k.startswith("gimbal")}
    for other in (Recording({}, none), Rig().recording(spoil=0.5)):
        r = measurement_of(other)
        assert by_frames([r])[0] is r
    assert by_frames([run])[0] is not run


def test_a_gap_in_the_readings_is_no_wait():
    """0.1 s of readings are lost: a wait across it would move the middle by 40 ms."""
    whole = Rig().recording()
    lost = {
        k: v if k == "gimbal/command" else v.rows((v.time < 5.0) | (v.time > 5.1))
        for k, v in whole.series.items()
    }
    both = [by_frames([measurement_of(r)])[0].command.time[0] for r in (whole, Recording({}, lost))]
    assert both[1] == pytest.approx(both[0], abs=2.5e-4)
