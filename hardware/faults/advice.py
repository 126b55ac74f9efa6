"""What to look at for a fault that is named, in one clause."""

from hardware.faults.states import GLITCH

BY_SENSOR = {  # first part of the name that fits, and kind; "" for every kind
    ("potentiometer_", "open"): "check its wire and plug",
    ("potentiometer_", GLITCH): "check its wire for a loose contact, and its track",
    ("potentiometer_", "deviating"): "check whether it turns with its shaft",
    ("potentiometers_", ""): "check the ring that holds both, and their shafts",
    ("gyro", "frozen"): "check plug and supply of the holder IMU",
    ("gyro", "bias"): "check how the holder IMU is mounted, and calibrate",
    ("supply", ""): "check the 5 V of the potentiometers",
    ("servo_", ""): "check its plug, supply and horn",
    ("rig ", ""): "check cable and supply",
    ("no readings", ""): "check cable and supply, and whether this computer is too busy",
    ("readings are", ""): "check whether this computer is too busy",
}


def advice(fault: str) -> str:
    """Return what to look at.

    Parameters
    ----------
    fault : health in one line, or what a run ended by; the first one named counts

    Returns
    -------
    one clause; "" where there is nothing to say
    """
    first = fault.split(", ")[0]
    for (sensor, kind), clause in BY_SENSOR.items():
        if first.startswith(sensor) and first.endswith(kind):
            return clause
    return ""
