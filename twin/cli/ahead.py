"""`twin doctor --compile`: short runs of what compiles on first use, so that no later run waits."""

import time
from pathlib import Path
from tempfile import TemporaryDirectory

from analysis.compiled import cache_folder
from twin import status
from twin.cli.python import function
from twin.config import Fly
from twin.experiments.flight.fly import fly as unrecorded


def compile_all() -> tuple[float, str]:
    """Fly, steer to a point, step and identify in an empty folder.

    Returns the time that this took [s], and the folder of the compiled functions.
    """
    began = time.perf_counter()
    with TemporaryDirectory() as folder:
        out = Path(folder)
        fly, step, identify = (function(name) for name in ("fly", "step", "identify"))
        fly(duration_s=0.1, out=out / "a.rrd")
        fly(duration_s=0.1, out=out / "b.rrd", programme="point", integrator="ab2")
        for programme in ("hold", "point"):  # without a recording, as campaigns fly
            unrecorded(Fly(duration_s=0.1, programme=programme), recorded=False)
        rig = step(repeats=1, hold_s=0.2, axis="x", out=out / "c.rrd")
        for servo in (False, True):
            status.say(f"identifying, {'servo' if servo else 'linear'} model")
            identify(rig, servo=servo, out=out / f"{servo}.json")
    return time.perf_counter() - began, str(cache_folder())
