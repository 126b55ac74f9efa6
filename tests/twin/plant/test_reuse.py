"""A model is built once for the same files, and anew for others."""

import os
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.twin.physics.test_openrocket import design, packed
from tests.twin.plant.test_model import DIRECT, TETRAHEDRON, with_mesh, write_stl
from twin.config import Fly
from twin.errors import TwinError
from twin.experiments.flight.fly import fly
from twin.physics import guard
from twin.physics.openrocket import container, convert
from twin.plant.model import reuse
from twin.plant.model.compose import MJCF
from twin.plant.model.model import ModelConfig, load

FLIGHTS = MJCF / "examples" / "flights"


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[ModelConfig]]:
    """Models that were built, in a process that has built none."""
    made: list[ModelConfig] = []
    build = reuse.build

    def counted(config: ModelConfig) -> reuse.Built:
        made.append(config)
        return build(config)

    monkeypatch.setattr(reuse, "build", counted)
    reuse.forget()
    yield made
    reuse.forget()


@pytest.fixture
def own(tmp_path: Path) -> ModelConfig:
    """A description with its motor in a folder of its own."""
    for file in FLIGHTS.glob("valetudo*"):
        shutil.copy(file, tmp_path)
    return ModelConfig(vehicle=tmp_path / "valetudo.toml")


def _edit(path: Path, old: str, new: str) -> None:
    """Change a file so that neither its size nor its times show it."""
    text, before = path.read_text(), path.stat()
    assert old in text
    assert len(old) == len(new)
    path.write_text(text.replace(old, new, 1))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def test_a_flight_of_a_reused_model_equals_the_first_to_the_last_bit(
    builds: list[ModelConfig],
) -> None:
    config = Fly(duration_s=0.1, set=("wind_speed=3",), seed=4)
    first, second = (_flown(config), _flown(config))
    assert len(builds) == 1
    assert first == second
    # other parameters of the same files
    heavy = replace(config, set=("gimbal_holder.mass=0.2",), seed=5)
    again = _flown(heavy)
    assert len(builds) == 1
    reuse.forget()
    assert _flown(heavy) == again != first


def _flown(config: Fly) -> dict[str, object]:
    result = replace(fly(config, recorded=False), cpu_s=0.0, wall_s=0.0, physics_s=0.0)
    return result.as_dict()


def test_an_edited_description_or_motor_is_built_anew(
    builds: list[ModelConfig], own: ModelConfig
) -> None:
    assert own.vehicle is not None
    drag = own.vehicle.with_name("valetudo_drag.csv")
    digests = [load(own).sha256, load(own).sha256]
    for file, old, new in (
        (own.vehicle, "rail = 5.7", "rail = 5.9"),
        (own.vehicle.with_suffix(".eng"), "5.284 0", "5.294 0"),
        (drag, text := drag.read_text().split()[-1], text[:-1] + "7"),
    ):
        _edit(file, old, new)
        digests += [load(own).sha256, load(own).sha256]
    assert digests[::2] == digests[1::2]
    assert len(builds) == len(set(digests)) == 4
    own.vehicle.unlink()
    with pytest.raises(TwinError, match=r"valetudo\.toml"):
        load(own)


def test_what_a_plant_writes_does_not_reach_the_next_flight(builds: list[ModelConfig]) -> None:
    one = load(ModelConfig()).mj
    mass = one.body_mass.copy()
    one.body_mass[:] = 7.0
    one.opt.timestep = 0.5
    other = load(ModelConfig()).mj
    np.testing.assert_array_equal(other.body_mass, mass)
    assert other.opt.timestep < 0.5
    assert len(builds) == 1


def test_settings_that_decide_what_is_compiled_are_told_apart(builds: list[ModelConfig]) -> None:
    backlash = ModelConfig(overrides={"gimbal_backlash": 0.0})
    differ = [ModelConfig(), ModelConfig(dt=0.002), backlash, ModelConfig(gimbal="follow")]
    sizes = [(m.nv, m.nu, m.opt.timestep) for m in (load(c).mj for c in differ)]
    assert len(builds) == len(set(sizes)) == len(differ)
    assert len(reuse._models) <= reuse.MOST


def test_a_model_of_somebodys_own_mjcf_is_built_every_time(
    builds: list[ModelConfig], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guard, "approve", lambda *_, **__: None)  # takes a second a file
    config = ModelConfig(mechanism=with_mesh(tmp_path, TETRAHEDRON))
    load(config)
    write_stl(tmp_path / "part.stl", tuple((c, b, a) for a, b, c in TETRAHEDRON))
    os.utime(tmp_path / "part.stl", (2e9, 2e9))  # MuJoCo keeps a mesh by the second of its file
    with pytest.raises(TwinError, match="inside out"):
        load(config)
    load(ModelConfig(mechanism=DIRECT)), load(ModelConfig(mechanism=DIRECT))
    assert len(builds) == 4


def test_a_path_that_leads_nowhere_is_refused_in_one_line(tmp_path: Path) -> None:
    loop = tmp_path / "loop.toml"
    loop.symlink_to(loop)
    for path in (loop, Path("a\0b.toml")):
        with pytest.raises(TwinError):
            load(ModelConfig(vehicle=path))


def test_a_changed_shipped_file_is_noticed(
    builds: list[ModelConfig], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = shutil.copytree(MJCF, tmp_path / "mjcf")
    monkeypatch.setattr(reuse, "SHIPPED", folder)
    load(ModelConfig()), load(ModelConfig())
    assert len(builds) == 1
    _edit(folder / "parts" / "airframe.xml", "0.1", "0.2")
    load(ModelConfig())
    assert len(builds) == 2


def test_an_openrocket_design_is_parsed_once_a_load(
    builds: list[ModelConfig], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parsed: list[Path] = []
    document = container.document
    monkeypatch.setattr(convert, "document", lambda p: (parsed.append(p), document(p))[1])
    (tmp_path / "k.eng").write_text("K1 54 400 P 0.52 1.1 own\n0.05 250\n3.95 250\n4.05 0\n")
    ork = packed(tmp_path / "own.ork", design(tube="<motormount></motormount>"))
    config = ModelConfig(vehicle=ork, motor=tmp_path / "k.eng")
    first, second = load(config), load(config)
    assert parsed == [ork]
    assert first.notes == second.notes
    packed(ork, design("<podset/>"))
    with pytest.raises(TwinError, match="podset"):
        load(config)
