"""Mutants that no test can or need notice, with the reason."""

REASONS: dict[str, str] = {}
