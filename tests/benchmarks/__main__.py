"""Speeds of the project: python -m tests.benchmarks [--json FILE] [SECTION...]

One table of ratios to a limit and to a peer measured in the same run; `!` marks a figure beyond its
limit, which on a loaded machine says little. Exits with 1 if a section could not be measured.
"""

import argparse
import json
import os
import platform
import sys
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.benchmarks import campaign, controller, desk, flight, process, realtime, rocketpy_flights
from tests.benchmarks.timing import HEAD, Row, missed

SECTIONS = {
    "flight": flight.table,
    "controller": controller.table,
    "campaign": campaign.table,
    "process": process.table,
    "desk": desk.table,
    "realtime": realtime.table,
    "rocketpy": rocketpy_flights.table,
}


def measured(name: str, table: Callable[[], Iterator[Row]]) -> Iterator[Row]:
    """Rows of a section; one that says so where it ends in an error."""
    try:
        yield from table()
    except Exception as error:
        traceback.print_exc()
        yield Row(f"section {name}", None, note=f"failed: {type(error).__name__}")


def main(arguments: list[str] | None = None) -> int:
    """Print the table of the sections asked for; all without arguments."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(SECTIONS))
    parser.add_argument("--json", type=Path, metavar="FILE", help="the same as JSON")
    options = parser.parse_args(arguments)
    if unknown := set(options.sections) - set(SECTIONS):
        parser.error(f"{', '.join(sorted(unknown))}: must be of {', '.join(SECTIONS)}")
    load = os.getloadavg()[0]
    print(f"{platform.machine()}, {os.cpu_count()} processors, load {load:.1f}\n{HEAD}", flush=True)
    found: dict[str, list[Row]] = {}
    for name in options.sections or SECTIONS:
        found[name] = []
        for row in measured(name, SECTIONS[name]):
            found[name].append(row)
            print(row, flush=True)
    rows = [row for section in found.values() for row in section]
    print(f"{len(rows)} figures, {len(missed(rows))} beyond their limit or not measured")
    if options.json:
        text = json.dumps(_document(load, found), indent=1, ensure_ascii=False)
        options.json.write_text(text + "\n")
    return int(any(row.claim == f"section {name}" for name in found for row in found[name]))


def _document(load: float, found: dict[str, list[Row]]) -> dict[str, object]:
    return {
        "machine": platform.machine(),
        "processors": os.cpu_count(),
        "load": load,
        "sections": {name: [row.numbers() for row in rows] for name, rows in found.items()},
    }


if __name__ == "__main__":
    sys.exit(main())
