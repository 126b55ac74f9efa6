"""Printable parts of the mechanism: committed STL in millimetres, and what draws them."""

from meshes.compiled import check_model
from meshes.errors import MeshError
from meshes.stl import check

__all__ = ["MeshError", "check", "check_model"]
