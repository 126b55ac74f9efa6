"""What numba's on-disk cache cannot see: the other files that compiled code is made of.

numba keys its cache by the file of the outermost function alone, so an edited formula or a new
MuJoCo would go unnoticed. Compiled callbacks therefore close over this fingerprint, which enters
the key.
"""

import functools
import hashlib
from pathlib import Path

import mujoco
import numba
import numpy as np

_PACKAGE = Path(__file__).resolve().parents[1]


@functools.cache
def fingerprint() -> str:
    """Digest of the sources of `twin.native` and `twin.aerodynamics` and the versions under them."""
    digest = hashlib.sha256(f"{mujoco.__version__} {numba.__version__} {np.__version__}".encode())
    for folder in ("native", "aerodynamics"):
        for path in sorted((_PACKAGE / folder).glob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()
