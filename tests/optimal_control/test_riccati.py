"""The Newton step by a Riccati recursion solves the system of the whole program, and tells where it is no descent."""

import numpy as np
import pytest
from small_problems import PROBLEMS, random_point

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.solvers import riccati
from airrace.optimal_control.solvers.riccati import StageSystem


def evaluated(name: str) -> tuple[Evaluation, np.ndarray, np.ndarray]:
    """The program at a random point, with its dense Hessian and Jacobian."""
    problem = PROBLEMS[name]
    layout = Layout(problem)
    functions = Evaluation(Assembly(layout, casadi_kernels(problem.system, problem.scheme)))
    w, lam_g = random_point(layout, 3)
    functions.at(w, layout.parameter_values())
    functions.lam_f, functions.lam_g[:] = 1.0, lam_g
    functions.linearise()
    functions.curve()
    H, J = np.zeros((layout.unknowns, layout.unknowns)), np.zeros((layout.constraints, layout.unknowns))
    for matrix, sums, nonzeros in (
        (H, functions.assembly.hessian, functions.hessian),
        (J, functions.assembly.jacobian, functions.jacobian),
    ):
        matrix[sums.rows, sums.columns] = nonzeros
    return functions, H, J


def written(functions: Evaluation) -> StageSystem:
    system = StageSystem(functions.assembly)
    assert system.write(functions.linear(), functions.curved())
    return system


@pytest.mark.parametrize("name", PROBLEMS)
def test_step_solves_the_system_of_the_whole_program(name: str) -> None:
    functions, H, J = evaluated(name)
    layout = functions.assembly.layout
    system, random = written(functions), np.random.default_rng(4)
    weights = random.uniform(50.0, 100.0, system.rows + system.unknowns)
    assert system.factorise(weights)
    stationarity, gaps = random.normal(size=system.unknowns), random.normal(size=system.gaps)
    step, multipliers = system.solve(stationarity, gaps)
    G, C = J[layout.gap_index.ravel()], J[layout.row_index]
    curvature = H + C.T @ (weights[: system.rows, None] * C) + np.diag(weights[system.rows :])
    assert curvature @ step + G.T @ multipliers == pytest.approx(stationarity, abs=1e-9)
    assert G @ step == pytest.approx(gaps, abs=1e-10)


@pytest.mark.parametrize("name", ["everything", "jumps", "one of each"])
def test_rows_change_as_the_jacobian_says(name: str) -> None:
    functions, _, J = evaluated(name)
    system, C = written(functions), J[functions.assembly.layout.row_index]
    random = np.random.default_rng(5)
    step, values = random.normal(size=system.unknowns), random.normal(size=system.rows + system.unknowns)
    assert system.values(step) == pytest.approx(np.concatenate([C @ step, step]), abs=1e-12)
    assert system.transposed(values) == pytest.approx(C.T @ values[: system.rows] + values[system.rows :], abs=1e-12)


@pytest.mark.parametrize("name", PROBLEMS)
def test_step_that_leads_to_no_minimum_is_told(name: str) -> None:
    functions, _, _ = evaluated(name)
    system = written(functions)
    weights = np.zeros(system.rows + system.unknowns)
    weights[system.rows :] = -1e3
    assert not system.factorise(weights)


def test_identity_stands_in_for_the_hessian() -> None:
    functions, _, J = evaluated("everything")
    system = StageSystem(functions.assembly)
    assert system.write_identity(functions.linear())
    assert system.factorise(np.zeros(system.rows + system.unknowns))
    stationarity = np.random.default_rng(6).normal(size=system.unknowns)
    step, multipliers = system.solve(stationarity, np.zeros(system.gaps))
    G = J[functions.assembly.layout.gap_index.ravel()]
    assert step + G.T @ multipliers == pytest.approx(stationarity, abs=1e-10)
    system.clear()
    assert system.write(functions.linear(), functions.curved())
    other = written(functions)
    weights = np.full(system.rows + system.unknowns, 50.0)
    assert system.factorise(weights) == other.factorise(weights)
    assert system.solve(stationarity, np.zeros(system.gaps))[0] == pytest.approx(
        other.solve(stationarity, np.zeros(system.gaps))[0], abs=1e-12
    )


def test_without_a_library_nothing_is_available(monkeypatch: pytest.MonkeyPatch) -> None:
    functions, _, _ = evaluated("everything")
    assert riccati.available(functions.assembly)
    monkeypatch.setattr(riccati, "library", lambda: None)
    assert not riccati.available(functions.assembly)
