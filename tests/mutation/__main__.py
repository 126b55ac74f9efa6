"""Mutation testing: python -m tests.mutation [--sample N] [--each N] [--jobs N] [--only TEXT]

The tests without a mutation first; where they are red their mutants are not tried. Then planted
breakages, then mutants made by rule over the listed rooms. `make mutate` runs all of
them in half an hour on two processors; `--sample 40` a fixed choice of planted ones.
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Sequence

from tests.mutation.breakages import PLANTED
from tests.mutation.generated import mutants
from tests.mutation.rooms import ROOMS
from tests.mutation.runner import Mutant, Verdict, Workers, verdicts
from tests.mutation.survivors import reason

LEAST = 0.95  # of all mutants


def chosen(sample: int, each: int, only: str) -> list[Mutant]:
    """The mutants of a run: all, or a fixed sample of the planted ones."""
    every = list(PLANTED[: sample or None])
    if not sample:
        for files, tests in ROOMS:
            every += [m for file in files for m in mutants(file, tests, each)]
    return [m for m in every if only in m.name]


def report(found: Sequence[Verdict], seconds: float) -> bool:
    """Print survivors and score; return whether it suffices."""
    for v in found:
        if v.outcome != "killed":
            why = reason(v.mutant)
            print(f"{v.outcome}: {v.mutant.name}{f' ({why})' if why else ''}")
    count = Counter(v.outcome for v in found)
    killed, late = count["killed"], count["timed out"]
    share = killed / max(len(found), 1)
    print(
        f"{killed} of {len(found)} mutants killed, {100 * share:.1f} %, {late} timed out,"
        f" in {seconds:.0f} s"
    )
    return share >= LEAST and not count["no test ran"] and not count["not tried"]


def main() -> int:
    """Run the mutants; exit code 1 if fewer than 95 % are killed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--sample", type=int, default=0, help="only that many planted ones")
    parser.add_argument("--each", type=int, default=3, help="mutants by rule for each file")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="", help="mutants whose name contains this")
    parser.add_argument("--list", action="store_true", help="print the mutants, run nothing")
    parser.add_argument("--verbose", action="store_true", help="output of the tests of survivors")
    options = parser.parse_args()
    if options.list:
        for m in chosen(options.sample, options.each, options.only):
            print(m.name)
        return 0
    began, found = time.monotonic(), []
    with Workers(options.jobs) as workers:
        for v in verdicts(workers, chosen(options.sample, options.each, options.only)):
            found.append(v)
            print(f"{v.outcome:11s} {v.seconds:6.1f} s  {v.mutant.name}", flush=True)
            if options.verbose and v.outcome != "killed":
                print(v.output[-3000:])
    return 0 if report(found, time.monotonic() - began) else 1


if __name__ == "__main__":
    sys.exit(main())
