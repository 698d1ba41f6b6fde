"""The functions that IPOPT calls have the bits of the program's evaluation, native or casadi's."""

import casadi as ca
import numpy as np
import pytest
from casadi_program import transcribed
from small_problems import PROBLEMS, random_point

from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import build_kernels, casadi_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.solvers.ipopt_functions import ProgramFunctions

LAM_F = 0.6


def arrays(results: ca.DM | tuple[ca.DM, ...]) -> list[np.ndarray]:
    """The nonzeros of a function's results."""
    every = results if isinstance(results, tuple) else (results,)
    return [np.array(one.nonzeros()) for one in every]


@pytest.mark.parametrize("name", PROBLEMS)
def test_all_functions_have_the_bits_of_casadis_own_program(name: str) -> None:
    problem = PROBLEMS[name]
    layout = Layout(problem)
    assembly = Assembly(layout, casadi_kernels(problem.system, problem.scheme))
    mine, theirs = ProgramFunctions(Evaluation(assembly)), transcribed(assembly)
    (w, lam_g), p = random_point(layout, 1), layout.parameter_values()
    mine.begin(p)
    pairs = [
        (mine.nlp(w, p), theirs.nlp(w, p)),
        (mine.derivatives["nlp_grad_f"](w, p), theirs.f_and_grad(w, p)),
        (mine.derivatives["nlp_jac_g"](w, p), theirs.jac_g(w, p)),
        (mine.derivatives["nlp_hess_l"](w, p, LAM_F, lam_g), theirs.hess_l_upper(w, p, LAM_F, lam_g)),
        (mine.derivatives["nlp_grad"](w, p, LAM_F, lam_g), theirs.grad(w, p, LAM_F, lam_g)),
    ]
    for one, other in pairs:
        for found, expected in zip(arrays(one), arrays(other), strict=True):
            assert np.array_equal(found, expected)


def test_ipopt_evaluates_what_fatrop_does() -> None:
    problem = PROBLEMS["everything"]
    layout = Layout(problem)
    functions = Evaluation(Assembly(layout, build_kernels(problem.system, problem.scheme)))
    (w, lam_g), p = random_point(layout, 2), layout.parameter_values()
    program = ProgramFunctions(functions)
    program.begin(p)
    upper = np.array(program.derivatives["nlp_hess_l"](w, p, LAM_F, lam_g).nonzeros())
    other = Evaluation(functions.assembly)
    other.at(w, p)
    other.lam_f, other.lam_g[:] = LAM_F, lam_g
    other.curve()
    sums = other.assembly.hessian
    assert np.array_equal(upper, other.hessian[sums.rows <= sums.columns])


@pytest.mark.parametrize("name", ["nlp_jac_g", "nlp_hess_l"])
def test_patterns_are_those_of_the_assembly(name: str) -> None:
    problem = PROBLEMS["everything"]
    assembly = Assembly(Layout(problem), build_kernels(problem.system, problem.scheme))
    function = ProgramFunctions(Evaluation(assembly)).derivatives[name]
    expected = assembly.jacobian.sparsity if name == "nlp_jac_g" else ca.triu(assembly.hessian.sparsity)
    assert function.sparsity_out(function.n_out() - 1) == expected
