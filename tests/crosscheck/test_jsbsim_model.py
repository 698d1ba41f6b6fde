"""What physics says of the aircraft as JSBSim flies it, whatever our own equations say."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from craft import EDGE, PC9, STANDARD

from airrace.dynamics.inner_loop_parameters import InnerLoopParameters
from airrace.environment.atmosphere import AtmosphereParameters
from airrace.jsbsim.accelerations import mirror, own_accelerations, random_states
from airrace.jsbsim.aircraft_xml import FLAT
from airrace.jsbsim.simulation import simulate

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
