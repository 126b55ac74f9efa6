"""The disk cache of compiled functions follows every source they are compiled from."""

import importlib
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from analysis import compiled

ROOT = Path(__file__).resolve().parents[3]
DECORATED = re.compile(r"^@(numba\.)?(njit|cfunc|jit)\(", re.MULTILINE)
MODULES = [  # imported by the tests only: the callbacks are compiled on import
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for room in ("twin", "analysis", "hardware", "meshes")
    for path in sorted((ROOT / room).rglob("*.py"))
    if DECORATED.search(path.read_text())
]

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


@pytest.mark.thorough
def test_an_edited_helper_or_constant_in_another_file_is_compiled_again(package):
    assert ask(package) == [21.0, 21.0, "compiled"]
    helper = package / "helper.py"
    helper.write_text(helper.read_text().replace("+ 1.0", "+ 5.0"))
    assert ask(package) == [25.0, 25.0, "compiled"]
    assert ask(package) == [25.0, 25.0, "cached"]
    (package / "numbers.py").write_text("FACTOR = 3.0")
    assert ask(package) == [35.0, 35.0, "compiled"]


@pytest.mark.parametrize("name", MODULES)
def test_what_a_cached_function_reaches_is_in_its_key(name):
    module = importlib.import_module(name)
    cached = [
        value
        for value in vars(module).values()
        if type(getattr(value, "_cache", None)).__name__ == "FunctionCache"
        and compiled._function(value).__module__ == name
    ]
    assert cached
    for value in cached:
        function = compiled._function(value)
        key = value._cache._impl.filename_base
        assert compiled.fingerprint(function) in key  # nothing it uses was bound or changed later
        parts = compiled._reached(function, set())
        assert not [p for p in parts if " at 0x" in p]  # an address differs in every process


def test_where_no_cache_can_be_written_functions_are_compiled_in_every_process(monkeypatch):
    """As in a read-only installation of a user whose home cannot be written."""
    from numba.core.caching import CacheImpl

    monkeypatch.setattr(CacheImpl, "_locator_classes", [])
    twice = compiled.njit()(lambda x: 2 * x)
    assert twice(3) == 6
    assert compiled.cache_folder.__wrapped__() is None


def test_the_doctor_says_where_compiled_code_is_kept(monkeypatch):
    from twin.cli import doctor

    found = {f.topic: f for f in doctor._native()}["compiled code"]
    assert found.level == "ok"
    assert str(compiled.cache_folder()) in found.state
    monkeypatch.setattr(doctor, "cache_folder", lambda: None)
    found = {f.topic: f for f in doctor._native()}["compiled code"]
    assert found.level == "note"
    assert "NUMBA_CACHE_DIR" in found.remedy


def test_a_function_runs_although_the_disk_of_its_cache_is_full(monkeypatch):
    from numba.core.caching import IndexDataCacheFile

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(IndexDataCacheFile, "save", full)

    @compiled.njit()
    def twice(x):
        return 2.0 * x

    assert twice(1.5) == 3.0
