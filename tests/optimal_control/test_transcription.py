"""The derivatives put together from the kernels are those of the program, and have the structure the solvers need."""

import casadi as ca
import numpy as np
import pytest
from casadi_program import NonlinearProgram, transcribe
from small_problems import PROBLEMS, ended_problem, random_iterate, random_point, rich_problem, staged_problem

from airrace.optimal_control.kernels import casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Phase, Problem, uniform
from airrace.quantities import Interval

STEP = 1e-6
LAM_F = 0.6


def program_of(problem: Problem, threads: int = 1) -> tuple[Layout, NonlinearProgram]:
    layout = Layout(problem)
    return layout, transcribe(layout, casadi_kernels(problem.system, problem.scheme), threads)


def differences(function, w: np.ndarray) -> np.ndarray:
    """Central differences of a vector function, shape (n, n_w)."""
    return np.stack([(function(w + STEP * e) - function(w - STEP * e)) / (2 * STEP) for e in np.eye(len(w))], axis=1)


def dense(value: ca.DM) -> np.ndarray:
    return np.asarray(value.full())


@pytest.fixture(params=PROBLEMS, scope="module")
def transcribed(request: pytest.FixtureRequest) -> tuple[Layout, NonlinearProgram, np.ndarray]:
    problem = PROBLEMS[request.param]
    layout, program = program_of(problem)
    return layout, program, layout.parameter_values()


@pytest.mark.parametrize("seed", [1, 2])
def test_gradient_of_the_objective_agrees_with_differences(transcribed, seed: int) -> None:
    layout, program, p = transcribed
    w, _ = random_point(layout, seed)
    expected = differences(lambda w: dense(program.nlp(w, p)[0]).ravel(), w).ravel()
    assert dense(program.grad_f(w, p)).ravel() == pytest.approx(expected, abs=1e-8)
    f, gradient = program.f_and_grad(w, p)
    assert dense(gradient).ravel() == pytest.approx(expected, abs=1e-8)
    assert float(f) == float(program.nlp(w, p)[0])


@pytest.mark.parametrize("seed", [1, 2])
def test_jacobian_agrees_with_differences(transcribed, seed: int) -> None:
    layout, program, p = transcribed
    w, _ = random_point(layout, seed)
    g, jacobian = program.jac_g(w, p)
    expected = differences(lambda w: dense(program.nlp(w, p)[1]).ravel(), w)
    assert dense(jacobian) == pytest.approx(expected, abs=1e-7)
    assert dense(g) == pytest.approx(dense(program.nlp(w, p)[1]), abs=1e-14)


@pytest.mark.parametrize("seed", [1, 2])
def test_gradient_of_the_lagrangian_is_made_of_those_of_objective_and_constraints(transcribed, seed: int) -> None:
    layout, program, p = transcribed
    w, lam_g = random_point(layout, seed)
    expected = LAM_F * dense(program.grad_f(w, p)) + dense(program.jac_g(w, p)[1]).T @ lam_g[:, None]
    assert dense(program.hess_l(w, p, LAM_F, lam_g)[0]) == pytest.approx(expected, abs=1e-12)
    assert dense(program.grad(w, p, LAM_F, lam_g)[2]) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("seed", [1, 2])
def test_hessian_agrees_with_differences_of_the_gradient(transcribed, seed: int) -> None:
    layout, program, p = transcribed
    w, lam_g = random_point(layout, seed)
    expected = differences(lambda w: dense(program.hess_l(w, p, LAM_F, lam_g)[0]).ravel(), w)
    full = dense(program.hess_l(w, p, LAM_F, lam_g)[1])
    assert full == pytest.approx(expected, abs=1e-7)
    assert (full == full.T).all()
    assert (dense(program.hess_l_upper(w, p, LAM_F, lam_g)) == np.triu(full)).all()


def test_each_stage_meets_the_next_only_through_an_identity(transcribed) -> None:
    """The structure that a Riccati recursion needs, of the Jacobian and of the Hessian."""
    layout, program, p = transcribed
    w, lam_g = random_point(layout, seed=3)
    jacobian = dense(program.jac_g(w, p)[1])
    hessian = dense(program.hess_l(w, p, LAM_F, lam_g)[1])
    columns = np.cumsum([0, *(layout.stage_states + layout.stage_controls)])
    gaps = [*layout.stage_states[1:], 0]
    rows = np.cumsum([0, *(layout.stage_rows + gaps)])
    for stage, gap in enumerate(gaps):
        here = slice(columns[stage], columns[stage + 1])
        block = jacobian[rows[stage] : rows[stage + 1]].copy()
        block[:, here] = 0.0
        block[:gap, columns[stage + 1] : columns[stage + 1] + gap] -= np.eye(gap)
        assert (block == 0.0).all()
        outside = hessian[here].copy()
        outside[:, here] = 0.0
        assert (outside == 0.0).all()
    row, column = (np.array(one) for one in program.hess_l.sparsity_out(1).get_triplet())
    stage = np.searchsorted(columns, [row, column], side="right")
    assert (stage[0] == stage[1]).all()


