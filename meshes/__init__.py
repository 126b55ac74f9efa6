"""Printable parts of the mechanism: committed STL in millimetres, and what draws them."""

from meshes.stl import MeshError, check

__all__ = ["MeshError", "check"]
