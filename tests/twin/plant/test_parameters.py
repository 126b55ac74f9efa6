"""`twin parameters` lists what `--set` takes, each with its value, unit and meaning."""

import pytest

import twin
from analysis.units import in_unit
from twin.plant.compiled import compiled
from twin.plant.model import overrides
from twin.plant.model.model import ModelConfig, load


@pytest.mark.parametrize("scene", ["flight", "turntable"])
def test_every_parameter_is_described_and_has_the_value_that_set_reads_and_writes(scene):
    listed = twin.parameters(scene=scene).parameters
    with compiled():
        model = load(ModelConfig(scene=scene)).mj
    assert len(listed) > 80
    for p in listed:
        assert p.meaning != "of this model", p.name
        assert p.unit, p.name
        for unit in p.unit.split(", "):
            assert in_unit(f"2 {unit.strip('-')}", unit) == 2.0, p.name
        first = p.name if "." not in p.name and len(p.values) == 1 else f"{p.name}[0]"
        if p.name.endswith((".mass", ".stiffness")):
            first = p.name
        assert overrides.value(model, first) == p.values[0], p.name
    named = {p.name: p.values[0] for p in listed if len(p.values) == 1}
    overrides.apply(model, {name: value for name, value in named.items() if "." not in name})


def test_words_filter_names_and_meanings_and_set_changes_the_value():
    found = twin.parameters("wind", set={"wind_speed": 6.0}).as_dict()
    assert found["wind_speed"] == {
        "value": 6.0, "unit": "m/s", "meaning": "mean wind at the reference height"
    }  # fmt: skip
    assert all("wind" in f"{name} {p['meaning']}" for name, p in found.items())


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"set": {"wind_sped": 1.0}}, r"did you mean wind_speed or .*\? `twin parameters` lists"),
        ({"set": {"vehicel.mass": 1.0}}, r"no body 'vehicel'; did you mean vehicle\?"),
        ({"vehicle": overrides.__file__.replace("twin/plant/model/overrides.py",
                                                "mjcf/flight.xml")},
         r"--vehicle .*flight\.xml: is a scene, with a ground; give it as --scene"),
    ],
)  # fmt: skip
def test_a_wrong_name_gives_the_nearest_ones_and_a_scene_is_no_vehicle(settings, says):
    with pytest.raises(twin.TwinError, match=says) as refusal:
        twin.parameters(**settings)
    assert len(str(refusal.value)) < 250
