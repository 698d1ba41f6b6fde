"""JSBSim and the six-dof equations in states drawn by lot, and whether a wrong sign would be seen there."""

import re
from pathlib import Path

import pytest
from craft import COMPLETE, EDGE, HOT_AND_HIGH, PC9, STANDARD

from airrace.dynamics.inner_loop_parameters import InnerLoopParameters
from airrace.environment.atmosphere import AtmosphereParameters, density
from airrace.jsbsim.accelerations import at_geopotential_height, differences, random_states
from airrace.jsbsim.aircraft_xml import EARTH, FLAT, NAME, Planet, write_model
from airrace.jsbsim.simulation import loaded, simulate

pytest.importorskip("jsbsim")

STATES = random_states(100, seed=11)
G, RAD_S2 = 1e-3, 1e-3
EVERY = {"edge540": EDGE, "pc9": PC9, "complete": COMPLETE}
SQUARED = {"V_s"}  # its sign means nothing
COEFFICIENTS = sorted({name for name in vars(COMPLETE) if name.startswith("C_")} - {"C_Y_trim"})
SIGNED = [*COEFFICIENTS, "k", "P", "h_P", "Q_P"]
every_aircraft = pytest.mark.parametrize("aircraft", EVERY.values(), ids=EVERY.keys())
every_air = pytest.mark.parametrize("air", [STANDARD, HOT_AND_HIGH], ids=["standard", "hot and high"])


@every_aircraft
@every_air
def test_over_flat_ground_in_the_same_air_accelerations_are_the_same(
    tmp_path: Path, aircraft: InnerLoopParameters[float], air: AtmosphereParameters[float]
) -> None:
    flown = simulate(tmp_path, aircraft, air, FLAT, own_density=False)
    force, angular = differences(flown, aircraft, STATES, STATES).worst
    assert force < 1e-9
    assert angular < 1e-6  # gravity over a large sphere, through the rate of alpha


@every_aircraft
@pytest.mark.parametrize("planet", [FLAT, EARTH], ids=["flat", "WGS84"])
def test_in_the_atmosphere_and_over_the_earth_of_jsbsim_accelerations_agree(
    tmp_path: Path, aircraft: InnerLoopParameters[float], planet: Planet
) -> None:
    flown = simulate(tmp_path, aircraft, STANDARD, planet)
    ours = [at_geopotential_height(state, STANDARD) for state in STATES]
    force, angular = differences(flown, aircraft, STATES, ours).worst
    assert force < G
    assert angular < RAD_S2


@every_air
def test_the_densities_are_the_same_at_the_geopotential_height(
    tmp_path: Path, air: AtmosphereParameters[float]
) -> None:
    flown = simulate(tmp_path, EDGE, air, FLAT)
    for state in STATES:
        flown.start(state)
        lowered = at_geopotential_height(state, air)
        assert flown.density() == pytest.approx(density(lowered.z, air), rel=4e-6)
        assert flown.density() == pytest.approx(density(state.z, air), rel=1e-4)


@pytest.mark.parametrize("name", SIGNED)
def test_the_wrong_sign_of_any_coefficient_is_seen(tmp_path: Path, name: str) -> None:
    path = write_model(tmp_path, COMPLETE, FLAT)
    path.write_text(with_sign_changed(path.read_text(), name))
    flown = loaded(tmp_path, STANDARD, FLAT, own_density=False)
    force, angular = differences(flown, COMPLETE, STATES[:30], STATES[:30]).worst
    assert force > G or angular > RAD_S2


def test_the_wrong_sign_of_the_product_of_inertia_is_seen(tmp_path: Path) -> None:
    path = write_model(tmp_path, COMPLETE, FLAT)
    text = path.read_text()
    turned = text.replace('negated_crossproduct_inertia="false"', 'negated_crossproduct_inertia="true"')
    assert turned != text
    path.write_text(turned)
    flown = loaded(tmp_path, STANDARD, FLAT, own_density=False)
    assert differences(flown, COMPLETE, STATES[:30], STATES[:30]).worst[1] > RAD_S2


def test_every_number_of_the_model_has_its_sign_tested(tmp_path: Path) -> None:
    text = write_model(tmp_path, COMPLETE, FLAT).read_text()
    written = set(re.findall(rf'<property value="[^"]+">{NAME}/(\w+)</property>', text))
    moved = {"eta", "xi", "zeta", "delta_T"}
    assert written == {*SIGNED, *SQUARED, *moved}
    used = set(re.findall(rf"<property>({NAME}/\w+)</property>", text))
    assert {f"{NAME}/{one}" for one in written} <= used


def with_sign_changed(text: str, name: str) -> str:
    """The file with minus the number of that name."""
    changed, count = re.subn(
        rf'value="([^"]+)">{NAME}/{name}</property>',
        lambda found: f'value="{-float(found[1])!r}">{NAME}/{name}</property>',
        text,
    )
    assert count == 1
    return changed
