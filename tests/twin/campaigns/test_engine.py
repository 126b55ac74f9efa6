"""Rows are those of single flights; nothing is lost or flown twice, whatever dies."""

import errno
import os
import re
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.twin.campaigns.studies import HIT, flown, linear, place, study
from twin.campaigns.campaign import campaign
from twin.campaigns.flying import engine as engine_module
from twin.campaigns.flying.runs import Runs
from twin.campaigns.flying.runs import flown as real
from twin.campaigns.flying.store import Store, column
from twin.campaigns.sampling.parameters import binding
from twin.campaigns.sampling.study import read
from twin.config import Fly
from twin.config.campaign import Campaign
from twin.errors import DivergenceError, TwinError
from twin.experiments.flight.fly import fly as once
from twin.experiments.flight.ticks import compiled_ticks
from twin.experiments.flights import fly
from twin.plant.compiled import compiled

MIXED = """
[fly]
programme = "point"
target_range_m = 30
off_axis_deg = [10, 0]
duration_s = {duration}

[vary.gimbal]
distribution = "choice"
values = ["linkage", "transfer-function"]

[vary.vehicle]
distribution = "choice"
values = ["{folder}/vehicle.xml", "{folder}/examples/reference.toml"]

[vary.wind_speed]
distribution = "normal"
mean = 3
sd = 1

[vary.wind_turbulence]
distribution = "uniform"
low = 0.1
high = 0.3

[vary."off_axis_deg[1]"]
distribution = "uniform"
low = -10
high = 10

[vary."motor.thrust_scale"]
distribution = "normal"
mean = 1
sd = 0.02

[design]
n = {n}
seed = 4
"""
MJCF = Path(__file__).parents[3] / "mjcf"


def mixed(folder: Path, n: int, duration: float):
    return study(folder, MIXED.format(n=n, duration=duration, folder=MJCF))


def compared(folder: Path, n: int, duration: float) -> None:
    """Rows of a campaign against `twin fly` with the values that the row shows."""
    s = mixed(folder, n, duration)
    runs = Runs(s)
    bound = binding(s.fly, s.vary)
    nominal = dict(bound.nominal["motor.thrust_scale"])
    work = real(s, runs, bound, folder)
    with compiled():
        for run in range(n):
            row = work(run)
            assert row["outcome"] != "refused", row["reason"]
            single = fly(
                Fly(
                    programme="point", target_range_m=30, duration_s=duration, seed=run,
                    off_axis_deg=(10, row["off_axis_deg[1]"]), gimbal=row["gimbal"],
                    vehicle=row["vehicle"], out=folder / "single.rrd",
                    set={
                        "wind_speed": row["wind_speed"], "wind_turbulence": row["wind_turbulence"],
                        **{k: v * row["motor.thrust_scale"] for k, v in nominal.items()},
                    },
                )
            ).as_dict()  # fmt: skip
            for name in ("closest_approach_m", "max_speed_m_s", "end_east_m", "end_north_m",
                         "attitude_error_rms_deg", "physics_steps", "flight_time_s"):  # fmt: skip
                assert row[name] == single[name], (run, name)


def test_rows_equal_single_flights_to_the_last_bit(tmp_path):
    compared(tmp_path, n=2, duration=0.1)


@pytest.mark.slow
def test_two_hundred_rows_of_mixed_gimbals_and_vehicles_equal_single_flights(tmp_path):
    compared(tmp_path, n=200, duration=10.0)


def _figures(config: Fly) -> dict[str, object] | str:
    try:
        result = once(config, recorded=False).as_dict()
    except DivergenceError as error:
        return str(error)
    return {k: v for k, v in result.items() if k not in ("physics_s", "cpu_s", "wall_s")}


@pytest.mark.parametrize(
    "settings",
    [
        {"programme": "point", "target_range_m": 3.0, "duration_s": 2.0},
        {"programme": "step", "gimbal": "transfer-function", "at_s": 0.1, "integrator": "rk4"},
        {"gimbal": "linkage", "control_hz": 50.0, "launch": "hand"},
        {"vehicle": MJCF / "examples" / "flights" / "valetudo.toml", "integrator": "euler"},
        {"set": {"gimbal_closure_limit": 3e-6}},  # the rods come apart
        {"programme": "point", "set": {"wind_speed": 2000.0}},  # past the stops
    ],
)
def test_ticks_in_compiled_code_equal_those_in_python(settings, monkeypatch):
    config = Fly.of({"duration_s": 0.3, **settings})
    ends = []

    def noted(*given):
        ends.append(compiled_ticks(*given))
        return ends[-1]

    with compiled():
        monkeypatch.setattr("twin.experiments.flight.fly.compiled_ticks", noted)
        quick = _figures(config)
        assert None not in ends  # it was flown there
        monkeypatch.setattr("twin.experiments.flight.fly.compiled_ticks", lambda *_: None)
        assert _figures(config) == quick


