"""Recordings in Rerun's viewer, on the screen or in a browser."""

from twin.viewer.opening import repaired, view
from twin.viewer.process import ViewerError
from twin.viewer.web import serve_web

__all__ = ["ViewerError", "repaired", "serve_web", "view"]
