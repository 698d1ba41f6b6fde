"""Aircraft that are read from JSBSim's XML, held against JSBSim itself."""

import dataclasses
import functools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import run as airrace
from jsbsim_aircraft.aircraft_xml import DENSITY, INERTIA, POUND, POUND_FORCE, TORQUE

from airrace.files.inputs.document import AIRCRAFT
from airrace.files.inputs.jsbsim.aerodynamics import C_D, C_L, FlowState
from airrace.files.inputs.jsbsim.aircraft import C_L_CRUISE, JsbsimAircraft, read_jsbsim_aircraft
from airrace.files.inputs.jsbsim.airframe import read_airframe
from airrace.files.inputs.jsbsim.document import read_jsbsim
from airrace.model.aircraft import inner_loop_parameters
from airrace.model.dynamics.aerodynamics import drag_coefficient, lift_curve, thrust
from airrace.model.environment import RHO_ISA, g0
from airrace.optimal_control.quantities import FOOT
from airrace.optimal_control.trajectory import Array
from airrace.runs.aircraft_file import read_aircraft_file

jsbsim = pytest.importorskip("jsbsim")
FOLDER = Path(jsbsim.__file__).parent / "aircraft"
ZLIN = read_aircraft_file(AIRCRAFT.path / "zlin50.yaml").aircraft


def file_of(name: str) -> Path:
    return FOLDER / name / f"{name}.xml"


@functools.cache
def read(name: str) -> JsbsimAircraft:
    return read_jsbsim_aircraft(file_of(name), ZLIN)


def started(name: str, random: np.random.Generator) -> Any:
    """JSBSim in a state that is drawn by lot, with its controls deflected."""
    model = jsbsim.FGFDMExec(None)
    model.set_debug_level(0)
    model.load_model(name)
    model["ic/h-sl-ft"] = 5000.0
    model["ic/vt-fps"] = random.uniform(150.0, 330.0)
    model["ic/alpha-deg"], model["ic/beta-deg"] = random.uniform(-8.0, 14.0), random.uniform(-8.0, 8.0)
    for rate in "pqr":
        model[f"ic/{rate}-rad_sec"] = random.uniform(-1.0, 1.0)
    for surface in ("elevator", "aileron", "rudder"):
        model[f"fcs/{surface}-cmd-norm"] = random.uniform(-1.0, 1.0)
    model.run_ic()
    return model


def its_coefficients(model: Any) -> Array:
    load = model["aero/qbar-psf"] * model["metrics/Sw-sqft"]
    b, cbar = model["metrics/bw-ft"], model["metrics/cbarw-ft"]
    forces = [model[f"forces/fw{axis}-aero-lbs"] for axis in "zxy"]
    moments = [model[f"moments/{axis}-aero-lbsft"] / length for axis, length in (("l", b), ("m", cbar), ("n", b))]
    return np.array(forces + moments) / load


def properties(model: Any) -> dict[str, float]:
    """Every property that has a value."""
    catalog = model.query_property_catalog("")
    names = (line.split(" ")[0] for line in (catalog.split("\n") if isinstance(catalog, str) else catalog))
    values: dict[str, float] = {}
    for name in filter(None, names):
        # those of the functions themselves are to be computed
        if not name.startswith(("aero/coefficient", "aero/function")):
            values[name] = model[name]
    return values


@pytest.mark.parametrize("name", ["c172p", "c182", "p51d", "f16"])
def test_functions_have_jsbsims_values_where_properties_have(name: str) -> None:
    aerodynamics, random = read(name).aerodynamics, np.random.default_rng(7)
    for _ in range(5):
        model = started(name, random)
        state = FlowState(model["velocities/vt-fps"] * FOOT, model["aero/alpha-rad"], model["aero/beta-rad"])
        values = aerodynamics.coefficients(state, properties(model))
        assert values == pytest.approx(its_coefficients(model), abs=1e-12)