@pytest.mark.thorough
def test_a_campaign_writes_rows_and_answers(tmp_path):
    text = MIXED.format(n=3, duration=0.1, folder=MJCF) + '[measure]\nfast = "max_speed_m_s > 0"\n'
    (tmp_path / "short.toml").write_text(text)
    place_of = str(tmp_path / "short.toml")
    result = campaign(Campaign("run", place_of, workers=2, out=tmp_path / "out"))
    assert (result.runs, result.planned, result.new) == (3, 3, 3)
    assert result.answers.outcomes == {"time": 3}
    assert result.answers.estimates["fast_rate"].value == 1.0
    results = str(tmp_path / "out")  # stands for the study
    again = campaign(Campaign("resume", results, paths=2))
    assert (again.runs, again.new) == (3, 0)
    assert Path(again.recording).stat().st_size > 1000
    flight = campaign(Campaign("refly", results, 1))
    assert re.fullmatch(r"run-1-\d{8}-\d{6}\.rrd", Path(flight.recording).name)
    s = read(place_of)
    rows = Store(tmp_path / "out", s, 3, {c: str if c in ("gimbal", "vehicle") else float
                                          for c in Runs(s).columns}).table()  # fmt: skip
    assert Path(flight.recording).is_file()
    assert column(rows, "max_speed_m_s")[1] == flight.max_speed_m_s


def test_a_killed_worker_costs_one_run_alone(tmp_path):
    s = study(tmp_path, linear(40))
    runs = Runs(s)
    good = place(s, runs)

    def work(run):
        if run == 13:
            os.kill(os.getpid(), signal.SIGKILL)
        return good(run)

    table = flown(s, tmp_path / "out", work).table()
    assert table["run"].to_pylist() == list(range(40))
    outcomes = table["outcome"].to_pylist()
    assert outcomes[13] == "crashed"
    assert outcomes.count("point") == 39


def killed(s, folder: Path, after: float) -> None:
    """Fly in a process that is ended by force after so many seconds."""
    good = place(s, Runs(s))

    def work(run):
        time.sleep(0.001)
        return good(run)

    pid = os.fork()
    if pid == 0:
        flown(s, folder, work)
        os._exit(0)
    time.sleep(after)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)


@pytest.mark.parametrize("kills", [2, pytest.param(10, marks=pytest.mark.slow)])
def test_a_campaign_killed_and_resumed_equals_an_uninterrupted_one(tmp_path, kills):
    s = study(tmp_path, linear(120, HIT))
    whole = flown(s, tmp_path / "whole").table()
    rng = np.random.default_rng(7)
    for _ in range(kills):
        killed(s, tmp_path / "out", rng.uniform(0.02, 0.2))
    resumed = flown(s, tmp_path / "out")
    assert resumed.table().equals(whole)
    for _ in range(100):  # children of the killed ones end at their next run
        if not (left := list((tmp_path / "out" / "rows").glob("*.partial"))):
            break
        time.sleep(0.05)
    assert not left


def test_a_full_disk_ends_in_one_line_and_is_resumed(tmp_path, monkeypatch):
    s = study(tmp_path, linear(40))
    write = Store.write

    def full(self, part, rows):
        if part == 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(self, part, rows)

    monkeypatch.setattr(Store, "write", full)
    with pytest.raises(TwinError, match=r"part-000003.parquet: No space left on device; .* resume"):
        flown(s, tmp_path / "out", workers=1)
    monkeypatch.undo()
    assert flown(s, tmp_path / "out").table()["run"].to_pylist() == list(range(40))


def test_a_stop_leaves_the_same_runs_however_many_fly_at_a_time(tmp_path):
    stop = '[stop]\nstatistic = "end_east_m_mean"\nhalf_width = 0.75\n'
    s = study(tmp_path, linear(96, stop))
    one = flown(s, tmp_path / "one", workers=1).table()
    three = flown(s, tmp_path / "three", workers=3).table()
    assert one.equals(three)
    # (1.96 · 3 / 0.75)² = 61 runs
    assert 50 <= one.num_rows <= 88


