"""The array type of every signal."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
