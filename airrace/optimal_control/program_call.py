"""The solution of one discretised problem with one call, in a process that can be ended.

A solver may take long to come back from a guess that is bad enough, without a callback in which it could be stopped. So
the solve happens in a solver process of its own, see `service.py`, which is started by the first call, serves all
others, and is ended when it finishes no iteration for too long. Whoever wants to stay in this process asks a
`PreparedProblem`.
"""

import atexit
import os
import threading
import time

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers import INTERIOR_POINT
from airrace.optimal_control.solvers.interface import Ending, Multipliers, SolverOptions
from airrace.optimal_control.solvers.messages import IterationReport
from airrace.optimal_control.solvers.service import STALL_SECONDS, SolverService, SolverTimeout
from airrace.optimal_control.solvers.solver import ProgramSolution


def solve_program(
    problem: Problem,
    guess: Iterate,
    *,
    solver: str = INTERIOR_POINT,
    options: SolverOptions | None = None,
    multipliers: Multipliers | None = None,
    stall_seconds: float = STALL_SECONDS,
) -> ProgramSolution:
    """Solve a problem on its mesh from a guess.

    Args:
        problem: what is to be optimised.
        guess: where the solver begins, in SI.
        solver: one of the names in `solvers.SOLVERS`.
        options: tolerance, iterations and barrier; by default those of `SolverOptions`.
        multipliers: a guess of them; None if nothing is known.
        stall_seconds: longest wait for the next iteration, the first one and what is prepared before it included, s.

    Returns:
        What the solver answers. A solve that finishes no iteration in time is a failed one like any other: its `status`
        says so, its iterate is the guess, and its errors are NaN.

    Raises:
        ValueError: the problem does not say what it seems to say, see `require_valid`, or the guess has other shapes.
        SolverCrash: the solver process died, or could not work on the problem.
    """
    Layout(problem).pack(guess)  # refuses a guess of other shapes here, where the traceback leads to the caller
    started, reports = time.perf_counter(), list[IterationReport]()
    with _LOCK:
        try:
            return _service().solve(
                problem,
                guess,
                solver=solver,
                options=options or SolverOptions(),
                multipliers=multipliers,
                on_iteration=reports.append,
                stall_seconds=stall_seconds,
            )
        except SolverTimeout as stalled:
            seconds = time.perf_counter() - started
            iterations = reports[-1].number if reports else 0
            return ProgramSolution.without_answer(
                problem, guess, solver, Ending.TIMEOUT, str(stalled), iterations=iterations, seconds=seconds
            )


_LOCK = threading.Lock()  # a solver process serves one request at a time
_SERVICES: dict[int, SolverService] = {}  # by the process that it serves: a fork leaves its parent's alone


def _service() -> SolverService:
    """Return the solver process of this process; one that another thread has started would end with that thread."""
    owner = os.getpid()
    if owner not in _SERVICES:
        _SERVICES[owner] = SolverService()
        atexit.register(_stop)
    _SERVICES[owner].stop_unless_started_here()
    return _SERVICES[owner]


def _stop() -> None:
    if service := _SERVICES.get(os.getpid()):
        service.stop()
