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


FILES = (
    "mjcf/flight.xml", "mjcf/gimbal.json", "mjcf/parts/airframe.xml", "meshes/ring.stl",
    "twin/py.typed", "twin/__init__.pyi", "twin/campaigns/studies/dispersion.toml",
    "analysis/report/page.js", "hardware/firmware/tvc_gimbal/tvc_gimbal.ino",
    "hardware/simavr/shim.c",
)  # fmt: skip
COMMANDS = (
    "fly --duration-s 0.1",
    "step --repeats 1 --hold-s 0.2 --out a.rrd",
    "compare a.rrd --with linkage",
    "report a.rrd --out a.html",
    "parameters wind",
)


def test_models_meshes_firmware_and_studies_are_in_the_wheel(unpacked):
    for name in FILES:
        assert (unpacked / name).is_file(), name
    tops = {p.name for p in unpacked.iterdir() if not p.name.endswith(".dist-info")}
    assert tops == {"mjcf", "meshes", "twin", "hardware", "analysis"}


@pytest.mark.thorough
def test_the_wheel_works_without_the_checkout(unpacked, tmp_path):
    program = f"""
import sys, twin
from twin.cli.main import main
print(twin.__file__)
for line in {COMMANDS!r}:
    try:
        main(line.split())
    except SystemExit as end:
        if end.code:
            sys.exit(line)
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(unpacked)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert str(unpacked) in done.stdout.splitlines()[0]
    assert (tmp_path / "runs" / "latest-fly.rrd").is_file()
    assert (tmp_path / "a.html").is_file()
