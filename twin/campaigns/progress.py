"""Progress of a campaign, for the status line."""

import time

from twin import status
from twin.campaigns.statistics.statistic import Estimate


class Progress:
    """Runs flown, their rate, the time left and the watched interval.

    Parameters
    ----------
    total : runs of the campaign
    done : of them before this process began
    """

    def __init__(self, total: int, done: int) -> None:
        self._total, self._done, self._new = total, done, 0
        self._began = time.perf_counter()
        self._estimate = ""
        status.say(self.text)

    def estimate(self, name: str, value: Estimate) -> None:
        """Show the interval of a statistic from now on."""
        self._estimate = f", {name} {value.value:.4g} ({value.low:.4g} to {value.high:.4g})"

    def flown(self) -> None:
        """Count one run."""
        self._new += 1

    def text(self) -> str:
        """Return what the status line shows."""
        rate = self._new / max(time.perf_counter() - self._began, 1e-9)
        flown = f"{self._done + self._new} of {self._total} runs"
        if not self._new:
            return flown
        left = max(0, self._total - self._done - self._new) / rate
        return f"{flown}, {rate:.3g}/s, {_time(left)} left{self._estimate}"


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes}:{rest:02d} min"
