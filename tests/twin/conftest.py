"""Fixtures of the twin's tests."""

import pytest


@pytest.fixture(autouse=True)
def unchecked(request, monkeypatch):
    """Leave out the motion check before a run, 1.6 s of a simulated rig, where it is not tested.

    The noise of a rig goes on during the check: outside of the tests the same run, to the last bit,
    is that with `no_check`.
    """
    if request.node.get_closest_marker("checked") is None:
        monkeypatch.setattr("twin.hil.connect.check_motion", lambda seat: None)
