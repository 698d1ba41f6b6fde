"""The solver session of a stage: the primary solver, then the fallback, with every attempt on record."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.reference_integration import load_in_background
from airrace.optimal_control.solvers.interface import Ending, Multipliers, SolverOptions
from airrace.optimal_control.solvers.process.messages import IterationReport
from airrace.optimal_control.solvers.process.service import SolverService, SolverTimeout
from airrace.optimal_control.solvers.solver import SOLVERS, Solution
from airrace.procedure.background_search import BackgroundSearch, Found
from airrace.procedure.budget import Budget
from airrace.procedure.multistart.solver_pool import SolverPool
from airrace.procedure.progress import Iteration, Progress
from airrace.procedure.result import Attempt, Timings
from airrace.procedure.settings import Settings
from airrace.procedure.start import InitialBarrier

POOL_MAX = 8
"""The largest number of solver processes; quick exploring rarely has more jobs than that at once."""
KNOWN_ITERATIONS_MAX = 60
"""The largest number of iterations of a solve that begins with known multipliers.

They took it from 25 to 17 iterations on Rovinj in 5 kt of wind; where they mislead, it is solved without them.
"""
POLISH = 1e-2
"""The factor on the solver's tolerance (1) where its solution is not good enough for the certificate."""

MEASURED = "its errors are measured to be within the certificate's limit"
"""The words added to the status of a solution that its solver does not claim but that is an optimum."""


