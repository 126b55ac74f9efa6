"""Looking at recordings: Rerun's viewer on the screen, in a browser, or without any screen."""

from twin.viewer.headless import Look, screenshot, web_screenshot
from twin.viewer.opening import ViewerError, repaired, serve_web, view

__all__ = ["Look", "ViewerError", "repaired", "screenshot", "serve_web", "view", "web_screenshot"]
