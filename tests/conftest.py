"""Fixtures every room's tests may use."""

import functools
import gc
import os
import signal
import time
from pathlib import Path

import pytest
from hypothesis import settings

# before NumPy is imported: threads of BLAS on processors that other tests use wait for each other,
# which costs a hundred times what a small matrix takes
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# a shell starts what runs in its background with SIGINT ignored, and tests interrupt programs
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# no deadline: a loaded machine is no mistake; `make abuse` tries readers more often
settings.register_profile("suite", max_examples=25, deadline=None)
settings.load_profile("suite")

# collecting 3600 tests and simulating rigs makes many objects and hardly any garbage
gc.set_threshold(20_000, 20, 20)

ROOT = Path(__file__).resolve().parents[1]
LONG = "test_viewer.py", "test_knowledge.py", "test_examples.py"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files of the longest tests: at the end no process waits for another's."""
    items.sort(key=lambda item: item.path.name not in LONG)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real measurements beside the checkout; the test is skipped where it is absent."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("real measurements (../shared/data) are not on this machine")
    return folder


@pytest.fixture(scope="module", autouse=True)
def settled():
    """Set aside what the modules before have left alive.

    A real-time loop has the collector look at everything once before it begins, which takes a
    second in a process as full as a whole suite's and an instant in a user's.
    """
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def nursery():
    """The process that `analysis.limited` forks from in tests."""
    from tests import confined  # imports NumPy

    made = confined.Nursery()
    yield made
    made.close()


@pytest.fixture(scope="module", autouse=True)
def quick_limits(request, nursery):
    """Fork the processes with limits, but in modules marked `started`."""
    if request.node.get_closest_marker("started") is not None:
        yield
        return
    with nursery.at_work():
        yield


def patient(test):
    """Mark a test of wall-clock time as `realtime`; it passes if one of ten tries does.

    Other processes may take the processor in any of them; a mistake in the code fails all ten.
    """

    @functools.wraps(test)
    def tried(*args, **kwargs):
        for _ in range(9):
            try:
                return test(*args, **kwargs)
            except AssertionError:
                time.sleep(0.1)
        return test(*args, **kwargs)

    return pytest.mark.realtime(tried)