@pytest.mark.parametrize("problem", [rich_problem(), staged_problem()], ids=["continuous", "jumping"])
def test_gaps_are_the_jumps_when_each_interval_is_integrated_from_the_last(problem: Problem) -> None:
    layout, program = program_of(problem)
    step = casadi_kernels(problem.system, problem.scheme).step.value
    iterate = random_iterate(problem, seed=4)
    for k in range(layout.intervals):
        duration = iterate.durations[layout.phase_of_interval[k]]
        y = [*iterate.state[:, k], *iterate.control[:, k], duration]
        iterate.state[:, k + 1] = dense(step(y, layout.fractions[k], problem.parameters)).ravel()
        if k + 1 in problem.first_node[1:]:
            iterate.state[:, k + 1] += problem.jumps[:, layout.phase_of_interval[k]]
    g = dense(program.nlp(layout.pack(iterate), layout.parameter_values())[1]).ravel()
    for bounds in layout.constraint_bounds():
        assert g[layout.gap_index] == pytest.approx(bounds[layout.gap_index], abs=1e-14)


@pytest.mark.parametrize("problem", [rich_problem(), staged_problem()], ids=["continuous", "jumping"])
def test_constraints_are_path_and_boundary_values_in_units_of_their_scales(problem: Problem) -> None:
    layout, program = program_of(problem)
    iterate = random_iterate(problem, seed=5)
    g = dense(program.nlp(layout.pack(iterate), layout.parameter_values())[1]).ravel()
    for row, place in zip(layout.flat_rows, layout.row_index, strict=True):
        x = iterate.state[:, row.node]
        if row.source < 0:
            u = iterate.control[:, min(row.node, layout.intervals - 1)]
            values = problem.system.path_values(x, u, problem.parameters)
        else:
            output_sample = layout.output_samples[row.source]
            first = len(problem.parameters) + layout.intervals + output_sample.offset
            parameters = layout.parameter_values()[first : first + len(output_sample.observation.parameters)]
            seen = x if output_sample.jump is None else problem.states_before_jump(iterate.state)[:, row.node - 1]
            values = output_sample.observation.values(seen, parameters)
        assert g[place] == pytest.approx(float(values[row.component]) / row.quantity.scale, abs=1e-13)


def test_objective_is_time_terminal_values_and_regularisation() -> None:
    problem = rich_problem()
    layout, program = program_of(problem)
    iterate = random_iterate(problem, seed=6)
    lengths = layout.fractions * iterate.durations[layout.phase_of_interval]
    s, t = iterate.control / np.array([[4.0], [0.25]])
    b, c = iterate.state[1:, -1]
    expected = 0.8 * iterate.durations.sum() - 0.3 * b + 0.2 * c + lengths @ (0.05 * s**2 + 0.4 * t**2)
    assert float(program.nlp(layout.pack(iterate), layout.parameter_values())[0]) == pytest.approx(expected, abs=1e-13)


def test_objective_takes_what_is_observed_of_the_final_state() -> None:
    problem = ended_problem()
    layout, program = program_of(problem)
    iterate = random_iterate(problem, seed=6)
    a, b, c = iterate.state[:, -1]
    w, p = layout.pack(iterate), layout.parameter_values()
    plain, same = program_of(staged_problem())
    without = float(same.nlp(plain.pack(iterate), plain.parameter_values())[0])
    effort, swing = np.exp(0.3 * a) * b - 0.7 * c**2, np.sin(a * c)
    assert float(program.nlp(w, p)[0]) == pytest.approx(without + 0.6 * effort - 0.4 * swing, abs=1e-13)


def test_threads_change_nothing() -> None:
    problem = rich_problem()
    long = Problem(
        problem.system,
        problem.parameters,
        problem.start,
        (*problem.phases, Phase("long", uniform(70), Interval(0.1, 2.0))),
        problem.objective,
    )
    layout, alone = program_of(long)
    _, together = program_of(long, threads=2)
    w, lam_g = random_point(layout, seed=7)
    p = layout.parameter_values()
    for one, two in zip(alone.hess_l(w, p, LAM_F, lam_g), together.hess_l(w, p, LAM_F, lam_g), strict=True):
        assert (dense(one) == dense(two)).all()
    for one, two in zip(alone.jac_g(w, p), together.jac_g(w, p), strict=True):
        assert (dense(one) == dense(two)).all()
