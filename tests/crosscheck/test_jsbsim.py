"""The six-dof aircraft against JSBSim."""

import dataclasses
import math
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from jsbsim_aircraft.aircraft_xml import EARTH, FLAT, NAME, Planet, write_model
from jsbsim_aircraft.simulation import (
    STILL,
    SimulatedAircraft,
    at_geopotential_height,
    differences,
    fly_course,
    mirror,
    own_accelerations,
    random_states,
    simulate,
)
from scipy.integrate import solve_ivp

from airrace.files.inputs import load_inputs
from airrace.model.aircraft import InnerLoopParameters, inner_loop_parameters
from airrace.model.dynamics.limits import SurfaceControl
from airrace.model.dynamics.six_dof import SixDofState, six_dof
from airrace.model.environment import Air, AtmosphereParameters, Weather, atmosphere_parameters, density
from airrace.model.frames import quaternion
from airrace.optimal_control.trajectory import Array, Trajectory

ROOT = Path(__file__).parents[2]
STANDARD = atmosphere_parameters(Air())
HOT_AND_HIGH = atmosphere_parameters(Air(temperature_offset=18.0, pressure_offset=-900.0, elevation=420.0))


def shipped(name: str) -> InnerLoopParameters[float]:
    track = ROOT / "tracks/half_cuban_eight.yaml"
    return inner_loop_parameters(load_inputs(track, aircraft=ROOT / "configs" / f"{name}.yaml").race.aircraft)


EDGE, PC9 = shipped("edge540"), shipped("pc9")


def complete() -> InnerLoopParameters[float]:
    """The PC-9 with a propeller that turns it, and something in place of every coefficient that is zero."""
    zeros = {name: 0.04 for name, value in vars(PC9).items() if value == 0.0}
    return dataclasses.replace(PC9, **zeros | {"h_P": 1500.0, "Q_P": 700.0})


COMPLETE = complete()


pytest.importorskip("jsbsim")

STATES = random_states(30, seed=7)
POLAR, AXIAL = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])
VACUUM = AtmosphereParameters(T_0=288.15, p_0=1e-9, elevation=0.0)


@pytest.mark.parametrize("aircraft", [EDGE, PC9], ids=["edge540", "pc9"])
def test_a_mirrored_aircraft_is_accelerated_in_the_mirror(tmp_path: Path, aircraft: InnerLoopParameters[float]) -> None:
    flown = simulate(tmp_path, aircraft, STANDARD, FLAT)
    for state in STATES:
        flown.start(state)
        seen = flown.accelerations()
        flown.start(mirror(state))
        reflected = flown.accelerations()
        assert reflected.specific_force == pytest.approx(POLAR * seen.specific_force, rel=1e-9, abs=1e-9)
        assert reflected.angular == pytest.approx(AXIAL * seen.angular, rel=1e-9, abs=1e-7)


def test_without_lift_sideslip_and_thrust_there_is_nothing_but_drag(tmp_path: Path) -> None:
    flown = simulate(tmp_path, EDGE, STANDARD, FLAT)
    still = dict.fromkeys(("alpha_K", "beta_K", "p_K", "q_K", "r_K", "eta", "xi", "zeta", "delta_T", "z"), 0.0)
    for state in STATES:
        flown.start(dataclasses.replace(state, **still))
        drag = 0.5 * flown.density() * state.V_K**2 * EDGE.S * EDGE.C_D0 / EDGE.m
        assert flown.accelerations().specific_force == pytest.approx([-drag, 0.0, 0.0], rel=1e-9, abs=1e-9)


def test_in_a_vacuum_the_body_keeps_its_energy_and_its_angular_momentum(tmp_path: Path) -> None:
    flown = simulate(tmp_path, PC9, VACUUM, FLAT, own_density=False)
    inertia = np.diag([PC9.I_x, PC9.I_y, PC9.I_z])
    inertia[0, 2] = inertia[2, 0] = -PC9.I_xz
    for state in STATES:
        flown.start(dataclasses.replace(state, delta_T=0.0))
        omega = np.array([state.p_K, state.q_K, state.r_K])
        turning, momentum = inertia @ flown.accelerations().angular, inertia @ omega
        assert turning + np.cross(omega, momentum) == pytest.approx(np.zeros(3), abs=1e-6)
        assert omega @ turning == pytest.approx(0.0, abs=1e-5)


