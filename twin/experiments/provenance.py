"""What a recording says about the run that made it, and the recorder that writes it."""

import functools
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING

from twin.config import Run
from twin.config.paths import named
from twin.config.seats import SIMULATED
from twin.experiments.kept import RESULTS, Origin, files_of, repeated
from twin.plant.plant import Plant
from twin.recorder import DetachedRecorder, Sink
from twin.recorder.rows import Rows

if TYPE_CHECKING:
    from twin.hil import RigGimbal
    from twin.hil.shadow import Shadow

VERSIONS = ("tvc-twin", "mujoco", "numpy", "numba", "rerun-sdk")
# Each write costs the same however much it holds; in real time a viewer may be watching, and the
# process that writes may be ended by force.
DRAIN_LOCKSTEP_NS, DRAIN_WALL_NS = 16_000_000_000, 1_000_000_000


def make_recorder(
    config: Run,
    verb: str,
    plant: Plant,
    rows: Rows,
    *,
    real_time: bool,
    serve: int | None = None,
    drain_ns: int | None = None,
    rig: "RigGimbal | None" = None,
    origin: Origin | None = None,
    shadow: "Shadow | None" = None,
) -> Sink:
    """The run's recorder, its properties complete enough to repeat the run.

    Parameters
    ----------
    real_time : whether the run keeps pace with the wall clock
    serve : port of a live viewer on this machine
    drain_ns : time between two writes; by the clock if omitted
    rig : its base, if it turns, belongs to the properties
    origin : of a run that is repeated; its files are this run's files, whatever became of them
    shadow : model beside the rig

    Raises
    ------
    TwinError : the file cannot be written, or the port is taken
    """
    properties = _properties(config, verb, plant)
    if origin is not None:
        properties = repeated(properties, origin)
    if rig is not None and rig.base is not None:
        properties["base"] = asdict(rig.base)
    if rig is not None:
        properties["shadow"] = _shadow(config, shadow)
    if real_time:
        properties["date"] = datetime.now(UTC).isoformat(timespec="milliseconds")
    path = named(config.out, verb, ".rrd", force=config.force)
    from twin.recorder import Recorder

    make = DetachedRecorder if real_time else Recorder
    return make(
        path,
        signals=rows.signals,
        properties=properties,
        model=plant.model,
        drain_ns=drain_ns or (DRAIN_WALL_NS if real_time else DRAIN_LOCKSTEP_NS),
        serve=serve,
    )


def _properties(config: Run, verb: str, plant: Plant) -> dict[str, object]:
    settings = {k: v for k, v in config.as_properties().items() if k not in RESULTS}
    return {
        "command": verb,
        "configuration": settings,
        "versions": {**_versions()},
        "model_sha256": plant.twin.sha256,
        "method": {"integrator": plant.integrator, "step_s": plant.dt_ns * 1e-9},
        "seed": config.seed,
        "files": files_of(config),
    }


@functools.cache
def _versions() -> dict[str, str]:
    return {name: version(name) for name in VERSIONS}


def _shadow(config: Run, shadow: "Shadow | None") -> dict[str, object] | None:
    """What is simulated beside a rig, and the rig's parameters that it is simulated without."""
    if shadow is None:
        return None
    ours, rigs = config.shadow_parameters, config.overrides
    if config.gimbal not in SIMULATED:  # the parameters of a rig on a port are not known
        rigs = ours
    either = sorted(k for k in ours.keys() | rigs.keys() if k.startswith("gimbal_"))
    return {
        "gimbal": shadow.plant.twin.gimbal,
        "sha256": shadow.plant.twin.sha256,
        "set": ours,
        "differs": [k for k in either if ours.get(k) != rigs.get(k)],
    }
