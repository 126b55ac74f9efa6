"""Hostile input: python -m tests.abuse [--short | --sample] [--seed N] [--minutes M] [--only TEXT]

Prints attempts and failures by kind; exits with 1 if anything failed, with the first failing inputs
of each kind in a folder. The long form goes on for `--minutes`, then simulates an hour.
"""

import argparse
import os
import shutil
import signal
import sys
import tempfile
from pathlib import Path

from tests.abuse import endurance, runs, texts
from tests.abuse.attempt import Kind, Row, abuse, save, table
from tests.twin.cli.test_mutations import KINDS as FILES

SLOW = {"mat": 4, "parquet": 4, "model": 4, "recording": 150}  # a process for each, or megabytes
MANY = 350  # of any other kind of file
# attempts of the short form
KINDS: dict[str, tuple[Kind, int]] = {
    "frames": (texts.codec, 5000),
    **{kind: (texts.files(kind), SLOW.get(kind, MANY)) for kind in FILES},
    "settings": (texts.settings, 825),
    "outputs": (runs.outputs, 60),
    "faults": (runs.faults, 100),
    "peers": (runs.peers, 200),
    "full disk": (runs.disk, 32),
    "signals": (runs.kills, 60),
}


def main() -> int:
    """Print the table; 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--short", action="store_true", help="each kind its number of times")
    length.add_argument("--sample", action="store_true", help="a twentieth of that, at least 2")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=20.0, help="of the long form")
    parser.add_argument("--only", default="", help="kinds whose name contains this")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="kinds at a time")
    options = parser.parse_args()
    kinds = {kind: of for kind, of in KINDS.items() if options.only in kind}
    if options.sample:
        kinds = {kind: (make, max(2, count // 20)) for kind, (make, count) in kinds.items()}
    minutes = 0.0 if options.short or options.sample else options.minutes
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    folder = Path(tempfile.mkdtemp(prefix="abuse-"))  # forked verbs would remove a temporary one
    try:
        rows = abuse(kinds, options.seed, folder, minutes, options.jobs, _progress)
        if minutes and options.only in "simulated hour":
            rows.append(endurance.row(folder))
    finally:
        shutil.rmtree(folder)
    print(table(rows))
    if not any(row.failed for row in rows):
        return 0
    kept = Path(tempfile.mkdtemp(prefix="abuse-failures-"))
    save(rows, kept)
    print(f"first failing inputs: {kept}")
    return 1


def _progress(row: Row) -> None:
    line = f"{row.kind}: {row.attempts} attempts, {len(row.failed)} failures, {row.seconds:.0f} s"
    print(line, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
