"""One call solves a problem, in a process that others can use too, and that ends with this one."""

import multiprocessing
import os
import subprocess
import sys
import textwrap
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_flights import rest_to_rest

from airrace.errors import SolverCrash
from airrace.optimal_control import solve as module
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Objective
from airrace.optimal_control.solve import solve
from airrace.optimal_control.solvers.process.service import SolverService, SolverTimeout
from airrace.optimal_control.solvers.solver import SOLVERS, PreparedProblem, SolverOptions

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_answer_is_that_of_a_solver_in_this_process(solver: str) -> None:
    problem, guess = rest_to_rest()
    kernels = build_kernels(problem.system, problem.scheme)
    here = PreparedProblem(Layout(problem), kernels, SOLVERS[solver], SolverOptions(), 1).solve(Layout(problem), guess)
    there = solve(problem, guess, solver=solver)
    assert there.success
    assert (there.status, there.iterations, there.objective) == (here.status, here.iterations, here.objective)
    assert (there.iterate.state == here.iterate.state).all()


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    assert solve(*rest_to_rest()).success
    assert capfd.readouterr().out == ""


def test_options_are_the_solvers() -> None:
    hasty = solve(*rest_to_rest(), options=SolverOptions(iterations_max=2))
    assert not hasty.success
    assert hasty.iterations <= 3


def test_a_problem_that_means_something_else_is_refused_here() -> None:
    problem, guess = rest_to_rest()
    with pytest.raises(ValueError, match="unknown controls: g"):
        solve(replace(problem, objective=Objective(regularisation={"g": 1.0})), guess)


def test_a_solver_that_does_not_exist_is_an_error_and_no_end() -> None:
    with pytest.raises(SolverCrash, match="no such solver"):
        solve(*rest_to_rest(), solver="no such solver")
    assert solve(*rest_to_rest()).success


def test_a_solve_without_an_iteration_is_a_failed_one(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, guess = rest_to_rest()

    def stalls(*_: object, stall_seconds: float, **__: object) -> None:
        raise SolverTimeout(f"no iteration finished within {stall_seconds:g} s")

    monkeypatch.setattr(SolverService, "solve", stalls)
    solution = solve(problem, guess, stall_seconds=7.0)
    assert not solution.success
    assert not solution.infeasible
    assert solution.status == "no iteration finished within 7 s"
    assert solution.iterate is guess
    assert np.isnan([solution.objective, solution.kkt.largest]).all()
    assert solution.multipliers.constraints.shape == (Layout(problem).constraints,)


def test_threads_take_turns_and_leave_a_process_that_serves() -> None:
    """On Linux the process ends with the thread that has started it."""
    module._stop()
    found: list[bool] = []
    threads = [threading.Thread(target=lambda: found.append(solve(*rest_to_rest()).success)) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [True] * 3
    assert solve(*rest_to_rest()).success


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a system without fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")  # of Python 3.12 and later, about threads
def test_a_process_that_forks_leaves_its_solver_alone() -> None:
    assert solve(*rest_to_rest()).success
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply(_succeeds)
    assert solve(*rest_to_rest()).success


def _succeeds() -> bool:
    return solve(*rest_to_rest()).success


def test_the_solver_process_ends_with_this_one() -> None:
    script = textwrap.dedent("""
        import sys
        sys.path.insert(0, sys.argv[1])
        from known_flights import rest_to_rest
        from airrace.optimal_control import solve as module
        assert module.solve(*rest_to_rest()).success
        service = module._OWNED.service
        print(service._process.pid)
    """)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", script, str(Path(__file__).parent)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    assert not Path(f"/proc/{done.stdout.strip()}").exists()
