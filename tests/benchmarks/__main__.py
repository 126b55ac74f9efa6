"""`make bench`: every speed the project claims, measured on this machine."""

import sys

from tests.benchmarks import campaign, controller, desk, flight, process, realtime, rocketpy_flights


def main() -> int:
    """Print the table of the sections asked for; all without arguments."""
    sections = {
        "flight": flight.table,
        "controller": controller.table,
        "campaign": campaign.table,
        "process": process.table,
        "desk": desk.table,
        "realtime": realtime.table,
        "rocketpy": rocketpy_flights.table,
    }
    for name in sys.argv[1:] or sections:
        for line in sections[name]():
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
