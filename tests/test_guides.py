"""Every command and every block of Python in docs/guides runs, in order, in an empty folder."""

import re
import shlex

import pytest

from tests.conftest import ROOT
from twin.cli.main import main

GUIDES = ROOT / "docs" / "guides"
PAGES = sorted(p.stem for p in GUIDES.glob("*.md") if p.stem != "README")
QUICK = ("inspect", "own_mechanism")  # a second each; the others are long, `make test-long`
BLOCK = re.compile(r"(?:Save as `([\w.]+)`:\n\n)?^```(sh|python|toml)\n(.*?)^```", re.DOTALL | re.M)


def follow(page: str, folder) -> int:
    """Do what a page says; returns how many commands it has."""
    (folder / "mjcf").symlink_to(ROOT / "mjcf")
    text = (GUIDES / f"{page}.md").read_text(encoding="utf-8")
    count = 0
    for saved, kind, block in BLOCK.findall(text):
        if saved:
            (folder / saved).write_text(block)
        elif kind == "python":
            exec(compile(block, f"{page}.md", "exec"), {"__name__": page})
        else:
            for line in block.splitlines():
                program, *arguments = shlex.split(line, comments=True)
                assert program == "twin"
                with pytest.raises(SystemExit) as end:
                    main(arguments)
                assert end.value.code == 0, line
                count += 1
    return count


@pytest.mark.parametrize(
    "page", [p if p in QUICK else pytest.param(p, marks=pytest.mark.slow) for p in PAGES]
)
def test_every_command_of_a_guide_succeeds(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert follow(page, tmp_path) >= 2


def test_the_overview_lists_every_guide():
    linked = re.findall(r"\]\((\w+)\.md\)", (GUIDES / "README.md").read_text())
    assert sorted(linked) == PAGES
