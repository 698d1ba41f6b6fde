"""Tables of lift, drag and thrust in aircraft files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from airrace.errors import InputError
from airrace.files.inputs import load_inputs
from airrace.files.inputs.objects import resolved_inputs
from airrace.model.aircraft import Aircraft, aircraft_parameters, inner_loop_parameters
from airrace.model.dynamics.aerodynamics import VISCOSITY, drag_coefficient, lift_curve, thrust
from airrace.procedure.fidelity import stage_model
from airrace.procedure.stage import Stage
from airrace.race import Race

ROOT = Path(__file__).parents[3]
TRACK = ROOT / "tracks" / "half_cuban_eight.yaml"
TABLES: dict[str, Any] = {  # Any: YAML
    "lift": {"alpha_deg": [-15.0, 0.0, 15.0], "C_L": [-1.1, 0.1, 1.2]},
    "drag": {"C_L": [-1.0, 0.0, 1.0], "Re": [3e6, 9e6], "C_D": [[0.1, 0.09], [0.03, 0.02], [0.1, 0.09]]},
    "thrust": {
        "speed_m_s": [0.0, 50.0, 100.0],
        "density_kg_m3": [1.0, 1.2],
        "thrust_N": [[5000, 6000], [3000, 3500], [1500, 1800]],
    },
}


def race(folder: Path, tables: dict[str, Any] | None) -> Race:
    content = yaml.safe_load((ROOT / "configs" / "edge540.yaml").read_text(encoding="utf-8"))
    if tables is not None:
        content["tables"] = tables
    file = folder / "tables.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return load_inputs(TRACK, aircraft=file).race


def aircraft(folder: Path, tables: dict[str, Any] | None) -> Aircraft:
    return race(folder, tables).aircraft


def test_tables_take_the_place_of_the_formulas(tmp_path: Path) -> None:
    tables = {**TABLES, "thrust": {**TABLES["thrust"], "thrust_N": [[5e3, 6e3], [3e3, 3.5e3], [1.5e3, 1.8e3]]}}
    flown = aircraft(tmp_path, tables)
    numbers = aircraft_parameters(flown)
    V = 9e6 * VISCOSITY / (1.2 * flown.airframe.cbar)  # of the Reynolds number 9e6
    assert float(drag_coefficient(1.0, 0.0, V, 1.2, numbers)) == pytest.approx(0.09)
    slower = float(drag_coefficient(0.0, 0.1, V / 3.0, 1.2, numbers))
    assert slower == pytest.approx(0.03 + 0.01 * numbers.C_Dbeta2)
    assert float(thrust(0.5, 50.0, 1.2, numbers)) == pytest.approx(1750.0)
    assert float(lift_curve(np.radians(15.0), inner_loop_parameters(flown))) == pytest.approx(1.2)


def test_configurations_of_aircraft_without_tables_are_those_of_before_there_were_any(tmp_path: Path) -> None:
    settings = load_inputs(TRACK).settings
    without, with_tables = (resolved_inputs(race(tmp_path, tables), settings)["aircraft"] for tables in (None, TABLES))
    assert isinstance(without, dict)
    assert "tables" not in without
    assert isinstance(with_tables, dict)
    assert "lift" in str(with_tables["tables"])


def test_table_of_one_kind_leaves_the_other_formulas(tmp_path: Path) -> None:
    with_one = aircraft_parameters(aircraft(tmp_path, {"drag": TABLES["drag"]}))
    without = aircraft_parameters(aircraft(tmp_path, None))
    assert thrust(0.7, 80.0, 1.1, with_one) == thrust(0.7, 80.0, 1.1, without)
    assert drag_coefficient(0.0, 0.0, 80.0, 1.1, with_one) != drag_coefficient(0.0, 0.0, 80.0, 1.1, without)


@pytest.mark.parametrize(
    "stage", [Stage.POINT_MASS, Stage.TRANSFER_FUNCTION, Stage.STATE_SPACE, Stage.SIX_DOF], ids=str
)
def test_every_stage_flies_by_the_tables_of_its_own_aircraft(tmp_path: Path, stage: Stage) -> None:
    drag = TABLES["drag"]
    less = {"drag": {**drag, "C_D": [[value - 0.01 for value in row] for row in drag["C_D"]]}}
    slowing: list[float] = []
    for tables in ({"drag": drag}, less):
        model = stage_model(stage, race(tmp_path, tables))
        states = [quantity.name for quantity in model.system.states]
        x = np.zeros(len(states))
        x[states.index("q0")], x[states.index("V_K")], x[states.index("z")] = 1.0, 90.0, -50.0
        rates = model.system.rates(x, np.zeros(len(model.system.controls)), model.parameter_values)
        slowing.append(float(np.asarray(rates).ravel()[states.index("V_K")]))
    numbers = aircraft_parameters(race(tmp_path, None).aircraft)
    pressure = 0.5 * 1.219 * 90.0**2
    assert slowing[1] - slowing[0] == pytest.approx(0.01 * pressure * numbers.S / numbers.m, rel=0.01)


@pytest.mark.parametrize(
    ("group", "key", "value", "words"),
    [
        ("lift", "alpha_deg", [0.0, -15.0, 15.0], "tables.lift.alpha_deg: must increase"),
        ("lift", "C_L", [0.1, 1.2], "tables.lift.C_L: must have 3 values or rows, as alpha_deg has; has 2"),
        ("drag", "C_D", [[0.1, 0.09], [0.03], [0.1, 0.09]], "tables.drag.C_D: must have 2 numbers in every row"),
        ("drag", "Re", [9e6, 9e6], "tables.drag.Re: must increase"),
        ("drag", "C_L", ["a", 0.0, 1.0], "tables.drag.C_L"),
    ],
)
def test_table_that_is_none_is_refused_by_its_key(
    tmp_path: Path, group: str, key: str, value: list[Any], words: str
) -> None:
    with pytest.raises(InputError) as refused:
        aircraft(tmp_path, {group: {**TABLES[group], key: value}})
    assert words in str(refused.value)
