"""Hostile input: python -m tests.abuse [--short] [--seed N] [--minutes M] [--only TEXT]

Prints attempts and failures by kind; exits with 1 if anything failed, with the first failing inputs
of each kind in a folder. The short form takes three minutes, the other goes on for `--minutes`.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from tests.abuse import runs, texts
from tests.abuse.attempt import Kind, Row, abuse, save, table
from tests.twin.test_mutations import KINDS as FILES

SLOW = {"mat": 4, "parquet": 4, "model": 4, "recording": 300}  # a process for each, or megabytes
MANY = 350  # of any other kind of file
# attempts of the short form
KINDS: dict[str, tuple[Kind, int]] = {
    "frames": (texts.codec, 5000),
    **{kind: (texts.files(kind), SLOW.get(kind, MANY)) for kind in FILES},
    "settings": (texts.settings, 825),
    "outputs": (runs.outputs, 60),
    "faults": (runs.faults, 100),
    "peers": (runs.peers, 200),
    "full disk": (runs.disk, 16),
    "signals": (runs.kills, 16),
}


def main() -> int:
    """Print the table; 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--short", action="store_true", help="one round, whatever --minutes says")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=20.0, help="of the long form")
    parser.add_argument("--only", default="", help="kinds whose name contains this")
    options = parser.parse_args()
    kinds = {kind: of for kind, of in KINDS.items() if options.only in kind}
    with tempfile.TemporaryDirectory(prefix="abuse-") as folder:
        minutes = 0.0 if options.short else options.minutes
        rows = abuse(kinds, options.seed, Path(folder), minutes, _progress)
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
