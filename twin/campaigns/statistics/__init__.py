"""Statistics of runs, with intervals."""
