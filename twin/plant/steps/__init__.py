"""Integrators: how a plant advances in time."""
