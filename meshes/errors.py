"""What is wrong with a mesh."""


class MeshError(ValueError):
    """A mesh that is no closed surface, told in one line."""
