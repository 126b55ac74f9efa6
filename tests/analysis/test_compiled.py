"""The disk cache of compiled functions follows every source they are compiled from."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import analysis.identify.modal
import analysis.identify.ramps
import analysis.identify.servo_motion
import analysis.transfer_function.speed
import twin.control.attitude
import twin.control.guidance
import twin.control.pid
import twin.loop.seats
import twin.physics.mechanism.loops
import twin.physics.native.actuator
import twin.physics.native.forces
import twin.plant.flow
import twin.plant.integrators
import twin.plant.rods
import twin.recorder.rows
from analysis import compiled

ROOT = Path(__file__).resolve().parents[2]
MODULES = [
    analysis.identify.modal,
    analysis.identify.ramps,
    analysis.identify.servo_motion,
    analysis.transfer_function.speed,
    twin.control.attitude,
    twin.control.guidance,
    twin.control.pid,
    twin.loop.seats,
    twin.physics.mechanism.loops,
    twin.physics.native.actuator,
    twin.physics.native.forces,
    twin.plant.flow,
    twin.plant.integrators,
    twin.plant.rods,
    twin.recorder.rows,
]
CACHED = {  # every function with a disk cache, by its full name
    f"{module.__name__}.{name}": value
    for module in MODULES
    for name, value in vars(module).items()
    if getattr(value, "_cache", None) is not None
    and compiled._function(value).__module__ == module.__name__
    and type(value._cache).__name__ == "FunctionCache"
}

FILES = {
    "outer.py": """
        from numba import types
        from analysis.compiled import cfunc, njit
        from package import helper
        from package.helper import inner

        @njit()
        def outer(x):
            return inner(x)

        @cfunc(types.float64(types.float64))
        def callback(x):
            return helper.inner(x)
        """,
    "helper.py": """
        import numba
        from package.numbers import FACTOR

        @numba.njit
        def inner(x):
            return FACTOR * x + 1.0
        """,
    "numbers.py": "FACTOR = 2.0",
}
ASK = """
import json
from package.outer import callback, outer
results = [outer(10.0), callback.ctypes(10.0)]
hits = sum(outer.stats.cache_hits.values()) + callback.cache_hits
print(json.dumps([*results, {0: "compiled", 2: "cached"}[hits]]))
"""


@pytest.fixture
def package(tmp_path):
    """Folder of a package whose compiled functions reach over three files."""
    folder = tmp_path / "package"
    folder.mkdir()
    for name, text in FILES.items():
        (folder / name).write_text(re.sub(r"^ {8}", "", text, flags=re.MULTILINE))
    return folder


def ask(package: Path) -> list:
    """Results of both functions in a new process, and where their machine code came from."""
    path = {"PYTHONPATH": f"{package.parent}:{ROOT}", "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", ASK]
    done = subprocess.run(command, env=path, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_an_edited_helper_or_constant_in_another_file_is_compiled_again(package):
    assert ask(package) == [21.0, 21.0, "compiled"]
    helper = package / "helper.py"
    helper.write_text(helper.read_text().replace("+ 1.0", "+ 5.0"))
    assert ask(package) == [25.0, 25.0, "compiled"]
    assert ask(package) == [25.0, 25.0, "cached"]
    (package / "numbers.py").write_text("FACTOR = 3.0")
    assert ask(package) == [35.0, 35.0, "compiled"]


def test_every_cached_function_of_the_product_is_seen_here():
    users = [
        path
        for room in ("twin", "analysis", "hardware", "meshes")
        for path in (ROOT / room).rglob("*.py")
        if re.search(r"^@(numba\.)?(njit|cfunc|jit)\(.*\)", path.read_text(), re.MULTILINE)
    ]
    seen = {compiled._function(value).__code__.co_filename for value in CACHED.values()}
    assert {str(path) for path in users} == seen


@pytest.mark.parametrize("name", CACHED)
def test_what_a_cached_function_reaches_is_in_its_key(name):
    function = compiled._function(CACHED[name])
    key = CACHED[name]._cache._impl.filename_base
    if name.startswith("hardware."):  # plain numba: right as long as it reaches one file only
        reached = list(compiled._reached(function, set()))
        assert {part for part in reached if " = " not in part} == {
            compiled._file(function.__code__.co_filename)
        }
    else:  # nothing was bound after the function was decorated
        assert compiled.fingerprint(function) in key
    parts = compiled._reached(function, set())
    assert not [part for part in parts if " at 0x" in part]  # an address differs in every process
