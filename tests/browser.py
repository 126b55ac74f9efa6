"""Chromium without a screen, over its DevTools protocol: open a page, wait, take its picture."""

import base64
import contextlib
import json
import shutil
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from twin.viewer.process import LOOPBACK, START_SECONDS, ViewerError

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
SETTLE_SECONDS = 180.0  # without a graphics card a frame takes a second or more
EMPTY_BYTES = 30_000  # a page that is still loading compresses to less


def executable() -> str:
    """Return the browser's path.

    Raises
    ------
    ViewerError
        if there is none.
    """
    for name in NAMES:
        if found := shutil.which(name):
            return found
    raise ViewerError(f"no browser found (looked for {', '.join(NAMES)}); Debian: chromium")


class Page:
    """One page of a running browser."""

    def __init__(self, address: str) -> None:
        from websocket import create_connection

        # a picture is a megabyte of text, which the client checks byte by byte in Python, 2 s each;
        # it is decoded strictly all the same
        self._socket = create_connection(
            address, timeout=SETTLE_SECONDS, suppress_origin=True, skip_utf8_validation=True
        )
        self._count = 0
        self.complaints: list[str] = []
        self.send("Runtime.enable")
        self.send("Page.enable")

    def send(self, method: str, **parameters: object) -> dict[str, Any]:
        """Call a method of the protocol and return its result."""
        self._count += 1
        self._socket.send(json.dumps({"id": self._count, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv())
            if message.get("id") == self._count:
                if "error" in message:
                    raise ViewerError(f"browser: {method}: {message['error']['message']}")
                return dict(message["result"])
            self._listen(message)

    def picture(self) -> bytes:
        """Return what the page shows now, as a PNG."""
        return base64.b64decode(self.send("Page.captureScreenshot", format="png")["data"])

    def click(self, x: float, y: float) -> None:
        """Press and release the left button at a place [pixels]."""
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            button = "none" if kind == "mouseMoved" else "left"
            self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=1)

    def close(self) -> None:
        """Leave the page."""
        self._socket.close()

    def _listen(self, message: dict[str, Any]) -> None:
        parameters = message.get("params", {})
        if message.get("method") == "Runtime.exceptionThrown":
            self.complaints.append(str(parameters["exceptionDetails"].get("text")))
        if message.get("method") == "Runtime.consoleAPICalled" and parameters["type"] in (
            "error",
            "warning",
        ):
            texts = (str(a.get("value", a.get("description"))) for a in parameters["args"])
            self.complaints.append(f"{parameters['type']}: {' '.join(texts)}")


@contextlib.contextmanager
def opened(url: str, size: tuple[int, int]) -> Iterator[Page]:
    """Open one page in a fresh browser of the given size [pixels]."""
    with tempfile.TemporaryDirectory(prefix="twin-browser-", ignore_cleanup_errors=True) as home:
        command = [
            executable(),
            "--headless=new",
            "--disable-gpu",
            "--enable-unsafe-swiftshader",
            "--js-flags=--wasm-lazy-compilation",  # Rerun's viewer is 30 MB, most of it unused
            "--no-sandbox",
            "--no-first-run",
            "--hide-scrollbars",
            "--force-device-scale-factor=1",
            f"--window-size={size[0]},{size[1]}",
            f"--user-data-dir={home}",
            f"--remote-debugging-address={LOOPBACK}",
            "--remote-debugging-port=0",
            "about:blank",
        ]
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            page = Page(_page_address(process, Path(home) / "DevToolsActivePort"))
            page.send(
                "Emulation.setDeviceMetricsOverride",
                width=size[0],
                height=size[1],
                deviceScaleFactor=1,
                mobile=False,
            )
            page.send("Page.navigate", url=url)
            yield page
            page.close()
        finally:
            process.kill()
            process.wait()


def settled(page: Page) -> bytes:
    """Return the page's picture once it has content and two in a row are the same."""
    until = time.monotonic() + SETTLE_SECONDS
    last = b""
    while time.monotonic() < until:
        time.sleep(0.3)
        now = page.picture()
        if now == last and len(now) > EMPTY_BYTES:
            return now
        last = now
    raise ViewerError(f"the page does not settle within {SETTLE_SECONDS:.0f} s")


def shows(page: Page, wanted: Callable[[bytes], bool]) -> bytes:
    """Return the page's first picture that shows what is wanted, the last one if none does."""
    until = time.monotonic() + SETTLE_SECONDS
    while True:
        time.sleep(1.5)  # a picture takes the processors from the page that draws it
        now = page.picture()
        if wanted(now) or time.monotonic() > until:
            return now


def _page_address(process: subprocess.Popen[bytes], ready: Path) -> str:
    until = time.monotonic() + START_SECONDS
    while time.monotonic() < until and process.poll() is None:
        with contextlib.suppress(OSError, ValueError, IndexError):
            port = int(ready.read_text().splitlines()[0])
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json", timeout=5) as answer:
                targets = json.load(answer)
            for target in targets:
                if target.get("type") == "page":
                    return str(target["webSocketDebuggerUrl"])
        time.sleep(0.1)
    raise ViewerError("the browser does not start")
