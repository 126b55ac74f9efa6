"""Rerun's web viewer and one recording on a single port of the loopback interface."""

import contextlib
import shutil
import threading
import urllib.request
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from twin.viewer.process import LOOPBACK, ViewerError, check_free, free_port, running

# What Rerun's program serves of its web viewer.
_PARTS = {
    "/": "text/html; charset=utf-8",
    "/re_viewer.js": "text/javascript",
    "/re_viewer_bg.wasm": "application/wasm",
    "/favicon.ico": "image/x-icon",
}
_RECORDING = "/recording.rrd"
_HOSTS = (LOOPBACK, "localhost")  # with any port, as `ssh -L` may give it another
# The page opens the recording whatever address it has, also behind `ssh -L`, and nothing else.
_OPEN = (
    b"<head><script>history.replaceState(null, '', '?hide_welcome_screen&persist=0&notebook=0&url='"
    b" + encodeURIComponent(new URL('recording.rrd', location.origin)))</script>"
)
_POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:;"
    " frame-ancestors 'none'"
)


@contextlib.contextmanager
def serve_web(path: Path, port: int = 0) -> Iterator[str]:
    """Serve a recording to browsers on the loopback interface; yields the address.

    Parameters
    ----------
    path : recording
    port : the only one that is used; 0 for a free one

    Raises
    ------
    ViewerError : the port is invalid or in use, or Rerun's program does not start
    """
    if port:
        check_free(port)
    server = ThreadingHTTPServer((LOOPBACK, port), _handler(_viewer(), path))
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1})
    thread.start()
    try:
        yield f"http://{LOOPBACK}:{server.server_address[1]}/"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def _viewer() -> dict[str, bytes]:
    """The files of the web viewer, which only Rerun's program contains."""
    page, data = free_port(), free_port()
    options = ["--serve-web", "--bind", LOOPBACK, "--port", str(data)]
    with running([*options, "--web-viewer-port", str(page)], page):
        parts = {}
        for name in _PARTS:
            try:
                with urllib.request.urlopen(f"http://{LOOPBACK}:{page}{name}", timeout=30) as got:
                    parts[name] = got.read()
            except OSError as error:
                raise ViewerError(
                    f"Rerun's program does not serve its web viewer: {error}"
                ) from None
    parts["/"] = parts["/"].replace(b"<head>", _OPEN, 1)
    return parts


def _handler(parts: dict[str, bytes], path: Path) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            name = self.path.partition("?")[0]
            if self.headers.get("Host", "").partition(":")[0] not in _HOSTS:
                self.send_error(403)  # a foreign page whose name now leads here (DNS rebinding)
                return
            with contextlib.suppress(ConnectionError):  # the browser has left
                if name == _RECORDING:
                    self._send_recording()
                elif name in parts:
                    self._head(_PARTS[name], len(parts[name]))
                    self.wfile.write(parts[name])
                else:
                    self.send_error(404)

        def _send_recording(self) -> None:
            try:
                file = path.open("rb")
            except OSError:
                self.send_error(404)
                return
            with file:
                self._head("application/octet-stream", path.stat().st_size)
                shutil.copyfileobj(file, self.wfile)

        def _head(self, kind: str, length: int) -> None:
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(length))
            self.send_header("Content-Security-Policy", _POLICY)
            self.send_header("Cache-Control", "no-store")
            self.end_headers()

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002  as inherited
            """Print nothing."""

    return Handler
