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
from dataclasses import dataclass, field

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.messages import IterationReport
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.service import STALL_SECONDS, SolverService, Stalled
from airrace.optimal_control.solvers import Solution, SolverOptions


def solve(
    problem: Problem,
    guess: Iterate,
    *,
    solver: str = "fatrop",
    options: SolverOptions | None = None,
    compiled: bool = False,
    stall_seconds: float = STALL_SECONDS,
) -> Solution:
    """Solve a problem from a guess.

    Args:
        problem: what is to be optimised.
        guess: where the solver begins, in SI.
        solver: one of the names in `solvers.SOLVERS`.
        options: tolerance, iterations and barrier; by default those of `SolverOptions`.
        compiled: whether the system's functions are compiled to machine code, in the background where the solver can do
            without meanwhile; that takes seconds once per system and machine and pays for long solves.
        stall_seconds: longest wait for the next iteration, the first one included, s; what is prepared before it counts
            except compiling.

    Returns:
        What the solver answers. A solve that finishes no iteration in time is a failed one like any other: its `status`
        says so, its iterate is the guess, and its errors are NaN.

    Raises:
        ValueError: the problem does not say what it seems to say, see `validity.py`, or the guess has other shapes.
        SolverCrash: the solver process died, or could not work on the problem.
    """
    Layout(problem).pack(guess)  # refuses a guess of other shapes here, where the traceback leads to who made it
    started, last = time.perf_counter(), _LastIteration()
    with _LOCK:
        try:
            return _service(compiled).solve(
                problem,
                guess,
                solver=solver,
                options=options or SolverOptions(),
                on_iteration=last.take,
                stall_seconds=stall_seconds,
            )
        except Stalled as stalled:
            seconds = time.perf_counter() - started
            return Solution.unsolved(problem, guess, solver, str(stalled), iterations=last.number, seconds=seconds)


@dataclass
class _LastIteration:
    """The number of the last iteration that was reported."""

    number: int = 0

    def take(self, report: IterationReport) -> None:
        self.number = report.number


@dataclass
class _Services:
    """The solver processes of one process, by whether they compile."""

    owner: int = 0
    running: dict[bool, SolverService] = field(default_factory=dict[bool, SolverService])


_LOCK = threading.Lock()  # a solver process serves one request at a time
_SERVICES = _Services()


def _service(compiled: bool) -> SolverService:
    """Return the solver process of this process.

    One that another thread has started would end with that thread, and one that a parent process has started belongs to
    the parent.
    """
    if _SERVICES.owner != os.getpid():
        _SERVICES.owner, _SERVICES.running = os.getpid(), {}
        atexit.register(_stop)
    if compiled not in _SERVICES.running:
        _SERVICES.running[compiled] = SolverService(compiled=compiled)
    service = _SERVICES.running[compiled]
    service.stop_unless_started_here()
    return service


def _stop() -> None:
    """End the solver processes with the process that they serve."""
    if _SERVICES.owner == os.getpid():
        for service in _SERVICES.running.values():
            service.stop()
