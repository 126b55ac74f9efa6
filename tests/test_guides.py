"""Every command and every block of Python in docs/guides runs, in order, in an empty folder.

What a page says is printed, after `prints ...:`, must be among the lines of the block before.
"""

import re
import shlex

import pytest

from tests.conftest import ROOT
from twin.cli.main import main

GUIDES = ROOT / "docs" / "guides"
PAGES = sorted(p.stem for p in GUIDES.glob("*.md") if p.stem != "README")
QUICK = ("inspect", "own_mechanism")  # a second each; the others are long, `make test-long`
SAVED, PRINTED = r"(?:[Ss]ave as `([\w.]+)`:\n\n)?", r"(?:^[^\n]*\b(prints)\b[^\n]*:\n\n)?"
BLOCK = re.compile(
    rf"{SAVED}{PRINTED}^```(sh|python|toml|text)\n(.*?)^```", re.DOTALL | re.MULTILINE
)
EXIT = re.compile(r"# exit code (\d)$")


def follow(page: str, folder, capsys) -> int:
    """Do what a page says; returns how many commands it has."""
    (folder / "mjcf").symlink_to(ROOT / "mjcf")
    text = (GUIDES / f"{page}.md").read_text(encoding="utf-8")
    count, shown = 0, set()
    for saved, printed, kind, block in BLOCK.findall(text):
        if saved:
            (folder / saved).write_text(block)
        elif kind == "text":
            expected = [" ".join(line.split()) for line in block.splitlines() if printed]
            assert [line for line in expected if line not in shown] == []
            continue
        elif kind == "python":
            exec(compile(block, f"{page}.md", "exec"), {"__name__": page})
        else:
            for line in block.splitlines():
                program, *arguments = shlex.split(line, comments=True)
                assert program == "twin"
                with pytest.raises(SystemExit) as end:
                    main(arguments)
                expected = EXIT.search(line)
                assert end.value.code == int(expected[1] if expected else 0), line
                count += 1
        shown = {" ".join(line.split()) for line in capsys.readouterr().out.splitlines()}
    return count


@pytest.mark.parametrize(
    "page", [p if p in QUICK else pytest.param(p, marks=pytest.mark.slow) for p in PAGES]
)
def test_every_command_of_a_guide_succeeds(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert follow(page, tmp_path, capsys) >= 2
    written = {p.name for p in tmp_path.iterdir()} - {"mjcf", "runs"}
    saved = set(re.findall(r"[Ss]ave as `([\w.]+)`", (GUIDES / f"{page}.md").read_text()))
    assert written - saved <= {"a.toml", "b.toml"}  # the two shares of `many_machines`


def test_the_overview_lists_every_guide():
    linked = re.findall(r"\]\((\w+)\.md\)", (GUIDES / "README.md").read_text())
    assert sorted(linked) == PAGES
