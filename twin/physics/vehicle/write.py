"""A design as the TOML text that `read` takes."""

import math
from collections.abc import Iterable
from dataclasses import MISSING, fields
from typing import Any

from twin.physics.vehicle.design import Allowed, Design, allowed
from twin.physics.vehicle.read import LISTS, TABLES


def toml(design: Design, comments: Iterable[str] = ()) -> str:
    """Text of a description: what differs from the defaults, lengths in mm and masses in g."""
    lines = [f"# {' '.join(line.split())}" for line in comments]
    lines += [f"{key} = {text}" for key, text in entries(design)]
    for key in LISTS:
        items = [f"  {_inline(item)}," for item in getattr(design, key)]
        lines += [f"{key} = [", *items, "]"] if items else []
    for key in TABLES:
        value = getattr(design, key)
        text = "" if value is None else _inline(value)
        lines += [f"{key} = {text}"] if text not in ("", "{  }") else []
    return "\n".join(lines) + "\n"


def _inline(item: Any) -> str:  # noqa: ANN401  any table of a design
    return "{ " + ", ".join(f"{k} = {t}" for k, t in entries(item)) + " }"


def entries(item: Any) -> list[tuple[str, str]]:  # noqa: ANN401
    """Keys and values of a table that are not the defaults."""
    limits = allowed(type(item))
    found = []
    for f in fields(item):
        value = getattr(item, f.name)
        if f.name in limits and (f.default is MISSING or value != f.default):
            found.append((f.name, _text(limits[f.name], value)))
    return found


def _text(limits: Allowed, value: Any) -> str:  # noqa: ANN401
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, tuple):
        return "[" + ", ".join(_text(Allowed("length"), v) for v in value) + "]"
    if limits.kind == "length":
        return f'"{value * 1e3:.7g} mm"' if abs(value) < 1.0 else f'"{value:.7g} m"'
    if limits.kind == "mass":
        return f'"{value * 1e3:.7g} g"' if value < 1.0 else f'"{value:.7g} kg"'
    if limits.kind == "angle":
        return f'"{math.degrees(value):.7g}°"'
    return f"{value:.7g}"
