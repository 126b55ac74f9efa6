"""`twin rig`: a simulated rig behind a port of this machine."""

import gc
import json
import math
import time
from dataclasses import asdict

from hardware.device import TcpPort, serve
from hardware.key import VARIABLE
from twin import status
from twin.config import Rig
from twin.experiments.signals import until_signal
from twin.hil import RigOptions, device
from twin.hil.connect import check_parameters
from twin.loop import realtime
from twin.plant.compiled import compiled

KEY_USE = (
    f"(programs of this user on this computer find it; elsewhere, set {VARIABLE} to a copy of it)"
)


def rig(config: Rig) -> None:
    """Serve a simulated rig until SIGINT, SIGTERM or the end of its time; prints its port first.

    Raises
    ------
    TwinError, HardwareError : it cannot be made or served, in one line
    """
    life = math.inf if config.duration_s is None else config.duration_s
    options = RigOptions(
        seat=config.kind,
        unit=config.unit,
        faults=config.fault,
        minimal=config.minimal,
        track=math.radians(config.potentiometer_deg),
        seed=config.seed,
        overrides=config.overrides,
        scene=config.scene,
        mechanism=config.mechanism,
    )
    check_parameters(options)
    with compiled(), until_signal() as ended:
        simulated = device(options)
        with serve(simulated, tcp=config.port, link=config.link) as server:
            # a collection in the middle would hold the telemetry back for milliseconds
            gc.collect()
            gc.freeze()
            with realtime.requested() as rights:  # a real board does not share its processor
                place = {"port": server.port.url, "kind": config.kind, "rights": asdict(rights)}
                lines = [server.port.url]
                if isinstance(server.port, TcpPort):
                    place["key_file"] = str(server.port.key_file)
                    lines.append(f"session key {server.port.key_file} {KEY_USE}")
                status.say("")
                print(json.dumps(place) if config.json else "\n".join(lines), flush=True)
                end = time.monotonic() + life
                server.run(until=lambda: ended() is not None or time.monotonic() >= end)
            if server.strangers:
                status.note(f"twin: {server.strangers}")
        simulated.close()