@dataclass
class SolverSession:
    """The means with which the stages solve: a solver process, settings, threads, and the record of attempts.

    `deadline` is the time, by `time.monotonic`, after which nothing is solved any more; `budget` is what a stage may
    solve in vain, whatever the time. What is searched for other routes is not counted: it has limits of its own.
    """

    service: SolverService
    settings: Settings
    progress: Progress
    threads: int = 1
    deadline: float = math.inf
    budget: Budget = field(default_factory=Budget)
    attempts: list[Attempt] = field(default_factory=list[Attempt])
    derivative_seconds: float = 0.0
    started: float = field(default_factory=time.perf_counter)
    beside: BackgroundSearch[Any] | None = None  # Any: whatever is searched for

    def pool(self) -> SolverPool:
        """Return the solver process and others beside it, for solves that do not depend on each other."""
        return SolverPool(self.service, min(self.threads, POOL_MAX), self._another)

    def aside(self, search: Callable[[SolverPool], Found]) -> BackgroundSearch[Found]:
        """Return a search beside what is solved here: at once where there are two threads, else afterwards."""

        def searched(pool: SolverPool) -> Found:
            found = search(pool)
            load_in_background()  # not before: two solver processes and this one would share two cores
            return found

        aside = BackgroundSearch(searched, self.pool, self._another if self.threads > 1 else None)
        self.beside = aside
        return aside

    @property
    def threads_left(self) -> int:
        """The number of threads for what is solved here; a search beside it has one to itself."""
        return self.threads - 1 if self.beside is not None and self.beside.running else self.threads

    def _another(self) -> SolverService:
        solver = self.settings.solver
        return SolverService(stall_seconds=solver.stall_seconds, deadline=self.deadline)

    def begin(self) -> None:
        """Start a new stage: forget the attempts of the one before."""
        self.attempts = []
        self.derivative_seconds = 0.0
        self.started = time.perf_counter()
        self.budget.begin()

    def go_on(self, attempts: Sequence[Attempt], timings: Timings) -> None:
        """Take up a stage that was solved before: what is solved now is added to that."""
        self.attempts = list(attempts)
        self.derivative_seconds = timings.derivatives
        self.started = time.perf_counter() - timings.wall
        self.budget.begin()

    @property
    def solvers(self) -> tuple[str, ...]:
        """The primary solver, then the fallback where it is another one."""
        chosen = self.settings.solver
        return tuple(dict.fromkeys((chosen.primary, chosen.fallback)))

    def solve(
        self,
        problem: Problem,
        guess: Iterate,
        purpose: str,
        *,
        barrier: float,
        solvers: Sequence[str] = (),
        iterations_max: int | None = None,
        rough: float = 0.0,
        passing: bool = False,
        multipliers: Multipliers | None = None,
    ) -> Solution | None:
        """Solve to the tolerance of the settings, and to a smaller one where the certificate asks for it.

        Args:
            solvers: asked in this order; without any, all that there are.
            iterations_max: fewer iterations than the settings allow; None for as many.
            rough: a looser tolerance, for an optimum that is only where the next mesh starts from and never certified;
                0 for that of the settings.
            passing: whether the optimum is only compared with and never certified itself, so that it need not be solved
                closer.
            multipliers: a guess of them, with which a solver that begins with them is asked first; None if nothing is
                known.

        Returns:
            The first solution that claims success, else the last one; None if no solver came back at all.
        """
        chosen = self.settings.solver
        most = min(chosen.iterations_max, iterations_max or chosen.iterations_max)
        near = multipliers is not None and barrier in InitialBarrier.NEAR_OPTIMUM
        algorithm = "predictor-corrector" if near else "line-search"
        options = SolverOptions(max(chosen.tolerance, rough), most, barrier, algorithm=algorithm)
        solution = self._first_success(
            problem, guess, purpose, options=options, solvers=solvers or self.solvers, multipliers=multipliers
        )
        limit = self.settings.certificate.kkt_error
        if rough or passing or solution is None or not solution.success or solution.kkt.largest <= limit:
            return solution
        tolerance = POLISH * chosen.tolerance
        options = SolverOptions(tolerance, chosen.iterations_max, tolerance, exact=True)
        closer = self.attempt(problem, solution.iterate, f"{purpose}, closer", solution.solver, options)
        better = closer is not None and closer.success and closer.kkt.largest < solution.kkt.largest
        return closer if better else solution

    def _first_success(
        self,
        problem: Problem,
        guess: Iterate,
        purpose: str,
        *,
        options: SolverOptions,
        solvers: Sequence[str],
        multipliers: Multipliers | None,
    ) -> Solution | None:
        solution: Solution | None = None
        for solver, known, allowed in _tries(solvers, options, multipliers):
            try_solve = self.attempt(problem, guess, purpose, solver, allowed, known)
            if try_solve is not None and (solution is None or try_solve.ending is not Ending.BUDGET_EXHAUSTED):
                solution = try_solve
            if try_solve is not None and try_solve.success:
                return try_solve
        return solution

    def attempt(
        self,
        problem: Problem,
        guess: Iterate,
        purpose: str,
        solver: str,
        options: SolverOptions,
        multipliers: Multipliers | None = None,
        *,
        beyond_budget: bool = False,
    ) -> Solution | None:
        """Solve once, on record; return None if the solver did not come back.

        Within the budget, unless it is a small solve that explains why there is no flight: of a budget that is spent
        the solution says nothing but that (`Ending.BUDGET_EXHAUSTED`).

        What a certificate asks for is measured here, whatever a solver says: fatrop measures on scales of its own, and
        may stop at an optimum without claiming it.
        """
        if self.beside is None or not self.beside.running:
            load_in_background()  # what measures the solution
        most = (
            options.iterations_max if beyond_budget else self.budget.iterations(problem, solver, options.iterations_max)
        )
        if most == 0:
            return Solution.without_answer(problem, guess, solver, Ending.BUDGET_EXHAUSTED)
        started = time.perf_counter()
        try:
            solution = self.service.solve(
                problem,
                guess,
                solver=solver,
                options=replace(options, iterations_max=most),
                multipliers=multipliers,
                on_iteration=self._report,
                threads=self.threads_left,
            )
        except SolverTimeout as fate:
            self.attempts.append(Attempt(purpose, solver, str(fate), False, 0, time.perf_counter() - started))
            return None
        if not solution.success and solution.kkt.largest <= self.settings.certificate.kkt_error:
            solution = replace(solution, success=True, status=f"{solution.status}; {MEASURED}")
        self.budget.spend(problem, solver, solution.iterations, failed_only=not solution.success)
        self.derivative_seconds += solution.derivative_seconds
        self.attempts.append(
            Attempt(purpose, solver, solution.status, solution.success, solution.iterations, solution.seconds)
        )
        return solution

    def _report(self, report: IterationReport) -> None:
        self.progress.iteration(Iteration(report.number, report.objective, report.infeasibility))

    def timings(self) -> Timings:
        """Return where the time of the current stage went, s."""
        solve = sum(attempt.seconds for attempt in self.attempts)
        return Timings(solve, self.derivative_seconds, time.perf_counter() - self.started)


def _tries(
    solvers: Sequence[str], options: SolverOptions, multipliers: Multipliers | None
) -> Iterator[tuple[str, Multipliers | None, SolverOptions]]:
    """Yield what is tried in turn: each solver with the multipliers, if it begins with any, then without them."""
    sooner = replace(options, iterations_max=min(options.iterations_max, KNOWN_ITERATIONS_MAX))
    for solver in solvers:
        if multipliers is not None and SOLVERS[solver].begins_with_multipliers:
            yield solver, multipliers, sooner
        yield solver, None, options
