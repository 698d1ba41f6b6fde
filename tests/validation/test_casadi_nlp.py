"""The discretised problem as a nonlinear program of CasADi, held against the package's own solution."""

import math
from dataclasses import replace
from typing import Any

import casadi as ca
import pytest
from sliding_mass import sliding_mass

from airrace.optimal_control.casadi_nlp import to_casadi
from airrace.optimal_control.solve_problem import solve


def test_another_solver_finds_the_same_optimum_of_the_same_program() -> None:
    answer = sliding_mass(2)
    nlp = to_casadi(answer.problem, answer.guess)
    solver = ca.nlpsol("solver", "ipopt", nlp.nlp, {"ipopt.print_level": 0, "print_time": False, "ipopt.tol": 1e-10})
    found = solver(x0=nlp.x0, p=nlp.p, lbx=nlp.lbx, ubx=nlp.ubx, lbg=nlp.lbg, ubg=nlp.ubg)
    own = solve(answer.problem, answer.guess)
    assert float(found["f"]) == pytest.approx(own.objective, abs=1e-6)  # IPOPT relaxes bounds by 1e-8
    assert own.replay_error < 1e-7
    assert len(set(nlp.x_names)) == len(nlp.x_names) == len(nlp.x0)
    assert len(set(nlp.g_names)) == len(nlp.g_names) == len(nlp.lbg)
    place = nlp.x_names.index("duration of stretch 1")
    assert float(found["x"][place]) * nlp.scale[place] == pytest.approx(1 / math.sqrt(20), abs=1e-5)


def test_a_duration_that_is_no_interval_is_refused_with_what_is_wanted() -> None:
    answer = sliding_mass(1)
    pair: Any = (0.01, 5.0)
    wrong = replace(answer.problem, phases=(replace(answer.problem.phases[0], duration=pair),))
    with pytest.raises(ValueError, match=r"duration of phase 'stretch 0' is \(0.01, 5.0\); give .* Interval"):
        solve(wrong, answer.guess)
