"""Models of unknown origin: one line within limits, whatever a file asks MuJoCo for."""

import os
import signal
import subprocess
import sys
import time

import pytest

from analysis import limited
from tests.conftest import ROOT
from twin.errors import TwinError
from twin.physics import guard
from twin.plant.model.compose import compose
from twin.plant.model.model import ModelConfig, load

pytestmark = pytest.mark.started

HOSTILE = ROOT.parent / "shared" / "cases" / "hostile"
GEOM = '<geom size="1"/>'
FREE = f"<body><freejoint/>{GEOM}</body>"
TEN = '<replicate count="10">'
MODELS = {
    "cells": '<asset><hfield name="h" nrow="40000" ncol="40000" size="1 1 1 1"/></asset>',
    "texels": '<asset><texture type="cube" builtin="flat" width="90000" height="90000"/></asset>',
    "nested": f"<worldbody>{TEN * 5}{GEOM}{'</replicate>' * 5}</worldbody>",
    "attached": '<asset><model name="m" file="part.xml"/></asset><worldbody>'
    f'{TEN * 4}<attach model="m" body="b" prefix="p"/>{"</replicate>" * 4}</worldbody>',
    "flexcomp": '<worldbody><flexcomp name="f" count="100 100 100" spacing="1 1 1"/></worldbody>',
    "composite": '<worldbody><composite type="cable" count="1000000 1 1"/></worldbody>',
    "infinite": f'<worldbody><replicate count="1e999">{GEOM}</replicate></worldbody>',
    "wide": f"<worldbody>{GEOM * 21_000}</worldbody>",
    "free": f"<size memory='60M'/><worldbody>{FREE * 3000}</worldbody>",
    "free copies": f"<size memory='60M'/><worldbody><replicate count='3000'>{FREE}</replicate>"
    "</worldbody>",
    "hinges": f"<worldbody><body>{GEOM}{'<joint/>' * 1300}</body></worldbody>",
    "fixed": f"<worldbody>{f'<body>{GEOM}</body>' * 3000}</worldbody>",
    "deep": f"<worldbody>{'<body>' * 80}{'</body>' * 80}</worldbody>",
    "itself": '<include file="itself.xml"/>',
    "pair": '<asset><model name="m" file="pair_other.xml"/></asset>',
    "device": '<asset><mesh name="m" file="zero.stl"/></asset>',
    "fifo": '<asset><hfield name="m" file="fifo.png" size="1 1 1 1"/></asset>',
    "large": f"<worldbody>{' ' * 4_000_000}</worldbody>",
    "picture": '<asset><texture name="t" type="2d" file="wide.png"/></asset>',
    "clockless": '<option timestep="0"/>',
    "slow": '<option timestep="1"/>',
}
TRIED = {
    "memory": ('<size memory="900G"/>', "memory"),
    "user data": ('<size nuserdata="2000000000"/>', "memory"),
    "nan step": ('<option timestep="nan"/>', "NaN"),
    "nan place": (f'<worldbody><body pos="nan 0 0">{GEOM}</body></worldbody>', "NaN"),
}


@pytest.fixture
def folder(tmp_path):
    for name, text in MODELS.items():
        (tmp_path / f"{name}.xml").write_text(f"<mujoco>{text}</mujoco>")
    (tmp_path / "pair_other.xml").write_text(
        f"<mujoco>{MODELS['pair']}</mujoco>".replace("_other", "")
    )
    (tmp_path / "part.xml").write_text(
        f'<mujoco><worldbody><body name="b">{GEOM * 10}</body></worldbody></mujoco>'
    )
    head = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR" + 2 * (15_000).to_bytes(4, "big")
    (tmp_path / "wide.png").write_bytes(head)
    (tmp_path / "zero.stl").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "fifo.png")
    return tmp_path


