"""The physical model: MJCF files, the only place where a dimension, mass or stiffness stands."""
