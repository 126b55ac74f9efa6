"""Digital twin of a thrust-vector-control gimbal and its vehicle: every verb as a function.

    import twin

    flight = twin.fly(gimbal="transfer-function", seed=3)
    height = twin.read(flight)["vehicle/position"].values[:, 2]

Keyword arguments are named as the flags of `twin VERB --help`; results are frozen dataclasses with
`as_dict()`, `text()` and, in a notebook, a table. Nothing is imported before it is used.
"""

from typing import TYPE_CHECKING

VERBS = (
    "calibrate",
    "campaign",
    "compare",
    "converge",
    "demo",
    "doctor",
    "export",
    "fly",
    "history",
    "identify",
    "mechanism",
    "meshes",
    "mirror",
    "parameters",
    "replay",
    "report",
    "rig",
    "step",
    "vehicle",
    "view",
)
OTHERS = {
    "read": "twin.cli.python:read",
    "load": "twin.cli.python:load",
    "TwinError": "twin.errors:TwinError",
    "DivergenceError": "twin.errors:DivergenceError",
    "AnalysisError": "analysis.schema:AnalysisError",
    "HardwareError": "hardware.frames:HardwareError",
}

if not TYPE_CHECKING:  # type checkers read __init__.pyi

    def __getattr__(name: str) -> object:
        """Make a verb's function, or import another public name, on its first use."""
        if name in VERBS:
            from twin.cli.python import function

            value = function(name)
        elif name in OTHERS:
            from importlib import import_module

            module, _, attribute = OTHERS[name].partition(":")
            value = getattr(import_module(module), attribute)
        else:
            raise AttributeError(f"module 'twin' has no attribute {name!r}")
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        """Public names."""
        return sorted({*VERBS, *OTHERS})
