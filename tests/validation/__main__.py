"""`make validate`: measures every claim and renews its row of docs/validation.md."""

import argparse
import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from tests.validation.check import COMMAND, Check

PAGE = Path(__file__).resolve().parents[2] / "docs" / "validation.md"
HEAD = (
    "| claim | truth | command | measured | tolerance | date | verdict |\n"
    "|---|---|---|---|---|---|---|\n"
)
TABLE = re.compile(r"(?<=<!-- figures -->\n).*?(?=<!-- end of figures -->)", re.DOTALL)
ROW = re.compile(rf"^\|.*`{re.escape(COMMAND)} ([\w-]+)`.*$", re.MULTILINE)


def rows_of(text: str) -> dict[str, str]:
    """Lines of the page's table by the name in their command."""
    table = TABLE.search(text)
    return {m[1]: m[0] for m in ROW.finditer(table[0])} if table else {}


def renew(page: Path, rows: dict[str, str], order: Sequence[str]) -> None:
    """Put rows into the page's table; those not measured stay, those of no check go."""
    text = page.read_text(encoding="utf-8")
    known = rows_of(text) | rows
    table = HEAD + "".join(f"{known[name]}\n" for name in order if name in known)
    page.write_text(TABLE.sub(lambda _: f"\n{table}\n", text), encoding="utf-8")


def run(checks: Sequence[Check], page: Path, chosen: Sequence[Check]) -> int:
    """Measure the chosen checks, print and note each; 1 where one fails."""
    rows, failed, date = {}, 0, time.strftime("%Y-%m-%d")
    for check in chosen:
        began = time.process_time()
        figure = check.measure()
        took = time.process_time() - began
        rows[check.name] = check.row(figure, date)
        failed += not check.holds(figure)
        verdict = "holds" if check.holds(figure) else "FAILS"
        measured = f"{figure:.3g}{check.unit} ({check.tolerance()})"
        print(f"{check.name:20s} {measured:34s} {verdict}, {took:.1f} s of CPU", flush=True)
    renew(page, rows, [c.name for c in checks])
    print(f"{len(chosen)} checks, {failed} failed; {page}")
    return int(failed > 0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the checks asked for, all without arguments."""
    from tests.validation.checks import CHECKS

    parser = argparse.ArgumentParser(prog="python -m tests.validation", description=__doc__)
    parser.add_argument("--only", metavar="NAME", choices=[c.name for c in CHECKS])
    parser.add_argument("--quick", action="store_true", help="at most two minutes")
    options = parser.parse_args(arguments)
    chosen = [c for c in CHECKS if options.only in (None, c.name)]
    if options.quick:
        chosen = [c for c in chosen if not c.long]
    return run(CHECKS, PAGE, chosen)


if __name__ == "__main__":
    sys.exit(main())
