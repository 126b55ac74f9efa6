"""`twin fly`: one flight, what it passes through, its result."""
