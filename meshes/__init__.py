"""Printable parts of the mechanism: committed STL in millimetres, and what draws them."""
