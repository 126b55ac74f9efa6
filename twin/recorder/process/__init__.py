"""A recorder in a process of its own, and the memory that both share."""
