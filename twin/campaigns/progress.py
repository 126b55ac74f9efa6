"""One line of progress on a terminal; nothing where standard error is piped."""

import sys
import time

from twin.campaigns.statistic import Estimate

WIDTH = 78
PERIOD_S = 0.2  # between two lines


class Progress:
    """Runs flown, their rate, the time left and the watched interval.

    Parameters
    ----------
    total : runs of the campaign
    done : of them before this process began
    """

    def __init__(self, total: int, done: int) -> None:
        self._total, self._done, self._new = total, done, 0
        self._began = self._last = time.perf_counter()
        self._shown = sys.stderr.isatty()
        self._estimate = ""

    def estimate(self, name: str, value: Estimate) -> None:
        """Show the interval of a statistic from now on."""
        self._estimate = f", {name} {value.value:.4g} ({value.low:.4g} to {value.high:.4g})"

    def flown(self) -> None:
        """Count one run."""
        self._new += 1
        now = time.perf_counter()
        if not self._shown or now - self._last < PERIOD_S:
            return
        self._last = now
        rate = self._new / max(now - self._began, 1e-9)
        left = max(0, self._total - self._done - self._new) / rate
        text = f"{self._done + self._new} of {self._total} runs, {rate:.3g}/s, {_time(left)} left"
        self._print(text + self._estimate)

    def close(self) -> None:
        """Remove the line."""
        if self._shown:
            self._print("")

    def _print(self, text: str) -> None:
        print(f"\r{text[:WIDTH]:<{WIDTH}}\r", end="", file=sys.stderr, flush=True)


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes}:{rest:02d} min"
