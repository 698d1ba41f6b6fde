"""What an optimum must look like, whatever its numbers: mirror images, planes, energy, laps, refined meshes."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from matched_laps import laps
from races import EDGE_540, RACES, SMALL, blown, optimum, prepared, settings
from transformations import mirrored

from airrace.model.dynamics.point_mass import PointMassState
from airrace.model.environment import g0
from airrace.optimal_control.replay import interval_durations, replay
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.guess import first_mesh
from airrace.procedure.result import StageResult, Status
from airrace.procedure.settings import GuessKind, MeshSettings, Settings
from airrace.procedure.stage_problem import gate_splits, mesh_of

every_guess = pytest.mark.parametrize("guess", GuessKind)
HALF_CUBAN = RACES["half_cuban_eight"]
MIRRORED_STATES = ("y", "q1", "q3", "n_y", "p_Kbar")


def in_mirror(flown: Trajectory) -> Array:
    """The states seen in a mirror that exchanges east and west."""
    signs = [-1.0 if quantity.name in MIRRORED_STATES else 1.0 for quantity in flown.states]
    return flown.state * np.array(signs)[:, None]


# mirror images


MIRRORED = ("four_gates", 8.0, GuessKind.HOMOTOPY)
"""What represents all of them: turns to either side in wind, from the guess that plans and solves most."""


@pytest.mark.parametrize(
    ("name", "wind", "guess"),
    [
        pytest.param(*case, marks=[] if case == MIRRORED else [pytest.mark.slow])
        for case in itertools.product(("four_gates", "half_cuban_eight"), (0.0, 8.0), GuessKind)
    ],
)
def test_mirrored_course_is_flown_in_the_mirrored_way(name: str, wind: float, guess: GuessKind) -> None:
    """The planning, the guesses and the equations know no side; measured difference: 1e-12 s and 1e-9 m."""
    race = blown(RACES[name], 250.0, wind)
    flown, image = (optimum(one, settings(guess)).trajectory for one in (race, mirrored(race)))
    assert image.race_time == pytest.approx(flown.race_time, abs=1e-5)
    reflected = PointMassState[Array].split(in_mirror(image))
    original = PointMassState[Array].split(flown.state)
    for one in ("x", "y", "z", "n_z", "p_Kbar"):
        assert np.allclose(getattr(reflected, one), getattr(original, one), atol=1e-3), one


@pytest.mark.slow
@every_guess
@pytest.mark.parametrize("name", ["rovinj_2014", "sixteen_phases"])
def test_mirrored_race_takes_the_same_time(name: str, guess: GuessKind) -> None:
    flown, image = (optimum(one, settings(guess)).trajectory for one in (RACES[name], mirrored(RACES[name])))
    assert image.race_time == pytest.approx(flown.race_time, abs=1e-5)
    assert np.allclose(image["y"], -flown["y"], atol=0.01)


# the half Cuban eight and its plane


@dataclasses.dataclass(frozen=True)
class Plane:
    """The least-squares plane `east = offset + run * north + lean * height` of a flight; `miss` is the worst, m."""

    offset: float
    run: float
    lean: float
    miss: float

    @property
    def tilt(self) -> float:
        """From the vertical, positive to the east, degrees."""
        return math.degrees(math.atan(self.lean))


def plane_of(result: StageResult, *, vertical: bool = False) -> Plane:
    flown = result.trajectory
    north, east, height = flown["x"], flown["y"], -flown["z"]
    columns = [np.ones_like(north), north] + ([] if vertical else [height])
    matrix = np.array(columns).T
    solution = np.linalg.lstsq(matrix, east, rcond=None)[0]
    offset, run, *lean = solution.tolist()
    return Plane(offset, run, lean[0] if lean else 0.0, float(np.abs(matrix @ solution - east).max()))


@every_guess
def test_half_cuban_eight_in_still_air_stays_in_a_vertical_plane(guess: GuessKind) -> None:
    result = optimum(HALF_CUBAN, settings(guess))
    assert plane_of(result, vertical=True).miss < 1.0
    assert np.abs(result.trajectory["y"]).max() < 1.0


@pytest.mark.parametrize(
    ("origin", "side", "guess"),
    [
        (90.0, 1.0, GuessKind.PLAN),
        (270.0, -1.0, GuessKind.HOMOTOPY),
        pytest.param(90.0, 1.0, GuessKind.HOMOTOPY, marks=pytest.mark.slow),
        pytest.param(270.0, -1.0, GuessKind.PLAN, marks=pytest.mark.slow),
    ],
)
def test_half_cuban_eight_tilts_into_a_crosswind(origin: float, side: float, guess: GuessKind) -> None:
    """Wind from the east tilts the plane to the east, wind from the west to the west."""
    result = optimum(blown(HALF_CUBAN, origin, 10.0), settings(guess))
    assert result.certified
    assert side * plane_of(result).tilt > 1.0


@pytest.mark.parametrize(
    ("origin", "guess"),
    [
        (0.0, GuessKind.PLAN),
        (180.0, GuessKind.HOMOTOPY),
        pytest.param(0.0, GuessKind.HOMOTOPY, marks=pytest.mark.slow),
        pytest.param(180.0, GuessKind.PLAN, marks=pytest.mark.slow),
    ],
)
def test_wind_along_the_plane_does_not_tilt_it(origin: float, guess: GuessKind) -> None:
    assert abs(plane_of(optimum(blown(HALF_CUBAN, origin, 8.0), settings(guess))).tilt) < 0.5


# energy


@every_guess
@pytest.mark.parametrize(
    "name", ["four_gates", "half_cuban_eight", pytest.param("rovinj_2014", marks=pytest.mark.slow)]
)
def test_energy_gained_is_the_work_of_thrust_less_drag(name: str, guess: GuessKind) -> None:
    """In still air `d/dt (V^2/2 + g0 h) = (T - D) V / m`; the forces are written out here once more."""
    stage_problem, result = prepared(RACES[name]), optimum(RACES[name], settings(guess))
    problem, iterate = stage_problem.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    seen = replay(problem, iterate)
    state = PointMassState[Array].split(seen.state)
    energy = state.V_K**2 / 2 - g0 * state.z
    power = excess_power(state)
    steps = interval_durations(problem, iterate.durations)
    weights = np.array([1, 4, 2, 4, 2, 4, 2, 4, 2, 4, 1]) / 30.0  # Simpson's rule on ten panels
    work = steps * (power @ weights)
    assert energy[:, -1] - energy[:, 0] == pytest.approx(work, abs=1e-3)  # of some 4000 J/kg
    assert float(energy[-1, -1] - energy[0, 0]) == pytest.approx(float(work.sum()), abs=0.05)


def excess_power(state: PointMassState[Array]) -> Array:
    """`(T - D) V / m` of the Edge 540 in the standard atmosphere, W/kg."""
    airframe, drag, propulsion, side = EDGE_540.airframe, EDGE_540.drag, EDGE_540.propulsion, EDGE_540.side_force
    temperature = 288.15 + 0.0065 * state.z
    rho = 1.225 * (temperature / 288.15) ** (g0 / (287.05287 * 0.0065) - 1.0)
    qbar_S = 0.5 * rho * state.V_K**2 * airframe.S
    C_L = airframe.m * g0 * state.n_z / qbar_S
    beta = airframe.m * g0 * state.n_y / qbar_S
    beta = beta / (side.C_Ybeta - side.C_Yzeta * EDGE_540.yaw.C_nbeta / EDGE_540.yaw.C_nzeta)
    D = qbar_S * (drag.C_D0 + drag.k * (C_L - drag.C_L_minD) ** 2 + drag.C_Dbeta2 * beta**2)
    P = propulsion.eta_p * propulsion.P_max
    V_s = P / propulsion.T_static
    T = state.delta_T * P * (1.132 * rho / 1.225 - 0.132) / np.hypot(state.V_K, V_s)
    return (T - D) * state.V_K / airframe.m


# laps


@pytest.mark.parametrize("guess", [GuessKind.PLAN, pytest.param(GuessKind.HOMOTOPY, marks=pytest.mark.slow)])
def test_two_laps_are_flown_as_one_race(guess: GuessKind) -> None:
    one, two = optimum(laps(1), settings(guess)), optimum(laps(2), settings(guess))
    assert one.certified
    assert two.certified
    assert len(two.trajectory.phases) == 4
    first_lap = two.splits[2].time
    # Whoever has a second lap to fly cannot be faster over the first than whoever has not; the weight of smooth
    # controls allows a hundredth of a second.
    assert first_lap > one.trajectory.race_time - 0.01
    # Each lap of two would do as a lap alone, as long as it begins no faster than a start may be.
    assert two.splits[2].V_K < two.splits[0].V_K
    assert two.trajectory.race_time > 2.0 * one.trajectory.race_time - 0.01
    # A joint optimum looks ahead: the first lap's gates are crossed otherwise when there is a second lap to follow.
    assert abs(two.splits[2].heading - one.splits[2].heading) > math.radians(5.0)


# refinement


def coarse(refinements: int) -> Settings:
    """A mesh far too coarse, which may be refined so many times."""
    return dataclasses.replace(
        settings(GuessKind.PLAN), mesh=MeshSettings(interval=1.0, intervals_min=2, refinements_max=refinements)
    )


def test_mesh_that_is_too_coarse_is_refined_until_the_certificate_holds() -> None:
    result = optimum(SMALL, coarse(6))
    before = [len(fractions) for fractions in first_mesh(prepared(SMALL).plan, coarse(6).mesh)]
    after = [len(fractions) for fractions in mesh_of(result.trajectory)]
    assert result.certified
    assert all(new >= old for new, old in zip(after, before, strict=True))
    assert sum(after) > sum(before)
    assert any("refinement" in attempt.purpose for attempt in result.attempts)
    # Not all intervals were halved: the mesh is finer where it had to be.
    assert any(len(set(np.round(fractions, 9))) > 1 for fractions in mesh_of(result.trajectory))
    usual = optimum(SMALL, settings(GuessKind.PLAN)).trajectory.race_time
    assert result.trajectory.race_time == pytest.approx(usual, abs=0.01)
    # Mesh and unknowns of a flight are a round trip.
    problem, iterate = prepared(SMALL).problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    assert interval_durations(problem, iterate.durations) == pytest.approx(np.diff(result.trajectory.time), rel=1e-12)
    assert gate_splits(prepared(SMALL), result.trajectory) == result.splits


def test_mesh_that_may_not_be_refined_is_not_certified_and_says_why() -> None:
    result = optimum(SMALL, coarse(0))
    assert result.outcome is Status.NOT_CERTIFIED
    assert not result.certified
    assert result.certificate is not None
    failed = {item.name for item in result.certificate.failed}
    assert "replay_defect" in failed
    assert all(name in result.message for name in failed)
