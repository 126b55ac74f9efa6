"""How gimbal joints follow measured angles: the rates that lead them there."""

from hardware.frames import Pair

# Frames of a rig come every 2 ms; a correction is spread over two of them, or over a longer tick.
FOLLOW_NS = 4_000_000


class Following:
    """Rates of joints that are to be where the latest measurement says.

    A tick after a measurement they are where it would be by then; after `FOLLOW_NS` without
    another, or at the end of a longer tick, they stand still.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget what was measured."""
        self._measured: tuple[Pair, Pair] | None = None
        self._holds_ns = 0

    def measured(self, angle: Pair, rate: Pair) -> None:
        """Take a measured angle [rad] and its rate [rad/s]."""
        self._measured = angle, rate

    def rates(self, now: Pair, time_ns: int, tick_ns: int) -> Pair | None:
        """Rates to command for a tick [rad/s] from the joints' angles [rad]; None for the same."""
        if self._measured is not None:
            (x, y), (u, v) = self._measured
            span_ns = max(tick_ns, FOLLOW_NS)
            within = 1e9 / span_ns
            self._holds_ns = time_ns + span_ns
            self._measured = None
            return u + (x - now[0]) * within, v + (y - now[1]) * within
        return (0.0, 0.0) if time_ns >= self._holds_ns else None