def test_lift_ends_at_the_stall(tmp_path: Path) -> None:
    flown = simulate(tmp_path, EDGE, STANDARD, FLAT)
    at_rest = dict.fromkeys(("beta_K", "p_K", "q_K", "r_K", "eta", "xi", "zeta", "delta_T", "z"), 0.0)
    for alpha in (-1.0, 1.0):
        state = dataclasses.replace(STATES[0], alpha_K=alpha, **at_rest)
        flown.start(state)
        x, _, z = flown.accelerations().specific_force
        lift = EDGE.m * (x * math.sin(alpha) - z * math.cos(alpha))
        C_L = lift / (0.5 * flown.density() * state.V_K**2 * EDGE.S)
        assert pytest.approx(math.copysign(EDGE.C_L_max, alpha), abs=1e-3) == C_L


@pytest.mark.parametrize("climb", [math.pi / 2, -math.pi / 2], ids=["up", "down"])
def test_the_vertical_is_an_attitude_like_any_other(tmp_path: Path, climb: float) -> None:
    flown = simulate(tmp_path, PC9, STANDARD, FLAT, own_density=False)
    q = (math.cos(climb / 2), 0.0, math.sin(climb / 2), 0.0)
    state = dataclasses.replace(
        STATES[0], alpha_K=0.0, beta_K=0.0, **dict(zip(("q0", "q1", "q2", "q3"), q, strict=True))
    )
    flown.start(state)
    ours = own_accelerations(state, PC9, STANDARD)
    assert flown.attitude()[:, 0] == pytest.approx([0.0, 0.0, -math.copysign(1.0, climb)], abs=1e-7)
    assert flown.accelerations().angular == pytest.approx(ours.angular, abs=1e-6)


ACCELERATED_STATES = random_states(100, seed=11)
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
    force, angular = differences(flown, aircraft, ACCELERATED_STATES, ACCELERATED_STATES).worst
    assert force < 1e-9
    assert angular < 1e-6  # gravity over a large sphere, through the rate of alpha


@every_aircraft
@pytest.mark.parametrize("planet", [FLAT, EARTH], ids=["flat", "WGS84"])
def test_in_the_atmosphere_and_over_the_earth_of_jsbsim_accelerations_agree(
    tmp_path: Path, aircraft: InnerLoopParameters[float], planet: Planet
) -> None:
    flown = simulate(tmp_path, aircraft, STANDARD, planet)
    ours = [at_geopotential_height(state, STANDARD) for state in ACCELERATED_STATES]
    force, angular = differences(flown, aircraft, ACCELERATED_STATES, ours).worst
    assert force < G
    assert angular < RAD_S2


@every_air
def test_the_densities_are_the_same_at_the_geopotential_height(
    tmp_path: Path, air: AtmosphereParameters[float]
) -> None:
    flown = simulate(tmp_path, EDGE, air, FLAT)
    for state in ACCELERATED_STATES:
        flown.start(state)
        lowered = at_geopotential_height(state, air)
        assert flown.density() == pytest.approx(density(lowered.z, air), rel=4e-6)
        assert flown.density() == pytest.approx(density(state.z, air), rel=1e-4)


@pytest.mark.parametrize("name", SIGNED)
def test_the_wrong_sign_of_any_coefficient_is_seen(tmp_path: Path, name: str) -> None:
    path = write_model(tmp_path, COMPLETE, FLAT)
    path.write_text(with_sign_changed(path.read_text(), name))
    flown = SimulatedAircraft(tmp_path, STANDARD, FLAT, own_density=False)
    force, angular = differences(flown, COMPLETE, ACCELERATED_STATES[:30], ACCELERATED_STATES[:30]).worst
    assert force > G or angular > RAD_S2


def test_the_wrong_sign_of_the_product_of_inertia_is_seen(tmp_path: Path) -> None:
    path = write_model(tmp_path, COMPLETE, FLAT)
    text = path.read_text()
    turned = text.replace('negated_crossproduct_inertia="false"', 'negated_crossproduct_inertia="true"')
    assert turned != text
    path.write_text(turned)
    flown = SimulatedAircraft(tmp_path, STANDARD, FLAT, own_density=False)
    assert differences(flown, COMPLETE, ACCELERATED_STATES[:30], ACCELERATED_STATES[:30]).worst[1] > RAD_S2


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


STEP, INTERVALS = 0.1, 25  # the last piece lasts half a second
q0, q1, q2, q3 = quaternion(0.7, 0.3, -0.4)
START = SixDofState[float](
    x=40.0,
    y=-70.0,
    z=-300.0,
    V_K=95.0,
    q0=q0,
    q1=q1,
    q2=q2,
    q3=q3,
    delta_T=0.3,
    alpha_K=0.05,
    beta_K=0.02,
    p_K=0.1,
    q_K=0.2,
    r_K=0.0,
    eta=-0.03,
    xi=0.0,
    zeta=0.0,
)
States = Callable[[Array], Mapping[str, Array]]


