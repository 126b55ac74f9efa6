"""The default flight configuration of an OpenRocket design: its motor, and what opens when."""

from typing import Final

from twin.physics.openrocket.tree import Part
from twin.physics.vehicle.design import Mount, VehicleError
from twin.physics.vehicle.read import printable

FITS: Final = 1.01  # of a bore: a motor not wider than this fits it
TIGHT: Final = 1.1  # of a tube's outside: a motor not wider than this is in it, its bore an error


class Configuration:
    """Default flight configuration of a rocket; the first one where none is marked as default."""

    def __init__(self, rocket: Part) -> None:
        self._rocket = rocket
        known = rocket.element.findall("motorconfiguration")
        default = [item for item in known if item.get("default") == "true"] or known
        self._chosen = default[0].get("configid") if default else None

    def motor(self, last: Part) -> tuple[Mount, str, tuple[str, ...]]:
        """Place of the motor; its maker, name and size; what does not fit together.

        Parameters
        ----------
        last : rearmost part of the body

        Raises
        ------
        VehicleError : a second motor
        """
        mounts = [
            part for part in self._rocket.walk() if part.element.find("motormount") is not None
        ]
        loaded = [
            (part, Part(motor, part.name))
            for part in mounts
            for motor in part.element.iterfind("motormount/motor")
            if motor.get("configid") == self._chosen
        ]
        if len(loaded) > 1:
            raise VehicleError(f"{loaded[1][0].name}: a second motor; a vehicle has one")
        if not mounts:
            return Mount(), "", ()
        tube = loaded[0][0] if loaded else mounts[0]
        holder = Part(next(tube.element.iter("motormount")), tube.name)
        nozzle = tube.start + tube.length + holder.number("overhang")
        bore = min(2 * tube.inner, 2 * last.outer)
        label = ""
        wrong: tuple[str, ...] = ()
        if loaded:
            motor = loaded[0][1]
            width, length = motor.size("diameter"), motor.size("length")
            maker, name = (motor.element.findtext(t) or "" for t in ("manufacturer", "designation"))
            label = f"{printable(f'{maker} {name}')}, {width * 1e3:.4g} mm x {length * 1e3:.4g} mm"
            flown = width <= min(2 * tube.outer * TIGHT, 2 * last.outer)
            if width > bore * FITS:
                wrong = (_tight(tube, bore, width, flown=flown),)
            if flown:
                bore = max(bore, width)
        overhang = round(nozzle - (last.start + last.length), 9)
        return Mount(overhang=overhang, diameter=bore or None), label, wrong

    def deployment(self, part: Part) -> Part:
        """Where a parachute's event stands: in the configuration's own, if it has one."""
        for item in part.element.iterfind("deploymentconfiguration"):
            if item.get("configid") == self._chosen:
                return Part(item, part.name)
        return part

    def delay(self) -> float:
        """Delay of the ejection charge of its motor [s]."""
        for motor in self._rocket.element.iter("motor"):
            if motor.get("configid") == self._chosen:
                text = (motor.findtext("delay") or "").strip()
                return Part(motor, "motor").size("delay") if text != "none" else 0.0
        return 0.0


def _tight(tube: Part, bore: float, width: float, *, flown: bool) -> str:
    """What to do about a motor that its own design has in too narrow a mount."""
    sizes = f"{tube.name}: its motor is {1e3 * width:.4g} mm wide, its bore {1e3 * bore:.4g} mm"
    if flown:
        return f"{sizes}: flown as if the bore fitted; check the tube's wall in the design"
    return (
        f"{sizes}: no such motor goes in; give a --motor FILE.eng of at most {1e3 * bore:.4g} mm,"
        " or the mount its true diameter, in the design or under motor in its description"
    )
