"""Fixtures of the twin's tests."""

import hashlib

import mujoco
import numpy as np
import pytest

from hardware.fusion import BaseMap
from twin.hil import connect
from twin.recorder import lifetime
from twin.recorder.scene import poses

CHECK, MEASURE = connect.check_motion, connect.measure_base
BODIES, MESHES = poses.bodies, {}


@pytest.fixture(scope="session", autouse=True)
def prompt():
    """Begin runs with a simulated rig at once, in fixtures as well.

    What is left out is the motion check, 1.6 s of the rig, and turning a turntable to know its
    base, 3.2 s; the nominal base is then taken as known. The noise of a rig goes on during the
    check: outside of the tests the same run, to the last bit, is that with `no_check`.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(connect, "check_motion", lambda seat: None)
        patch.setattr(connect, "measure_base", lambda seat: BaseMap())
        yield


@pytest.fixture(autouse=True)
def complete(request, monkeypatch):
    """Do what `prompt` leaves out in tests marked `checked` and `measured`."""
    if request.node.get_closest_marker("checked") is not None:
        monkeypatch.setattr(connect, "check_motion", CHECK)
    if request.node.get_closest_marker("measured") is not None:
        monkeypatch.setattr(connect, "measure_base", MEASURE)


@pytest.fixture(scope="module", autouse=True)
def plain(request):
    """Leave the viewer's layout out of recordings and make the meshes of equal models once.

    Both take more time than a short run itself; modules marked `looks` record everything anew.
    """
    with pytest.MonkeyPatch.context() as patch:
        if request.node.get_closest_marker("looks") is None:
            patch.setattr(lifetime, "show", lambda stream, look: None)
            patch.setattr(poses, "bodies", _once)
        yield


def _once(model):
    content = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, content)
    key = hashlib.sha256(content).digest()
    if key not in MESHES:
        MESHES[key] = BODIES(model)
    return MESHES[key]
