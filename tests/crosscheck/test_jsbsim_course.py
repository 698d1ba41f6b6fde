"""A flight of the six-dof model, flown again by JSBSim from every full second."""

import dataclasses
import math
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from craft import COMPLETE, HOT_AND_HIGH, PC9, ROOT, STANDARD
from scipy.integrate import solve_ivp

from airrace.dynamics.inner_loop_controls import SurfaceControl
from airrace.dynamics.inner_loop_parameters import InnerLoopParameters
from airrace.dynamics.six_dof import SixDofState, six_dof
from airrace.environment.atmosphere import AtmosphereParameters
from airrace.environment.weather import Weather
from airrace.frames import quaternion
from airrace.jsbsim.accelerations import STILL
from airrace.jsbsim.aircraft_xml import EARTH, FLAT, Planet
from airrace.jsbsim.simulation import fly_course, simulate
from airrace.trajectory import Array, Trajectory

pytest.importorskip("jsbsim")

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
