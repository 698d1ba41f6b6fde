"""What it costs that controls are held."""

import numpy as np
import pytest
from races import PLAN, SMALL, prepared, solve_stages
from test_meshing import SYSTEM

from airrace.optimal_control.problem import Boundary, Iterate, Objective, Phase, Problem, uniform
from airrace.optimal_control.refinement import restrict
from airrace.optimal_control.solvers.process.service import SolverService
from airrace.procedure.models import iterate_of
from airrace.procedure.progress import Silent
from airrace.procedure.refinement import measure_hold_cost, predict_hold_cost
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import mesh_of
from airrace.procedure.start import InitialBarrier
from airrace.quantities import Interval

WEIGHT = 0.25


def held(*controls: float, seconds: float = 2.0) -> tuple[Problem, Iterate]:
    phase = Phase("all", uniform(len(controls)), Interval(0.1, 9.0))
    problem = Problem(SYSTEM, (), Boundary(), (phase,), objective=Objective(regularisation={"f": WEIGHT}))
    return problem, Iterate(np.array([seconds]), np.zeros((2, len(controls) + 1)), np.array([controls]))


def test_constant_controls_cost_nothing() -> None:
    problem, iterate = held(3.0, 3.0, 3.0, 3.0)
    assert (predict_hold_cost(problem, iterate) == 0.0).all()
    assert (measure_hold_cost(problem, iterate, np.array([True, False, True, False, True])) == 0.0).all()


def test_price_is_the_regularised_variance_within_the_coarser_interval() -> None:
    problem, iterate = held(1.0, 5.0, 2.0, 2.0)
    price = measure_hold_cost(problem, iterate, np.array([True, False, True, False, True]))
    assert price == pytest.approx([1.0 * WEIGHT * 2.0**2, 0.0])


def test_controls_that_vary_evenly_are_foreseen_as_they_will_be_measured() -> None:
    """Where the finer mesh has the same slope: halves differ by half of what neighbours do."""
    coarse, fine = held(0.0, 1.0, 2.0, 3.0), held(*(0.5 * np.arange(8) - 0.25))
    kept = np.arange(9) % 2 == 0
    assert predict_hold_cost(*coarse) == pytest.approx(measure_hold_cost(*fine, kept))


def test_price_grows_with_time_weight_and_jump_squared() -> None:
    usual, longer, higher = held(0.0, 1.0), held(0.0, 1.0, seconds=4.0), held(0.0, 3.0)
    assert predict_hold_cost(*longer) == pytest.approx(2.0 * predict_hold_cost(*usual))
    assert predict_hold_cost(*higher) == pytest.approx(9.0 * predict_hold_cost(*usual))


def test_price_is_of_the_size_of_what_a_finer_mesh_gains() -> None:
    result, flight = solve_stages(SMALL)[0], prepared(SMALL)
    problem, iterate = flight.problem(mesh_of(result.trajectory)), iterate_of(result.trajectory)
    mesh, guess = restrict(problem.mesh, iterate, result.mesh.coarser)
    with SolverService() as service:
        solution = SolverSession(service, PLAN, Silent()).solve(
            flight.problem(mesh), guess, "", barrier=InitialBarrier.COARSER_MESH
        )
    assert solution is not None
    objective = result.trajectory.race_time + result.provenance.regularisation
    gained = solution.objective - objective
    assert 0.1 * gained < measure_hold_cost(problem, iterate, result.mesh.coarser).sum() < 1.5 * gained
