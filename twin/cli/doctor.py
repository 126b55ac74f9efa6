"""`twin doctor`: what this machine provides, what is missing, and what to do about it."""

import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

from analysis.compiled import cache_folder
from twin import status
from twin.cli.ready import lacking
from twin.config import Doctor
from twin.config.result import Result, Rows

Level = Literal["ok", "note", "missing"]
PACKAGES = ("tvc-twin", "mujoco", "numba", "numpy", "scipy", "control", "rerun-sdk", "pyserial")
PURPOSES = {
    "report": "pages: report, converge, demo, fly --repeat",
    "sysid": "identify --linkage",
    "gym": "twin.gym",
    "notebook": "recordings as pandas tables",
    "mcap": "export --to mcap",
    "usd": "export --to usd",
}
BROWSERS = ("chromium", "google-chrome", "firefox", "xdg-open", "open")
RULES = ("/lib/udev/rules.d", "/usr/lib/udev/rules.d", "/etc/udev/rules.d")
GRABBERS = (
    ("ModemManager", "77-mm-usb-device-blacklist.rules",
     "it probes new ports for seconds: `sudo systemctl disable --now ModemManager`"),
    ("brltty", "85-brltty.rules",
     "it takes CH340 adapters for braille displays: `sudo apt remove brltty`"),
)  # fmt: skip
AVR_TOOLS = ("avr-g++", "avr-size", "simavr")
ROOT_USER = 0


@dataclass(frozen=True)
class Finding:
    """One item examined.

    Attributes
    ----------
    topic : item
    level : `ok`, `note` (works, could be better) or `missing` (something will not run)
    state : what is present
    remedy : what to do about it; empty where nothing is to be done
    """

    topic: str
    level: Level
    state: str
    remedy: str = ""


def examine() -> list[Finding]:
    """Look at everything; never raises, an examination that fails is a finding itself."""
    findings: list[Finding] = []
    for look in EXAMINATIONS:
        status.say(f"examining {look.__name__.strip('_').replace('_', ' ')}")
        findings.extend(_guarded(look))
    return findings


@dataclass(frozen=True)
class DoctorResult(Result):
    """Everything that was examined."""

    findings: tuple[Finding, ...]

    def as_dict(self) -> dict[str, object]:
        """JSON values."""
        return {"findings": [asdict(finding) for finding in self.findings]}

    def rows(self) -> Rows:
        """One row a finding, and one for what to do about it."""
        rows: Rows = []
        for f in self.findings:
            rows.append((f.level, f"{f.topic:<18} {f.state}"))
            if f.remedy:
                rows.append(("", f"{'':<18} → {f.remedy}"))
        return rows


def doctor(config: Doctor) -> DoctorResult:
    """Examine this machine, or the files that are given.

    An examination of the machine that fails is itself a finding.

    Raises
    ------
    TwinError : a file is not that of a vehicle or mechanism
    HardwareError : no board of this version answers at the port
    """
    if config.compile:
        from twin.cli.ahead import compile_all

        seconds, folder = compile_all()
        state = f"all compiled in {seconds:.0f} s, kept in {folder}"
        return DoctorResult((Finding("compiled code", "ok", state),))
    if config.port is not None:
        from hardware.rig.examination import examined

        status.say(f"waiting for the board {config.port}")
        return DoctorResult(tuple(Finding(*row) for row in examined(config.port)))
    if config.vehicle is None and config.mechanism is None:
        return DoctorResult(tuple(examine()))
    from twin.plant.model.inspection import inspect_mechanism, inspect_vehicle

    states: list[tuple[str, str]] = []
    if config.vehicle is not None:
        states += inspect_vehicle(config.vehicle)
    if config.mechanism is not None:
        states += inspect_mechanism(config.mechanism)
    return DoctorResult(tuple(Finding(topic, "ok", state) for topic, state in states))


def _guarded(look: Callable[[], Iterator[Finding]]) -> Iterator[Finding]:
    try:
        yield from look()
    except Exception as error:  # a diagnosis must survive what it diagnoses
        yield Finding(look.__name__.strip("_"), "missing", f"{type(error).__name__}: {error}")


def _versions() -> Iterator[Finding]:
    yield Finding("python", "ok", f"{platform.python_version()} on {platform.platform()}")
    for package in PACKAGES:
        try:
            yield Finding(package, "ok", version(package))
        except PackageNotFoundError:
            yield Finding(package, "missing", "not installed", "run `make env`")


def _extras() -> Iterator[Finding]:
    for extra, purpose in PURPOSES.items():
        if absent := lacking(extra):
            remedy = f"pip install '.[{extra}]' in the project's folder ({purpose})"
            yield Finding(f"extra {extra}", "note", f"without {', '.join(absent)}", remedy)
        else:
            yield Finding(f"extra {extra}", "ok", purpose)


def _native() -> Iterator[Finding]:
    from twin.physics.native import layout

    layout.verify()
    yield Finding("native callbacks", "ok", "field offsets agree with this MuJoCo")
    folder = cache_folder()
    if folder is None:
        remedy = "set NUMBA_CACHE_DIR to a folder that can be written"
        state = "none can be written: every start compiles for 20 s or more"
        yield Finding("compiled code", "note", state, remedy)
    else:
        yield Finding("compiled code", "ok", f"kept in {folder}")


