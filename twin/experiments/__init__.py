"""Verbs that run something, one module each; what they share is `session.py`."""
