"""Pictures of a recording without a screen, in the native and in the web viewer."""

import argparse
import contextlib
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from analysis import schema
from tests import browser
from twin.viewer.process import LOOPBACK, START_SECONDS, ViewerError, free_port, running
from twin.viewer.web import serve_web

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

SETTLE_SECONDS = 30.0
# Where the web viewer of Rerun 0.41 draws its time line [points]: margins, height above the bottom.
TIME_LINE = (267.0, 208.0)
TIME_LINE_HEIGHT = 15.0
# What the viewers say about the machine, the browser and their own welcome page.
HARMLESS = (
    "Software rasterizer",
    "deprecated parameters",
    "Expected one or none",
    "not implemented in web backend",
    "Failed to fetch",
)


@dataclass(frozen=True, slots=True)
class Look:
    """What the viewer showed without a screen.

    Attributes
    ----------
    pictures : one PNG per time asked for
    reports : what views reported, as `view: severity: summary`
    complaints : warnings and errors of the viewer's log
    """

    pictures: tuple[Path, ...]
    reports: tuple[str, ...]
    complaints: tuple[str, ...]


def screenshot(
    path: Path, times: Sequence[float], out_dir: Path, size: tuple[int, int] = (1600, 900)
) -> Look:
    """Picture a recording at the given experiment times [s] in the native viewer, without a screen.

    Parameters
    ----------
    path : recording
    times : experiment times [s]
    out_dir : folder for the pictures, named `<recording>_<time>.png`
    size : of the window [pixels]

    Raises
    ------
    ViewerError
        if the viewer does not start (it needs a Vulkan driver such as Mesa's) or does not load.
    """
    out_dir.mkdir(parents=True, exist_ok=True)
    pictures = []
    with headless(size) as client:
        _load(client, path)
        for at in times:
            client.set_time(schema.TIME, duration=float(at), play_state="paused")
            picture = out_dir / f"{path.stem}_{at:g}.png"
            picture.write_bytes(_steady(client))
            pictures.append(picture)
        reports = [
            f"{view.name}: {report.severity}: {report.summary}"
            for view in client.get_state().views
            for report in view.reports
        ]
        complaints = [
            f"{entry.level}: {entry.message}"
            for entry in client.get_logs()
            if entry.level != "INFO" and not any(harmless in entry.message for harmless in HARMLESS)
        ]
    return Look(tuple(pictures), tuple(reports), tuple(complaints))


@contextlib.contextmanager
def headless(size: tuple[int, int]) -> Iterator["ViewerClient"]:
    """Run a viewer without a screen, with no settings but its defaults; yields its client."""
    from rerun.experimental import ViewerClient

    port = free_port()
    options = ["--headless", "--bind", LOOPBACK, "--port", str(port), "--hide-welcome-screen"]
    with running([*options, "--window-size", f"{size[0]}x{size[1]}"], port) as process:
        until = time.monotonic() + START_SECONDS
        while True:
            try:
                client = ViewerClient.connect(f"rerun+http://{LOOPBACK}:{port}/proxy")
                client.get_state()
                break
            except Exception as error:
                if process.poll() is not None or time.monotonic() > until:
                    raise ViewerError(f"the viewer does not answer: {error}") from None
                time.sleep(0.1)
        yield client


def web_screenshot(
    path: Path, fractions: Sequence[float], out_dir: Path, size: tuple[int, int] = (1000, 600)
) -> Look:
    """Picture a recording in the web viewer, in Chromium without a screen.

    Parameters
    ----------
    path : recording
    fractions : where on the time line, 0 its start and 1 its end
    out_dir : folder for the pictures, named `<recording>_web_<per cent>.png`
    size : of the window [pixels]

    Raises
    ------
    ViewerError
        if there is no Chromium or the page never settles.
    """
    out_dir.mkdir(parents=True, exist_ok=True)
    pictures = []
    left, right = TIME_LINE
    with serve_web(path) as url, browser.opened(url, size) as page:
        browser.settled(page)
        for fraction in fractions:
            page.click(left + fraction * (size[0] - left - right), size[1] - TIME_LINE_HEIGHT)
            picture = out_dir / f"{path.stem}_web_{100 * fraction:.0f}.png"
            picture.write_bytes(browser.settled(page))
            pictures.append(picture)
        complaints = [
            text for text in page.complaints if not any(harmless in text for harmless in HARMLESS)
        ]
    return Look(tuple(pictures), (), tuple(complaints))


def _load(client: "ViewerClient", path: Path) -> None:
    client.open(str(path.resolve()))
    until = time.monotonic() + SETTLE_SECONDS
    while time.monotonic() < until:
        state = client.get_state()
        if state.recordings and not state.loading and state.recordings[0].timelines:
            return
        time.sleep(0.1)
    raise ViewerError(f"the viewer does not load {path}")


def _steady(client: "ViewerClient") -> bytes:
    """Return the picture once two in a row are the same: the first ones are mid-load."""
    until = time.monotonic() + SETTLE_SECONDS
    last = b""
    while time.monotonic() < until:
        time.sleep(0.2)
        now = client.take_screenshot()
        if now == last:
            return now
        last = now
    return last


def main() -> None:
    """Picture a recording for the documentation, with few colours so that the file is small."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("time", type=float, help="experiment time [s]")
    parser.add_argument("picture", type=Path, help="PNG to write")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        look = screenshot(given.recording, [given.time], Path(folder), (1000, 620))
        image = Image.open(look.pictures[0]).convert("RGB").quantize(128)
    image.save(given.picture, optimize=True)
    print(f"{given.picture}: {given.picture.stat().st_size / 1e3:.0f} kB", *look.complaints)


if __name__ == "__main__":
    main()
