"""Fixtures of the twin's tests."""

import pytest

from hardware.fusion import BaseMap
from twin.hil import connect

CHECK, MEASURE = connect.check_motion, connect.measure_base


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
