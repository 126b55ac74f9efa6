"""The 3D scene of a recording: bodies, their poses, the command as a ghost."""