def _rendering() -> Iterator[Finding]:
    """Try each GL backend in a separate process: the choice is made once, at import."""
    program = (
        "import mujoco; m = mujoco.MjModel.from_xml_string('<mujoco/>');"
        "r = mujoco.Renderer(m, 32, 32); r.update_scene(mujoco.MjData(m)); r.render()"
    )
    working = []
    for backend in ("egl", "osmesa"):
        environment = {**os.environ, "MUJOCO_GL": backend}
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=environment,
            capture_output=True,
            timeout=60,
            check=False,
        )
        if done.returncode == 0:
            working.append(backend)
    if working:
        yield Finding("headless GL", "ok", " and ".join(f"MUJOCO_GL={name}" for name in working))
    else:
        remedy = "install libegl1 and libgl1-mesa-dri, or libosmesa6 (only rendering needs it)"
        yield Finding("headless GL", "note", "neither EGL nor OSMesa renders", remedy)


def _viewer() -> Iterator[Finding]:
    window = sys.platform in ("win32", "darwin") or os.environ.get("DISPLAY")
    if window or os.environ.get("WAYLAND_DISPLAY"):
        yield Finding("display", "ok", "`twin view` opens a window")
    else:
        remedy = "use `twin view --web`, over ssh with `ssh -L 9090:127.0.0.1:9090`"
        yield Finding("display", "note", "none: `twin view` cannot open a window", remedy)
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    vulkan = any(Path("/usr/share/vulkan/icd.d").glob("*.json"))
    if sys.platform.startswith("linux") and not vulkan:
        remedy = "install mesa-vulkan-drivers and libvulkan1, or use `twin view --web`"
        yield Finding("Vulkan", "note", "no driver: the native viewer will not open", remedy)
    else:
        yield Finding("Vulkan", "ok", "a driver is installed")
    if browser is None:
        remedy = "`twin view --web` and pages open in any browser, also on another machine"
        yield Finding("browser", "note", "none installed here", remedy)
    else:
        yield Finding("browser", "ok", browser)


def _real_time() -> Iterator[Finding]:
    if not hasattr(os, "sched_setscheduler"):
        yield Finding("SCHED_FIFO", "note", "this system has none", "expect late ticks under load")
        return
    import resource  # POSIX only, like the scheduler

    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    if os.geteuid() == ROOT_USER or limit > 0:
        yield Finding("SCHED_FIFO", "ok", "allowed")
    else:
        remedy = "add `@realtime - rtprio 80` to /etc/security/limits.conf and join that group"
        yield Finding("SCHED_FIFO", "note", "not allowed: ticks may come late under load", remedy)
    locked = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    if os.geteuid() == ROOT_USER or locked in (-1, resource.RLIM_INFINITY):
        yield Finding("memory lock", "ok", "allowed")
    else:
        remedy = "add `@realtime - memlock unlimited` to /etc/security/limits.conf"
        yield Finding("memory lock", "note", f"limited to {locked // 1024} KiB", remedy)
    yield Finding("processors", "ok" if (os.cpu_count() or 1) > 1 else "note", f"{os.cpu_count()}")


def _ports() -> Iterator[Finding]:
    from hardware.link import available

    ports = available()
    if not ports:
        yield Finding("serial ports", "note", "none", "plug a Nano in, or use `--gimbal linkage`")
    for device, description in ports.items():
        usable = not device.startswith("/") or os.access(device, os.R_OK | os.W_OK)
        remedy = "" if usable else "add yourself to the group `dialout` and log in again"
        yield Finding(device, "ok" if usable else "missing", description, remedy)
        timer = Path("/sys/bus/usb-serial/devices", Path(device).name, "latency_timer")
        if timer.is_file() and timer.read_text().strip() != "1":
            remedy = f"write 1 to {timer}: until then bytes wait up to 16 ms in the adapter"
            yield Finding(device, "note", f"latency {timer.read_text().strip()} ms", remedy)


def _grabbers() -> Iterator[Finding]:
    """Services that open serial ports by themselves."""
    for program, rule, remedy in GRABBERS:
        if shutil.which(program) or any(Path(folder, rule).exists() for folder in RULES):
            yield Finding(program, "note", "installed: may take a Nano's port", remedy)


def _avr() -> Iterator[Finding]:
    absent = [tool for tool in AVR_TOOLS if shutil.which(tool) is None]
    header = Path("/usr/include/simavr/sim_avr.h")
    if not header.is_file():
        absent.append("libsimavr-dev")
    if absent:
        remedy = (
            "install gcc-avr avr-libc simavr libsimavr-dev (only the simulated Nano needs them)"
        )
        yield Finding("AVR tools", "note", f"without {', '.join(absent)}", remedy)
    else:
        yield Finding("AVR tools", "ok", "compiler and simulator")


EXAMINATIONS = (
    _versions, _extras, _native, _rendering, _viewer, _real_time, _ports, _grabbers, _avr,
)  # fmt: skip
