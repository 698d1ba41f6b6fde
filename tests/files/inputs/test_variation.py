"""Inputs varied number by number are what `--set` makes of them."""

from pathlib import Path

import pytest

from airrace.errors import InputError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.variation import Variation

ROOT = Path(__file__).parents[3]
TRACKS = sorted((ROOT / "tracks").glob("*.yaml"))


@pytest.mark.parametrize("track", TRACKS, ids=lambda path: path.stem)
def test_every_number_set_to_its_own_value_leaves_the_race_as_it_is(track: Path) -> None:
    inputs = load_inputs(track)
    variation = Variation(inputs)
    assert len(variation.parameters) > 50
    assert [key for key, one in variation.parameters.items() if one.set(inputs.race, one.value) != inputs.race] == []


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("gate_defaults.climb_max_deg", 12.5),
        ("gates.g4.height_min_m", 16.25),
        ("gates.g1.pass_side_deg", 111.0),
        ("rules.floor_m", 11.0),
        ("environment.temperature_offset_K", 3.5),
        ("aircraft.airframe.mass_kg", 701.0),
        ("aircraft.envelope.n_z_max", 9.5),
    ],
)
def test_a_varied_race_is_the_race_that_set_gives(key: str, value: float) -> None:
    track, earlier = ROOT / "tracks" / "rovinj_2014.yaml", ("rules.n_z_max=9", "aircraft.airframe.mass_kg=690")
    variation = Variation(load_inputs(track, overrides=earlier))
    assert variation.race(key, value) == load_inputs(track, overrides=(*earlier, f"{key}={value}")).race


@pytest.mark.parametrize("key", ["rules.floor_m", "gates.g0.width_m", "aircraft.airframe.mass_kg"])
def test_values_that_set_would_refuse_are_refused(key: str) -> None:
    variation = Variation(load_inputs(ROOT / "tracks" / "rovinj_2014.yaml"))
    with pytest.raises(InputError):
        variation.race(key, -1.0)
