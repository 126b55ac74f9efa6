"""Recordings in Rerun's viewer, on the screen or in a browser."""

from twin.viewer.opening import ViewerError, repaired, serve_web, view

__all__ = ["ViewerError", "repaired", "serve_web", "view"]
