"""The printed parts in the documentation are those that are drawn, as many as the bench shows."""

import re
from collections import Counter
from pathlib import Path

import mujoco

from meshes.generate import PARTS

ROOT = Path(__file__).resolve().parents[2]
NAME = re.compile(r"`(\w+)\.stl`")


def test_the_table_of_printed_parts_has_every_mesh_and_the_pieces_that_the_bench_shows():
    text = (ROOT / "docs" / "mechanism.md").read_text(encoding="utf-8")
    table = {n: int(k) for n, k in re.findall(r"^\| `(\w+)\.stl` \| (\d+) \|", text, re.M)}
    assert set(table) == set(PARTS)
    bench = mujoco.MjModel.from_xml_path(str(ROOT / "mjcf" / "bench.xml"))
    meshes = (int(m) for m in bench.geom_dataid if m >= 0)
    shown = Counter(bench.mesh(m).name.removeprefix("gimbal_") for m in meshes)
    assert table == shown


def test_the_bill_of_materials_names_no_part_that_is_not_drawn():
    text = (ROOT / "docs" / "wiring.md").read_text(encoding="utf-8")
    named = set(NAME.findall(text))
    assert named
    assert named <= set(PARTS)