def test_results_of_another_study_or_version_are_refused(tmp_path, monkeypatch):
    s = study(tmp_path, linear(16))
    flown(s, tmp_path / "out")
    other = study(tmp_path, linear(16, seed=1), "other")
    with pytest.raises(TwinError, match="results of another study"):
        Store(tmp_path / "out", other, 16, {}).check()
    with pytest.raises(TwinError, match=r"another study \('study'\).* with --out or --force"):
        Store(tmp_path / "out", other, 16, {}).begin(force=False)
    monkeypatch.setattr("twin.campaigns.flying.store.versions", lambda: {"mujoco": "9"})
    with pytest.raises(TwinError, match="was flown with other versions"):
        Store(tmp_path / "out", replace(s, digest=""), 16, {}).check()


@pytest.mark.parametrize("n", [8, 24])  # one fragment, and three
def test_a_campaign_run_again_keeps_its_flights_and_flies_what_is_missing(
    tmp_path, monkeypatch, capsys, n
):
    s = study(tmp_path, linear(n))
    work, flights = place(s, Runs(s)), tmp_path / "flights"

    def seen(run):
        with flights.open("a") as file:  # of several processes
            file.write(f"{run}\n")
        return work(run)

    monkeypatch.setattr("twin.campaigns.campaign.flown", lambda *_: seen)
    monkeypatch.setattr("twin.campaigns.campaign._warm_up", lambda _: None)
    run = Campaign("run", s.place, out=tmp_path / "out")
    first = campaign(run)
    rows = first.as_dict()["estimates"]
    assert first.new == n
    flights.unlink()
    again = campaign(run)
    assert (again.new, again.runs, again.cpu_s) == (0, n, None)
    assert not flights.exists()
    assert f"all {n} flights are already there" in capsys.readouterr().err
    assert again.as_dict()["estimates"] == rows
    (tmp_path / "out/rows/part-000000.parquet").unlink()
    assert campaign(run).new == 8
    assert sorted(map(int, flights.read_text().split())) == list(range(8))
    flights.unlink()
    assert campaign(replace(run, force=True)).new == n
    other = study(tmp_path, linear(n, seed=1), "other")
    with pytest.raises(TwinError, match=r"another study \('study'\).* with --out or --force"):
        campaign(replace(run, study=other.place))


def test_the_processor_time_of_a_flight_is_what_it_took(tmp_path, monkeypatch):
    s, took = study(tmp_path, linear(8)), 0.1
    work = place(s, Runs(s))

    def busy(run):
        ended = time.process_time() + took
        while time.process_time() < ended:
            pass
        return work(run)

    monkeypatch.setattr("twin.campaigns.campaign.flown", lambda *_: busy)
    monkeypatch.setattr("twin.campaigns.campaign._warm_up", lambda _: None)
    made = campaign(Campaign("run", s.place, out=tmp_path / "out"))
    assert 1.0 <= made.cpu_s / (8 * took) < 1.2  # writing the rows counts
    assert f" {made.cpu_s / 8:.2g} s of processor time each" in made.text()
    again = campaign(Campaign("report", s.place, out=tmp_path / "out"))
    assert again.cpu_s is None
    assert "processor time" not in again.text()


@pytest.mark.parametrize("out", [None, "runs/study/one.rrd"])
def test_a_run_of_a_changed_study_is_not_flown_for_the_stored_rows(tmp_path, monkeypatch, out):
    monkeypatch.chdir(tmp_path)
    flown(study(tmp_path, linear(8)), Path("runs/study"))
    study(tmp_path, linear(8, seed=1))
    with pytest.raises(TwinError, match="or this one was changed"):
        campaign(Campaign("refly", "study.toml", 3, out=out and Path(out)))


def test_a_damaged_fragment_is_one_line(tmp_path):
    s = study(tmp_path, linear(16))
    store = flown(s, tmp_path / "out")
    store.file(1).write_bytes(b"PAR1 nothing PAR1")
    with pytest.raises(TwinError, match=r"part-000001.parquet: "):
        store.table()


def test_a_process_that_cannot_fly_at_all_is_reported(tmp_path, monkeypatch):
    s = study(tmp_path, linear(16))
    monkeypatch.setattr(engine_module.Engine, "_fly", lambda *_: os._exit(1))
    with pytest.raises(TwinError, match="before its first"):
        flown(s, tmp_path / "out")
