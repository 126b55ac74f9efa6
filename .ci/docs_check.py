"""Every relative link of the documentation leads somewhere, every command it shows exists."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINK = re.compile(r"!?\[[^\]]*\]\(([^)#\s]+)[^)]*\)")
COMMAND = re.compile(r"^\s*(?:\$ )?(?:\.venv/bin/)?(twin [a-z]+[^#|>\n]*)", re.MULTILINE)
FENCE = re.compile(r"```(?:sh|bash|console)\n(.*?)```", re.DOTALL)


def dead_links(page: Path) -> list[str]:
    """Targets of `page` that are no file of the project."""
    targets = LINK.findall(page.read_text())
    local = [t for t in targets if "://" not in t and not t.startswith("mailto:")]
    return [t for t in local if not (page.parent / t).exists()]


def commands(page: Path) -> set[str]:
    """The `twin` commands shown in shell blocks of `page`."""
    blocks = FENCE.findall(page.read_text())
    return {match.strip() for block in blocks for match in COMMAND.findall(block)}


def unknown_flags(command: str) -> list[str]:
    """Flags of `command` that its --help does not list."""
    words = shlex.split(command)
    flags = {w.split("=")[0] for w in words if w.startswith("--")}
    shown = subprocess.run(
        [str(ROOT / ".venv/bin/twin"), words[1], "--help"],
        capture_output=True,
        text=True,
        check=False,
    )
    if shown.returncode != 0:
        return [f"no command {words[1]!r}"]
    return sorted(f for f in flags if f not in shown.stdout)


def main() -> int:
    """Print what is wrong; the number of wrong things is the exit code."""
    wrong = [f"{p.relative_to(ROOT)}: dead link {t}" for p in PAGES for t in dead_links(p)]
    for page in PAGES:
        for command in sorted(commands(page)):
            wrong += [f"{page.relative_to(ROOT)}: {command!r}: {f}" for f in unknown_flags(command)]
    print("\n".join(wrong) or f"{len(PAGES)} pages: links and commands are good")
    return min(len(wrong), 1)


if __name__ == "__main__":
    sys.exit(main())
