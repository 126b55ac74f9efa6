"""The documentation of the printed parts, against what is drawn and measured on the STL."""

import re
from collections import Counter
from pathlib import Path

import mujoco
import numpy as np
import pytest

from meshes.generate import PARTS
from tests.meshes.test_screws import MODEL, TUBE, Axis, place, radial

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


NUMBER = r"(-?\d+(?:\.\d+)?)"
MECHANISM = (ROOT / "docs" / "mechanism.md").read_text(encoding="utf-8")


def numbers(text: str) -> list[float]:
    return [float(n) for n in re.findall(NUMBER, text)]


@pytest.mark.parametrize("axis", "xy")
def test_the_wire_of_a_rod_fills_the_bores_of_its_ends(axis):
    row = re.search(r"^Rods: (.*?)cut the wire to (.*?): ", MECHANISM, re.DOTALL | re.MULTILINE)
    balls, wires = (dict(zip("xy", numbers(part), strict=True)) for part in row.groups())
    apart = np.linalg.norm(place(f"gimbal_horn_{axis}_ball") - place(f"gimbal_holder_{axis}_ball"))
    assert balls[axis] == pytest.approx(apart, abs=0.05)
    end = Axis("rod_end", (0.0, 0.0, -20.0), (0.0, 0.0, 1.0))
    bore = 20.0 - end.ends(end.closed)[0]  # from the centre of the ball to the end of the bore
    assert wires[axis] == pytest.approx(apart - 2 * bore, abs=0.1)
    bill = (ROOT / "docs" / "wiring.md").read_text(encoding="utf-8")
    assert f"cut to {wires['x']} and {wires['y']} mm" in bill


def holes(where: str) -> tuple[list[float], ...]:
    row = next(r for r in MECHANISM.splitlines() if r.startswith(f"| {where}, "))
    return tuple(numbers(cell) for cell in row.split("|")[2:-1])


def test_the_holes_to_drill_for_the_bracket_are_those_of_its_stl():
    azimuths, along, aft, forward = holes("bracket")
    assert along == pytest.approx([np.radians(a) * TUBE for a in azimuths], abs=0.06)
    assert end_of_tube() - np.array(aft) == pytest.approx(forward, abs=0.05)
    assert len(azimuths) * len(forward) == 6
    for azimuth in azimuths:
        for height in forward:
            way = -radial(azimuth)
            axis = Axis("bracket", -TUBE * way + (0.0, 0.0, height), way)
            shell = axis.inside(1.25).all(axis=0) & (axis.at > 1.3) & (axis.at < 2.4)
            assert shell.sum() > 0.9 * STEPS
            assert not (axis.inside(0.98).any(axis=0) & (axis.at < 5.0)).any()


STEPS = 1.1 / 0.02  # samples between the faces of the shell, 1.3 to 2.4 mm from the tube's face


def end_of_tube() -> float:
    """Forward end, from the pivot [mm]."""
    tube = MODEL.site("gimbal_tube")
    return float((tube.pos[2] + tube.size[1]) * 1e3)


def test_the_holes_to_drill_for_the_x_axis_are_those_of_the_bulkhead():
    azimuths, along, aft, forward = holes("x axis")
    assert along == pytest.approx([np.radians(a) * TUBE for a in azimuths], abs=0.06)
    assert aft == [pytest.approx(end_of_tube(), abs=0.05)]
    for azimuth in azimuths:
        way = -radial(azimuth)
        axis = Axis("bulkhead", -TUBE * way + (0.0, 0.0, forward[0]), way)
        assert (axis.thread & (axis.at < TUBE)).sum() * 0.02 > 3.0


def test_the_parts_said_to_be_in_the_frame_of_the_mechanism_are_drawn_there():
    said = re.search(r"In the frame of the mechanism(.*?)\. The others", MECHANISM, re.DOTALL)[1]
    there = set(re.findall(r"`(\w+)`", said))
    data = mujoco.MjData(MODEL)
    mujoco.mj_kinematics(MODEL, data)
    mount, drawn = data.body("gimbal_mount"), set()
    for geom in range(MODEL.ngeom):
        mesh = MODEL.geom_dataid[geom]
        if mesh < 0:
            continue
        # of the file's own frame, which MuJoCo moves to the mesh's centre of mass
        offset, turn = np.zeros(3), np.zeros(9)
        mujoco.mju_quat2Mat(turn, MODEL.mesh_quat[mesh])
        rotation = data.geom_xmat[geom].reshape(3, 3) @ turn.reshape(3, 3).T
        offset = data.geom_xpos[geom] - rotation @ MODEL.mesh_pos[mesh] - mount.xpos
        same = np.allclose(rotation, mount.xmat.reshape(3, 3), atol=1e-6)
        if same and np.allclose(offset, 0.0, atol=1e-6):
            drawn.add(MODEL.mesh(mesh).name.removeprefix("gimbal_"))
    assert there == drawn
