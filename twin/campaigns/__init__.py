"""Many flights: a study, its samples, the processes that fly them, its answers."""
