"""Writes the message tables of docs/protocol.md from hardware/protocol/messages.py.

python .ci/protocol.py          write them
python .ci/protocol.py --check  exit 1 if they are out of date
"""

import struct
import sys

from source_names import ROOT

from hardware.protocol import MESSAGES, SESSION, layout
from hardware.protocol.wire import C_TYPES

PAGE = ROOT / "docs" / "protocol.md"
HEADING = "## Messages\n\n"


def main() -> int:
    """Write or check the page."""
    text = PAGE.read_text(encoding="utf-8")
    before, heading, _ = text.partition(HEADING)
    new = before + heading + tables()
    if "--check" in sys.argv:
        if new != text:
            print("docs/protocol.md is out of date; run `python .ci/protocol.py`")
        return int(new != text)
    PAGE.write_text(new, encoding="utf-8")
    return 0


def tables() -> str:
    """One section for each message."""
    lines: list[str] = []
    for cls in (*MESSAGES, *SESSION):
        place = layout(cls)
        direction = "device → host" if place.type_id >= 0x80 else "host → device"
        title = f"### {cls.__name__} `0x{place.type_id:02x}`, {direction}, {place.size} bytes"
        lines += [title, "", (cls.__doc__ or "").splitlines()[0], ""]
        if not place.fields:
            continue
        lines += ["| offset | field | type | unit | |", "|---|---|---|---|---|"]
        at = 0
        for f in place.fields:
            kind = C_TYPES[f.wire.code].removesuffix("_t")
            kind = f"{kind} × {f.wire.count}" if f.wire.count > 1 else kind
            lines.append(f"| {at} | `{f.name}` | {kind} | {f.wire.unit} | {f.wire.about} |")
            at += struct.calcsize(f"<{f.wire.count}{f.wire.code}")
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