@pytest.mark.parametrize("name", ["c172p", "c182"])
def test_a_state_of_the_flow_has_jsbsims_coefficients(name: str) -> None:
    aerodynamics, random = read(name).aerodynamics, np.random.default_rng(8)
    for _ in range(5):
        model = started(name, random)
        per_span, per_chord = model["aero/bi2vel"], model["aero/ci2vel"]
        state = FlowState(
            V=model["velocities/vt-fps"] * FOOT,
            alpha=model["aero/alpha-rad"],
            beta=model["aero/beta-rad"],
            p=model["velocities/p-aero-rad_sec"] * per_span,
            q=model["velocities/q-aero-rad_sec"] * per_chord,
            r=model["velocities/r-aero-rad_sec"] * per_span,
            alphadot=model["aero/alphadot-rad_sec"] * per_chord,
            eta=model["fcs/elevator-pos-rad"],
            xi=model["fcs/left-aileron-pos-rad"],
            zeta=model["fcs/rudder-pos-rad"],
        )
        assert aerodynamics.coefficients(state) == pytest.approx(its_coefficients(model), abs=1e-9)


@pytest.mark.parametrize("name", ["c172p", "c310", "f16", "737", "A320"])
def test_mass_and_moments_of_inertia_are_jsbsims(name: str) -> None:
    airframe, model = read_airframe(read_jsbsim(file_of(name)))[0], started(name, np.random.default_rng(1))
    assert airframe.m / POUND == pytest.approx(model["inertia/weight-lbs"], rel=1e-6)
    for number, key, sign in (("I_x", "ixx", 1.0), ("I_y", "iyy", 1.0), ("I_z", "izz", 1.0), ("I_xz", "ixz", -1.0)):
        value = sign * model[f"inertia/{key}-slugs_ft2"]
        assert getattr(airframe, number) / INERTIA == pytest.approx(value, rel=1e-5, abs=1e-3)


WITHIN = [("c172p", 0.03, 0.001), ("c182", 0.07, 0.002), ("p51d", 0.13, 0.01)]


@pytest.mark.parametrize(("name", "lift", "drag"), WITHIN)
def test_tables_of_the_aircraft_follow_jsbsims_functions(name: str, lift: float, drag: float) -> None:
    """But for the corners of JSBSim's tables, which smooth splines round off."""
    aircraft, aerodynamics = read(name).aircraft, read(name).aerodynamics
    numbers, random = inner_loop_parameters(aircraft), np.random.default_rng(9)
    assert aircraft.tables is not None
    assert aircraft.tables.lift is not None
    knots = aircraft.tables.lift.knots[0]
    V = math.sqrt(2.0 * numbers.m * g0 / (RHO_ISA * numbers.S * C_L_CRUISE))
    misses: list[float] = []
    for alpha in random.uniform(knots[0], knots[-1], 60).tolist():
        at = aerodynamics.coefficients(FlowState(V, alpha))
        misses.append(abs(lift_curve(alpha, numbers) - at[C_L]))
        if alpha < math.radians(8.0) and 0.0 < at[C_L] < 0.9 * aircraft.lift.C_L_max:
            assert drag_coefficient(at[C_L], 0.0, V, RHO_ISA, numbers) == pytest.approx(at[C_D], abs=drag)
    assert max(misses) < lift
    assert np.median(misses) < 0.01


def test_derivatives_are_those_that_the_file_of_the_cessna_states() -> None:
    """Where the reference point is the centre of mass, that is: for rates, sideslip and controls but C_m and C_n."""
    aircraft = read("c172p").aircraft
    assert aircraft.roll.C_lxi == pytest.approx(-0.229)
    assert aircraft.lift.C_Lq == pytest.approx(3.9)
    assert aircraft.lift.C_Leta == pytest.approx(0.43)
    assert aircraft.side_force.C_Yzeta == pytest.approx(0.187)
    assert math.degrees(aircraft.surfaces.eta.upper) == pytest.approx(23.0, rel=1e-3)


