"""Commands that only read recordings: identify, compare, report."""
