"""The runs of a study, the processes and machines that fly them, and their rows on disk."""