@pytest.mark.parametrize("name", ["c172p", "c182"])
def test_the_propeller_turns_and_pulls_as_jsbsims_at_the_same_power(name: str) -> None:
    engine = read(name).engines[0]
    model = jsbsim.FGFDMExec(None)
    model.set_debug_level(0)
    model.load_model(name)
    model["ic/h-sl-ft"], model["ic/vt-fps"], model["ic/alpha-deg"] = 3000.0, 170.0, 2.0
    for command in ("throttle", "mixture", "advance"):
        model[f"fcs/{command}-cmd-norm"] = 1.0
    model["propulsion/magneto_cmd"] = 3
    model.run_ic()
    model.get_propulsion().init_running(-1)
    for _ in range(1200):
        model.run()
    V, rho = model["velocities/u-aero-fps"] * FOOT, model["atmosphere/rho-slugs_ft3"] * DENSITY
    power = model["propulsion/engine/power-hp"] * 550.0 * TORQUE
    steady = dataclasses.replace(engine, P_max=power, piston=False)
    assert steady.thrust(V, rho) == pytest.approx(model["propulsion/engine/thrust-lbs"] * POUND_FORCE, rel=0.01)


def test_the_command_writes_an_aircraft_that_flies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ran = airrace("aircraft", file_of("c172p"), "--from", "zlin50")
    assert (ran.code, ran.err) == (0, "")
    assert "- lift due to the rate of the angle of attack, 1.7 per rad: airrace has none" in ran.out
    text = Path("c172p.yaml").read_text(encoding="utf-8")
    assert "# Not taken over: limits of speed and load factor" in text
    written, aircraft = read_aircraft_file("c172p.yaml").aircraft, read("c172p").aircraft
    for group in ("airframe", "lift", "drag", "side_force", "roll", "pitch", "yaw", "propulsion", "point_mass"):
        values = vars(getattr(aircraft, group))
        assert vars(getattr(written, group)) == pytest.approx(values, rel=1e-5, abs=1e-12)
    before, after = (inner_loop_parameters(numbers) for numbers in (aircraft, written))
    assert lift_curve(0.1, after) == pytest.approx(lift_curve(0.1, before), rel=1e-6)
    assert thrust(1.0, 50.0, 1.2, after) == pytest.approx(thrust(1.0, 50.0, 1.2, before), rel=1e-6)
    Path("course.yaml").write_text(COURSE)
    along_the_plan = ("--guess", "plan", "--search", "off")
    flown = airrace("optimize", "course.yaml", "--aircraft", "c172p.yaml", *along_the_plan, "--json")
    assert flown.code == 0
    assert flown.answer["certified"]
    assert flown.stages[-1] == "six-dof"
    assert airrace("aircraft", "renamed", "--from", "c172p.yaml", "--n-z", "4g").code == 0
    assert "tables:" in Path("renamed.yaml").read_text(encoding="utf-8")


COURSE = """
schema: airrace/track/2
name: two gates
rules: {floor_m: 5, pilot: none, start_speed_max_kt: 120, n_z_max: 4}
gate_defaults: {height_m: 20, height_min_m: 15, height_max_m: 25, climb_min_deg: -10, climb_max_deg: 10}
gates:
  first: {type: level, north_m: 0, east_m: 0, heading_deg: 20}
  last: {type: level, north_m: 420, east_m: 260, heading_deg: 70}
course: {start: first, lap: [last]}
"""


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ([file_of("c172p")], 2, "JSBSim has no limits of load factor and speed"),
        ([file_of("c172p"), "--from", "zlin50", "--stall", "40kt"], 2, "use --stall with --from the file it makes"),
        (["none.xml", "--from", "zlin50"], 3, "none.xml: cannot be read"),
        ([file_of("c172x"), "--from", "zlin50"], 2, "no aircraft that flies: roll.C_lxi"),
        ([file_of("ball"), "--from", "zlin50"], 3, "has no lift that grows with the angle of attack"),
    ],
)
def test_what_is_no_aircraft_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str | Path], code: int, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = airrace("aircraft", *words)
    assert ran.code == code
    assert message in " ".join(ran.err.split())
    assert list(tmp_path.iterdir()) == []
