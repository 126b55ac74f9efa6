"""The device's clock seen from the host: offset and skew from PING and PONG."""

from collections import deque
from dataclasses import dataclass

WINDOW = 256  # exchanges kept
SPAN_US = 30_000_000  # a resonator drifts with temperature: older exchanges count less
LARGEST_SKEW = 0.02  # ceramic resonators are good to 5e-3
SKEW_SPAN_US = 150_000  # before, the slope is noise: the rates are taken as equal
BEST = 0.25  # share of the exchanges, by delay, that count
FEWEST = 8


@dataclass(frozen=True, slots=True)
class Exchange:
    """One PING and its PONG.

    Attributes
    ----------
    host_ns : middle of sending and receiving on the host's clock [ns]
    device_us : middle of receiving and sending on the device's clock [µs]
    delay_ns : time on the way, both ways together [ns]
    """

    host_ns: int
    device_us: float
    delay_ns: int


class ClockEstimate:
    """Straight line from device time to host time through the exchanges that were least delayed.

    Delay is only ever added, and mostly in one direction; the fastest exchanges are the truest
    (minimum-delay filter, as in NTP, RFC 5905 section 10).

    Attributes
    ----------
    skew : how fast the device's clock is [1]
    round_trip_ns : of the latest exchange [ns]
    added : exchanges so far
    """

    def __init__(self, skew: float = 0.0) -> None:
        self._exchanges: deque[Exchange] = deque(maxlen=WINDOW)
        self._at_us = 0.0
        self._at_ns = 0.0
        self.skew = skew  # of an earlier connection, until this one has an estimate
        self.round_trip_ns = 0
        self.added = 0

    @property
    def count(self) -> int:
        """Exchanges so far, at most `WINDOW`."""
        return len(self._exchanges)

    @property
    def shortest_ns(self) -> int:
        """Shortest delay in the window [ns]."""
        return min((e.delay_ns for e in self._exchanges), default=0)

    def add(self, sent_ns: int, received_ns: int, device_in_us: int, device_out_us: int) -> None:
        """Take in one exchange; device stamps are unwrapped."""
        delay = received_ns - sent_ns - 1000 * (device_out_us - device_in_us)
        self.round_trip_ns = received_ns - sent_ns
        self.added += 1
        host = (sent_ns + received_ns) // 2
        self._exchanges.append(Exchange(host, (device_in_us + device_out_us) / 2, delay))
        newest = self._exchanges[-1].device_us
        while newest - self._exchanges[0].device_us > SPAN_US:
            self._exchanges.popleft()
        self._fit()

    def host_ns(self, device_us: int) -> int:
        """Return the host time of an unwrapped device stamp [µs] → [ns]."""
        return round(self._at_ns + (device_us - self._at_us) * 1000.0 / (1 + self.skew))

    def _fit(self) -> None:
        by_delay = sorted(self._exchanges, key=lambda e: e.delay_ns)
        good = by_delay[: max(FEWEST, round(BEST * len(by_delay)))]
        good.sort(key=lambda e: e.device_us)
        n = len(good)
        self._at_us = sum(e.device_us for e in good) / n
        # Differences from one of them: sums of nanoseconds since boot would lose digits.
        base = good[0].host_ns
        self._at_ns = base + sum(e.host_ns - base for e in good) / n
        if good[-1].device_us - good[0].device_us < SKEW_SPAN_US:
            return
        square = sum((e.device_us - self._at_us) ** 2 for e in good)
        product = sum((e.device_us - self._at_us) * (e.host_ns - self._at_ns) for e in good)
        skew = 1000.0 * square / product - 1 if product > 0 else 0.0
        self.skew = min(max(skew, -LARGEST_SKEW), LARGEST_SKEW)
