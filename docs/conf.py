"""The documentation as a site: `make docs` builds build/docs.

The source folder is the checkout, so that relative links between pages and to files hold there and
on a code host.
"""

import re
import shutil
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from twin.config.verbs import VERBS  # noqa: E402

package = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
project, release = "TVC twin", package["version"]
html_title = f"{project} {release}"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "README"
include_patterns = ["*.md", "docs/**", "hardware/simavr/NOTICE.md"]
exclude_patterns = [".*", "build", "dist", "runs", "tests", "docs/conf.py"]
html_theme = "furo"
html_extra_path = ["llms.txt"]
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
html_theme_options = {"navigation_with_keys": True}
myst_heading_anchors = 4
autodoc_typehints = "none"  # the signatures of the verbs would be a screen long
autodoc_default_options = {"members": True}
napoleon_google_docstring = False
napoleon_use_ivar = True
default_role = "code"
suppress_warnings = ["ref.python"]  # words of descriptions that are names of several attributes
ENTRY = re.compile(r"^([\w, *]+?) : (.+)$")

START = ("docs/guides/README", "docs/python", "docs/examples/README")
GUIDES = [  # in the order of the overview
    f"docs/guides/{name}"
    for name in re.findall(r"\]\((\w+)\.md\)", (ROOT / f"{START[0]}.md").read_text("utf-8"))
]
REFERENCE = (
    *("docs/recording", "docs/report", "docs/protocol", "docs/states", "docs/licences"),
    *("docs/api/twin", "docs/api/analysis", "docs/api/hardware", "CHANGELOG"),
)
DEVELOP = ("docs/architecture", "docs/extending", "CONTRIBUTING", "hardware/simavr/NOTICE")


def contents(pages: Iterable[str], caption: str = "") -> str:
    """A table of contents for the navigation only."""
    title = f":caption: {caption}\n" if caption else ""
    lines = "\n".join(f"/{page}" for page in pages)
    return f"\n\n```{{toctree}}\n:hidden:\n{title}\n{lines}\n```\n"


def navigation() -> str:
    """The site's tables of contents; a new page in docs/ is an explanation."""
    explanations = named("docs/*.md")
    placed = {*START, *REFERENCE, *DEVELOP, "docs/validation"}
    sections = {
        "Start": START,
        "Guides": GUIDES,
        "Explanations": [page for page in explanations if page not in placed],
        "Reference": REFERENCE,
        "Validation": ["docs/validation"],
        "Development": [*DEVELOP, "docs/decisions/README"],
    }
    return "".join(contents(pages, caption) for caption, pages in sections.items())


def named(pattern: str) -> list[str]:
    """Pages as Sphinx names them."""
    return [str(p.relative_to(ROOT).with_suffix("")) for p in sorted(ROOT.glob(pattern))]


def with_navigation(_: Sphinx, page: str, text: list[str]) -> None:
    """Add to the pages what the site's navigation needs and a code host would show as code."""
    if page == root_doc:
        text[0] += navigation()
    if page == "docs/decisions/README":
        text[0] += contents(named("docs/decisions/0*.md"))
    if page == "docs/api/twin":
        text[0] += "".join(f"\n\n.. autofunction:: twin.{verb.name}" for verb in VERBS)


def with_index(app: Sphinx, error: Exception | None) -> None:
    """Give the first page the name that servers look for."""
    if error is None:
        shutil.copy(Path(app.outdir) / f"{root_doc}.html", Path(app.outdir) / "index.html")


def without_types(*arguments: object) -> None:
    """Make the texts after `name : ` descriptions; napoleon takes them for types."""
    lines = arguments[-1]
    assert isinstance(lines, list)
    pairs = (ENTRY.sub(r"\1\n    \2", line) for line in lines)
    lines[:] = [line for pair in pairs for line in pair.split("\n")]


def setup(app: Sphinx) -> None:
    """Connect the functions above; Sphinx calls it."""
    app.connect("source-read", with_navigation)
    app.connect("autodoc-process-docstring", without_types, priority=100)  # before napoleon
    app.connect("build-finished", with_index)
