"""Cable between host and simulated device, with its faults."""

import numpy as np

from hardware.emulator.injection import Injection


class UnpluggedError(OSError):
    """The cable of a simulated rig is unplugged."""


class Cable:
    """Drops or corrupts bytes, or is unplugged, by the injections of target `link`."""

    def __init__(self, injections: tuple[Injection, ...], seed: int) -> None:
        self._faults = [f for f in injections if f.target == "link"]
        self._random = np.random.default_rng([seed, 5])

    def unplugged(self, time: float) -> bool:
        """Return whether the cable is unplugged at a rig time [s]."""
        return any(f.kind == "unplug" and f.active(time) for f in self._faults)

    def check(self, time: float) -> None:
        """Raise while the cable is unplugged.

        Raises
        ------
        UnpluggedError : it is unplugged
        """
        if self._faults and self.unplugged(time):
            raise UnpluggedError("rig unplugged")

    def carry(self, data: bytes, time: float) -> bytes:
        """Return the bytes that arrive of those sent at a rig time [s]."""
        for fault in self._faults:
            if not data or fault.kind not in ("drop", "corrupt") or not fault.active(time):
                continue
            hit = self._random.random(len(data)) < fault.value
            if fault.kind == "drop":
                data = bytes(b for b, h in zip(data, hit, strict=True) if not h)
            else:
                flip = 1 << self._random.integers(0, 8, len(data))
                data = bytes(
                    b ^ int(f) if h else b for b, h, f in zip(data, hit, flip, strict=True)
                )
        return data