@pytest.mark.parametrize("name", [n for n in MODELS if n not in ("clockless", "slow")])
def test_a_model_beyond_a_limit_is_refused_before_mujoco_sees_it(folder, name, monkeypatch):
    monkeypatch.setattr(limited, "run", lambda *_, **__: pytest.fail("compiled"))
    with pytest.raises(TwinError) as caught:
        compose(str(folder / f"{name}.xml"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["clockless", "slow"])
def test_a_time_step_that_no_run_can_have_is_refused(folder, name):
    with pytest.raises(TwinError, match=r"timestep of (0|1) s must lie in 0 < timestep"):
        load(ModelConfig(scene=str(folder / f"{name}.xml")))


@pytest.mark.parametrize("name", TRIED)
def test_what_only_mujoco_notices_is_refused_in_one_line(name, tmp_path, capfd):
    text, says = TRIED[name]
    path = tmp_path / "own.xml"
    path.write_text(f"<mujoco>{text}</mujoco>")
    with pytest.raises(TwinError, match=rf"own\.xml: .*{says}") as caught:
        load(ModelConfig(scene=str(path)))
    assert "\n" not in str(caught.value) + capfd.readouterr().err


def test_shipped_models_are_not_compiled_twice(monkeypatch):
    monkeypatch.setattr(limited, "run", lambda *_, **__: pytest.fail("compiled"))
    for scene in ("flight", "bench", "turntable"):
        compose(scene)
    compose("flight", guard.SHIPPED / "examples" / "large_rocket.xml")
    compose("flight", guard.SHIPPED / "examples" / "reference.toml")
    compose("bench", mechanism=guard.SHIPPED / "examples" / "direct_drive.xml")


def test_a_model_is_tried_once_for_each_content(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    asked = []
    monkeypatch.setattr(limited, "run", lambda *_, **__: asked.append(1) or b"")
    path = tmp_path / "scene.xml"
    path.write_text(f"<mujoco><worldbody>{GEOM}</worldbody></mujoco>")
    compose(str(path))
    monkeypatch.setattr(guard, "_approved", set())  # another process
    compose(str(path))
    assert len(asked) == 1
    path.write_text(f"<mujoco><worldbody>{GEOM * 2}</worldbody></mujoco>")
    compose(str(path))
    assert len(asked) == 2


TRIAL = "tests.twin.plant.trials"


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("crash", "crashes its reader"),
        ("spin", "takes longer than 1 s"),
        ("memory", "more memory"),
        ("write", "crashes its reader"),
        ("refuse", "no good"),
    ],
)
def test_a_process_with_limits_ends_with_one_line(what, said):
    with pytest.raises(limited.LimitError, match=said):
        limited.run(TRIAL, what.encode(), seconds=1.0, megabytes=200)
    if what == "refuse":
        assert limited.run(TRIAL, b"echo", seconds=1.0, megabytes=200) == b"echo"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_process_and_the_one_with_limits_at_once(tmp_path, number):
    program = (
        "import signal, sys; from analysis import limited\n"
        "signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell may ignore it
        "print('ready', flush=True)\n"
        f"limited.run({TRIAL!r}, {str(tmp_path / 'pid')!r}.encode(), seconds=60, megabytes=200)"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    pid = tmp_path / "pid"
    while not (pid.exists() and pid.read_text()):
        time.sleep(0.02)
    process.send_signal(number)
    process.communicate(timeout=5)
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)


@pytest.mark.skipif(not HOSTILE.is_dir(), reason="../shared/cases is not on this machine")
@pytest.mark.parametrize("arguments", [{"scene": "model_self"}, {"mechanism": "replicate"}])
def test_models_that_broke_the_program_are_refused_in_one_line(arguments):
    files = {k: HOSTILE / f"{v}.xml" for k, v in arguments.items()}
    files = {k: str(v) if k == "scene" else v for k, v in files.items()}
    with pytest.raises(TwinError, match=r"refers to itself|expands to more than") as caught:
        load(ModelConfig(**{"scene": "bench", **files}))
    assert "\n" not in str(caught.value)
