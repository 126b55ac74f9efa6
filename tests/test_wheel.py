"""The wheel carries everything a flight needs, and nothing else stands beside the packages."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    """The project as its wheel installs it."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    site = folder / "site"
    zipfile.ZipFile(wheel).extractall(site)
    # Compiled functions of the checkout: numba takes them where the source is the same, and
    # compiles for half a minute where it is not.
    for compiled in ROOT.glob("*/**/__pycache__/*.nb[ic]"):
        target = site / compiled.relative_to(ROOT)
        if target.parents[1].is_dir():
            target.parent.mkdir(exist_ok=True)
            shutil.copy(compiled, target)
    return site


def test_models_meshes_and_firmware_are_in_the_wheel(unpacked):
    for name in ("mjcf/flight.xml", "mjcf/gimbal.json", "meshes/ring.stl", "twin/py.typed"):
        assert (unpacked / name).is_file(), name
    tops = {p.name for p in unpacked.iterdir() if not p.name.endswith(".dist-info")}
    assert tops == {"mjcf", "meshes", "twin", "hardware", "analysis"}


def test_the_wheel_flies_without_the_checkout(unpacked, tmp_path):
    program = "import twin, sys; print(twin.__file__); from twin.cli.main import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", program, "fly", "--duration-s", "0.1", "--json"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(unpacked)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert str(unpacked) in done.stdout.splitlines()[0]
    assert (tmp_path / "runs" / "latest-fly.rrd").is_file()
