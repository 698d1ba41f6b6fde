"""The program evaluated with numpy has the same bits as the program that casadi evaluates."""

import numpy as np
import pytest
from casadi_program import transcribed
from small_problems import PROBLEMS, random_point

from airrace.errors import SolverCrash
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import bind, bind_all, casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.sparse_assembly import COOBuilder

LAM_F = 0.6


@pytest.fixture(params=PROBLEMS, scope="module")
def assembly(request: pytest.FixtureRequest) -> Assembly:
    problem = PROBLEMS[request.param]
    return Assembly(Layout(problem), casadi_kernels(problem.system, problem.scheme))


def test_all_functions_have_the_bits_of_the_casadi_program(assembly: Assembly) -> None:
    layout, program, functions = assembly.layout, transcribed(assembly), Evaluation(assembly)
    for seed in (1, 2):
        w, _ = random_point(layout, seed)
        p, lam_g = layout.parameter_values(), np.random.default_rng(seed).normal(size=layout.constraints)
        functions.at(w, p)
        functions.lam_f, functions.lam_g[:] = LAM_F, lam_g
        functions.linearise()
        functions.objective_gradient()
        functions.curve()
        f, g = program.nlp(w, p)
        gradient, hessian = program.hess_l(w, p, LAM_F, lam_g)
        assert functions.f == float(f)
        assert functions.g.tolist() == np.asarray(g).ravel().tolist()
        assert functions.f_gradient.tolist() == np.asarray(program.grad_f(w, p)).ravel().tolist()
        assert functions.jacobian.tolist() == program.jac_g(w, p)[1].nonzeros()
        assert functions.gradient.tolist() == np.asarray(gradient).ravel().tolist()
        assert functions.hessian.tolist() == hessian.nonzeros()


def test_the_patterns_are_those_of_the_casadi_program(assembly: Assembly) -> None:
    program = transcribed(assembly)
    assert assembly.jacobian.sparsity == program.jac_g.sparsity_out(1)
    assert assembly.hessian.sparsity == program.hess_l.sparsity_out(1)


def test_values_follow_a_change_of_the_parameters(assembly: Assembly) -> None:
    layout, functions = assembly.layout, Evaluation(assembly)
    w, _ = random_point(layout, 1)
    for factor in (1.0, 1.1):
        p = factor * layout.parameter_values()
        functions.at(w, p)
        assert functions.g.tolist() == np.asarray(transcribed(assembly).nlp(w, p)[1]).ravel().tolist()


def test_the_slope_is_the_gradient_of_the_curve(assembly: Assembly) -> None:
    layout, functions = assembly.layout, Evaluation(assembly)
    functions.at(random_point(layout, 1)[0], layout.parameter_values())
    functions.lam_g[:] = 1.0
    functions.curve()
    expected = functions.gradient.copy()
    functions.gradient[:] = np.nan
    functions.slope()
    assert functions.gradient.tolist() == expected.tolist()


def test_arguments_of_another_size_are_refused(assembly: Assembly) -> None:
    kernel = assembly.calls[0].kernel
    with pytest.raises(SolverCrash, match="argument 0 has another size"):
        bind(kernel.value, (np.zeros(1), np.zeros(1), np.zeros(kernel.value.nnz_in(2))))


@pytest.mark.parametrize("threads", [2, 3])
@pytest.mark.parametrize("calls", [1, 2, 5, 7, 9])
def test_calls_that_threads_cannot_share_evenly_are_made_as_well(assembly: Assembly, calls: int, threads: int) -> None:
    function, random = assembly.calls[0].kernel.hessian, np.random.default_rng(calls)
    sizes = [function.nnz_in(place) for place in range(function.n_in())]
    given = [random.uniform(0.5, 1.0, size=(calls, size)) for size in sizes]
    call, results = bind_all(function, calls, threads, given)
    call()
    for number in range(calls):
        alone, expected = bind(function, [one[number].copy() for one in given])
        alone()
        for one, other in zip(results, expected, strict=True):
            assert one.reshape(calls, -1)[number].tobytes() == other.tobytes()


def test_summands_that_meet_are_added_and_some_nonzeros_can_be_chosen() -> None:
    matrix = COOBuilder(2, 2, symmetric=True)
    matrix.draw_from(2)
    matrix.add(np.array([0, 0]), np.array([0, 1]), np.array([2.0, 3.0]), np.array([0, 1]))
    matrix.draw_from(1)
    matrix.add(np.array([0]), np.array([1]), np.array([10.0]), np.array([0]))
    sums, drawn = matrix.sums(), np.array([1.0, 1.0, 1.0])
    assert list(zip(sums.rows.tolist(), sums.columns.tolist(), sums.of(drawn).tolist(), strict=True)) == [
        (0, 0, 2.0),
        (1, 0, 13.0),
        (0, 1, 13.0),
    ]
    chosen = sums.chosen(np.array([0, 2]), np.array([1.0, -1.0]))
    assert chosen.of(drawn).tolist() == [2.0, -13.0]
    assert (chosen.rows.tolist(), chosen.columns.tolist()) == ([0, 0], [0, 1])
