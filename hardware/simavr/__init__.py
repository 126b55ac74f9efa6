"""Simavr."""
