"""From MJCF files and settings to the compiled model of a run."""
