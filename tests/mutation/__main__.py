"""Mutation testing: python -m tests.mutation [--sample N] [--each N] [--jobs N] [--only TEXT]

Planted breakages first, then mutants made by rule over the listed rooms. `make mutate` runs all of
them in half an hour on two processors; `--sample 40` a fixed choice of planted ones.
"""

import argparse
import sys
import time
from collections.abc import Sequence

from tests.mutation.breakages import PLANTED
from tests.mutation.generated import mutants
from tests.mutation.rooms import ROOMS
from tests.mutation.runner import Mutant, Verdict, Workers
from tests.mutation.survivors import REASONS

LEAST = 0.95  # of all mutants


def chosen(sample: int, each: int, only: str) -> list[Mutant]:
    """The mutants of a run: all, or a fixed sample of the planted ones."""
    every = list(PLANTED[: sample or None])
    if not sample:
        for files, tests in ROOMS:
            every += [m for file in files for m in mutants(file, tests, each)]
    return [m for m in every if only in m.name]


def report(verdicts: Sequence[Verdict], seconds: float) -> bool:
    """Print survivors and score; return whether it suffices."""
    invalid = [v for v in verdicts if v.outcome == "no test ran"]
    alive = [v for v in verdicts if v.outcome == "survived"]
    for v in [*invalid, *alive]:
        reason = REASONS.get(v.mutant.name, "")
        print(f"{v.outcome}: {v.mutant.name}{f' ({reason})' if reason else ''}")
    killed = len(verdicts) - len(alive) - len(invalid)
    share = killed / max(len(verdicts), 1)
    print(f"{killed} of {len(verdicts)} mutants killed, {100 * share:.1f} %, in {seconds:.0f} s")
    return share >= LEAST and not invalid


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
    began, verdicts = time.monotonic(), []
    with Workers(options.jobs) as workers:
        for v in workers.run(chosen(options.sample, options.each, options.only)):
            verdicts.append(v)
            print(f"{v.outcome:11s} {v.seconds:6.1f} s  {v.mutant.name}", flush=True)
            if options.verbose and v.outcome != "killed":
                print(v.output[-3000:])
    return 0 if report(verdicts, time.monotonic() - began) else 1


if __name__ == "__main__":
    sys.exit(main())
