"""The solution of one problem with one call, in a process that can be ended.

An interior point method may never come back from a guess that is bad enough: where derivatives are huge, fatrop adds to
the diagonal of its matrices for ever, without a callback in which it could be told to stop. So the solve happens in a
solver process of its own, see `service.py`, which is started by the first call, serves all others, and is ended when it
finishes no iteration for too long. Whoever wants to stay in this process asks a `PreparedProblem`.
"""

import atexit
import os
import threading
import time
from dataclasses import dataclass

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.process.messages import IterationReport
from airrace.optimal_control.solvers.process.service import STALL_SECONDS, SolverService, SolverTimeout
from airrace.optimal_control.solvers.solver import Solution, SolverOptions


def solve(
    problem: Problem,
    guess: Iterate,
    *,
    solver: str = "fatrop",
    options: SolverOptions | None = None,
    stall_seconds: float = STALL_SECONDS,
) -> Solution:
    """Solve a problem from a guess.

    Args:
        problem: what is to be optimised.
        guess: where the solver begins, in SI.
        solver: one of the names in `solvers.SOLVERS`.
        options: tolerance, iterations and barrier; by default those of `SolverOptions`.
        stall_seconds: longest wait for the next iteration, the first one and what is prepared before it included, s.

    Returns:
        What the solver answers. A solve that finishes no iteration in time is a failed one like any other: its `status`
        says so, its iterate is the guess, and its errors are NaN.

    Raises:
        ValueError: the problem does not say what it seems to say, see `problem.py`, or the guess has other shapes.
        SolverCrash: the solver process died, or could not work on the problem.
    """
    Layout(problem).pack(guess)  # refuses a guess of other shapes here, where the traceback leads to who made it
    started, last = time.perf_counter(), _LastIteration()
    with _LOCK:
        try:
            return _service().solve(
                problem,
                guess,
                solver=solver,
                options=options or SolverOptions(),
                on_iteration=last.take,
                stall_seconds=stall_seconds,
            )
        except SolverTimeout as stalled:
            seconds = time.perf_counter() - started
            return Solution.unsolved(problem, guess, solver, str(stalled), iterations=last.number, seconds=seconds)


@dataclass
class _LastIteration:
    """The number of the last iteration that was reported."""

    number: int = 0

    def take(self, report: IterationReport) -> None:
        self.number = report.number


@dataclass
class _Owned:
    """The solver process of the process `owner`."""

    owner: int = 0
    service: SolverService | None = None


_LOCK = threading.Lock()  # a solver process serves one request at a time
_OWNED = _Owned()


def _service() -> SolverService:
    """Return the solver process of this process.

    One that another thread has started would end with that thread, and one that a parent process has started belongs to
    the parent.
    """
    if _OWNED.owner != os.getpid():
        _OWNED.owner, _OWNED.service = os.getpid(), None
        atexit.register(_stop)
    if _OWNED.service is None:
        _OWNED.service = SolverService()
    _OWNED.service.stop_unless_started_here()
    return _OWNED.service


def _stop() -> None:
    """End the solver process with the process that it serves."""
    if _OWNED.owner == os.getpid() and _OWNED.service is not None:
        _OWNED.service.stop()
