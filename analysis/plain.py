"""Results as JSON values."""

import math
from collections.abc import Mapping
from dataclasses import fields

import numpy as np


class Plain:
    """Base of dataclasses whose fields make a JSON object."""

    __slots__ = ()

    def to_dict(self) -> dict[str, object]:
        """Fields as JSON values; what is not finite becomes None."""
        names = (f.name for f in fields(self))  # type: ignore[arg-type]  # of dataclasses only
        return {name: plain(getattr(self, name)) for name in names}


def plain(value: object) -> object:
    """Dataclasses, sequences, mappings and NumPy values as what JSON holds."""
    if isinstance(value, Plain):
        return value.to_dict()
    if isinstance(value, float | np.floating):
        return float(value) + 0.0 if math.isfinite(value) else None  # of zeros none is negative
    if isinstance(value, np.ndarray | np.bool_ | np.integer):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [plain(v) for v in value]
    return value
