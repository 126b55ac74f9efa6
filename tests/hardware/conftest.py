"""Fixtures of the boards' tests."""

from pathlib import Path

import pytest

from tests.hardware.core import Core, build


@pytest.fixture(scope="session")
def core_program(tmp_path_factory) -> Path:
    """The firmware's core on the host, built once under ASan and UBSan."""
    return build(tmp_path_factory.mktemp("core"))


@pytest.fixture(scope="module")
def running(core_program) -> Core:
    """The core in a separate process; `fresh()` makes a new `Gimbal`."""
    core = Core.start(core_program)
    yield core
    core.stop()
