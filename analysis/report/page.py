"""Sections to one HTML page that asks no network for anything."""

import base64
import hashlib
import json
from collections.abc import Sequence
from html import escape as escaped
from importlib.util import find_spec
from pathlib import Path

from analysis import schema
from analysis.files import write_text
from analysis.report.parts import Cell, Plot, Section, Table, Verdicts
from analysis.schema import AnalysisError
from analysis.signs import unsigned_zeros

HERE = Path(__file__).parent


def escape(text: str) -> str:
    """Text of a page, without a minus before zeros."""
    return escaped(unsigned_zeros(text))


def render(
    sections: Sequence[Section], title: str, out: Path | str, numbers: object = None
) -> Path:
    """Write one self-contained page; an older one of that name is replaced in one go.

    Every text is escaped here and nowhere else. A content security policy lets the browser run the
    page's own two scripts, by their hashes, and fetch nothing.

    Parameters
    ----------
    sections : in the order of the page; names must differ
    out : file, `.html`
    numbers : JSON values kept in the page for machines, `#numbers`

    Raises
    ------
    AnalysisError : plotly is not installed, or the file cannot be written
    """
    out = Path(out)
    plots = [p.to_dict() for s in sections for p in s.parts if isinstance(p, Plot)]
    library, script = _plotly(), _own("page.js")
    page = _own("page.html")
    content = {
        "generator": schema.APPLICATION,
        "policy": " ".join(map(_hash, (library, script))),
        "title": escape(title),
        "style": _own("page.css"),
        "contents": "".join(f'<a href="#{escape(s.name)}">{escape(s.title)}</a>' for s in sections),
        "sections": "\n".join(map(_section, sections)),
        "plots": _json(plots),
        "numbers": _json(numbers),
        "library": library,
        "script": script,
    }
    # one pass: a placeholder inside a recording's own text stays text
    pieces = page.split("{{")
    text = pieces[0] + "".join(
        content[key] + rest for key, _, rest in (p.partition("}}") for p in pieces[1:])
    )
    write_text(out, text)
    return out


def _section(section: Section) -> str:
    """The title stays with the first part when the page is printed; a long table may be cut."""
    parts = [_part(p) for p in section.parts]
    text = "\n".join(f"<p>{escape(t)}</p>" for t in section.text)
    head = f"<h2>{escape(section.title)}</h2>\n{text}"
    if section.parts and isinstance(section.parts[0], Plot):
        head = f"<div class=keep>{head}\n{parts.pop(0)}</div>"
    body = "\n".join(parts)
    return f'<section id="{escape(section.name)}">\n{head}\n{body}\n</section>'


def _part(part: Plot | Table | Verdicts) -> str:
    if isinstance(part, Plot):
        return _figure(part)
    return _table(part) if isinstance(part, Table) else _verdicts(part)


def _verdicts(part: Verdicts) -> str:
    items = "".join(
        f"<li class={grade}>{escape(text)} <b>{grade}</b></li>" for text, grade in part.items
    )
    caption = f"<p class=caption>{escape(part.caption)}</p>" if part.caption else ""
    return f"<ul class=verdicts>{items}</ul>{caption}"


def _figure(plot: Plot) -> str:
    rows = 1 + max(p.row for p in plot.panels)
    height = rows * plot.panel_height + 110
    return (
        f'<figure><div class="plot" id="plot-{escape(plot.name)}" role="img"'
        f' aria-label="{escape(plot.caption)}" style="height:{height}px"></div>\n'
        f"<figcaption>{escape(plot.caption)}</figcaption></figure>"
    )


def _table(table: Table) -> str:
    if not table.rows:
        return f"<p class=caption>{escape(table.caption)}</p>"
    head = "".join(f"<th scope=col>{escape(h)}</th>" for h in table.head)
    rows = "\n".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in table.rows)
    caption = f"<p class=caption>{escape(table.caption)}</p>" if table.caption else ""
    body = (
        f"<div class=scroll><table><thead><tr>{head}</tr></thead>\n"
        f"<tbody>{rows}</tbody></table></div>{caption}"
    )
    if not table.folded:
        return body
    return f"<details><summary>{escape(table.folded)}</summary>{body}</details>"


def _cell(cell: Cell | str) -> str:
    if isinstance(cell, str):
        cell = Cell(cell)
    kind = f" class={cell.mark}" if cell.mark else ""
    return f"<td{kind}>{escape(cell.text).replace('_', '_<wbr>')}</td>"


def _json(value: object) -> str:
    """JSON that cannot end the script element it stands in (HTML, 4.12.1.3)."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _own(name: str) -> str:
    return (HERE / name).read_text(encoding="utf-8")


def _plotly() -> str:
    """The drawing library as plotly's package carries it; the package itself is not imported."""
    spec = find_spec("plotly")
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        file = Path(folder) / "package_data" / "plotly.min.js"
        if file.is_file():
            text = file.read_text(encoding="utf-8")
            if "</script" in text.lower():
                raise AnalysisError(f"{file} cannot stand inside a page: it holds '</script'")
            return text
    raise AnalysisError("plotly is not installed; the report needs it (`pip install plotly`)")


def _hash(script: str) -> str:
    # what stands between the tags is what is hashed, as UTF-8 (CSP 3, 8.2)
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
