"""A port that may not be opened, by the operating system's own refusal."""

import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

UNPRIVILEGED = 65534
OPEN = """
import os, sys
from hardware.link import Link, LinkError
if os.geteuid() == 0:
    os.seteuid(int(sys.argv[2]))  # root may open everything
try:
    Link(sys.argv[1])
except LinkError as error:
    print(error)
"""


@pytest.mark.skipif(os.name != "posix", reason="no pseudo-terminals here")
def test_a_forbidden_port_is_reported_with_the_remedy():
    ours, theirs = pty.openpty()
    name = os.ttyname(theirs)
    Path(name).chmod(0)
    done = subprocess.run(
        [sys.executable, "-c", OPEN, name, str(UNPRIVILEGED)],
        cwd=ROOT, capture_output=True, text=True, timeout=30,
    )  # fmt: skip
    os.close(ours)
    os.close(theirs)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") == 1
    assert f"{name}: no permission" in done.stdout
    assert "dialout" in done.stdout