def flight(aircraft: InnerLoopParameters[float], air: AtmosphereParameters[float]) -> tuple[Trajectory, States]:
    """A pull-up, a roll and a kick of the rudder, integrated interval by interval; the lever follows its command."""
    phase = np.arange(INTERVALS)
    rates = [-0.4 * np.cos(0.5 * phase), -0.9 * np.cos(0.3 * phase), 0.5 * np.cos(1.3 * phase + 1.0)]
    control = np.array([*rates, 0.5 + 0.5 * np.sign(np.sin(0.5 * phase))])
    state, pieces = [np.array(START.join())], []
    for u in control.T:

        def slopes(_: float, x: Array, u: Array = u) -> Array:
            still = {"aircraft": aircraft, "weather": Weather(air, STILL)}
            return np.array(six_dof(SixDofState[float].split(x), SurfaceControl[float].split(u), **still)[0].join())

        solved = solve_ivp(slopes, (0.0, STEP), state[-1], rtol=1e-9, atol=1e-9, dense_output=True)
        pieces.append(solved.sol)
        state.append(solved.y[:, -1])

    def at(times: Array) -> Mapping[str, Array]:
        interval = np.minimum((times / STEP + 1e-9).astype(int), INTERVALS - 1)
        columns = [pieces[i](time - i * STEP) for time, i in zip(times, interval, strict=True)]
        return dict(zip(SixDofState.names(), np.array(columns).T, strict=True))

    flown = Trajectory(
        phases=("all",),
        first_node=np.array([0, INTERVALS]),
        durations=np.array([STEP * INTERVALS]),
        time=STEP * np.arange(INTERVALS + 1.0),
        states=SixDofState.quantities(),
        state=np.array(state).T,
        controls=SurfaceControl.quantities(),
        control=control,
    )
    return flown, at


@pytest.mark.parametrize("planet", [FLAT, EARTH], ids=["flat", "WGS84"])
@pytest.mark.parametrize("aircraft", [PC9, COMPLETE], ids=["pc9", "complete"])
def test_jsbsim_stays_with_the_flight_for_a_second(
    tmp_path: Path, aircraft: InnerLoopParameters[float], planet: Planet
) -> None:
    trajectory, at = flight(aircraft, HOT_AND_HIGH)
    flown = simulate(tmp_path, aircraft, HOT_AND_HIGH, planet)
    misses = fly_course(flown, trajectory, at, aircraft.tau_T)
    assert [miss.start for miss in misses] == pytest.approx([0.0, 1.0, 2.0])
    assert [miss.end for miss in misses] == pytest.approx([1.0, 2.0, 2.5])
    assert max(miss.distance for miss in misses) < 0.1
    assert max(miss.angle for miss in misses) < math.radians(0.2)


@pytest.mark.parametrize("name", ["C_lxi", "C_meta", "C_nzeta"])
def test_an_aircraft_that_answers_its_controls_more_weakly_leaves_the_flight(tmp_path: Path, name: str) -> None:
    trajectory, at = flight(PC9, STANDARD)
    weaker = dataclasses.replace(PC9, **{name: 0.8 * getattr(PC9, name)})
    misses = fly_course(simulate(tmp_path, weaker, STANDARD, FLAT), trajectory, at, PC9.tau_T)
    assert max(miss.angle for miss in misses) > math.radians(0.2)


def test_a_lever_that_does_not_lag_leaves_the_flight(tmp_path: Path) -> None:
    trajectory, at = flight(PC9, STANDARD)
    flown = simulate(tmp_path, PC9, STANDARD, FLAT)
    assert max(miss.distance for miss in fly_course(flown, trajectory, at, tau_T=1e-3)) > 0.1


@pytest.mark.slow
def test_the_optimum_of_half_a_cuban_eight_is_flown_by_jsbsim(tmp_path: Path) -> None:
    run = tmp_path / "run.h5"
    optimize = [sys.executable, "-m", "airrace", "optimize"]
    track = str(ROOT / "tracks/half_cuban_eight.yaml")
    subprocess.run([*optimize, track, "--threads", "1", "--quiet", "--output", str(run)], check=True)
    script = [sys.executable, str(ROOT / "scripts/crosscheck.py"), str(run)]
    answer = subprocess.run(script, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stdout + answer.stderr
