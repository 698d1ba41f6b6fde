"""The solver session of a stage: the primary solver, then the fallback, within a budget, with every attempt on record.

The budget is how much may be solved for a stage without success before it is given up. Work is counted, not timed, so
that a run ends alike on all computers and with any number of threads: iterations, those of a restoration of feasibility
included, times intervals, times what an iteration costs its solver. Only what ends without an optimum is counted.
Solves that find one are limited by the number of meshes.
"""

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

from airrace.errors import SolverCrash
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.replay import load_in_background
from airrace.optimal_control.solvers.interface import Ending, Multipliers, SolverOptions
from airrace.optimal_control.solvers.messages import IterationReport
from airrace.optimal_control.solvers.service import SolverPool, SolverService, SolverTimeout
from airrace.optimal_control.solvers.solver import SOLVERS, ProgramSolution
from airrace.procedure.guess import first_mesh
from airrace.procedure.planning.plan import Plan
from airrace.procedure.result import Attempt, Iteration, Progress, Silent, Timings
from airrace.procedure.settings import MeshSettings, Settings
from airrace.procedure.warm_start import InitialBarrier

WORK_PER_INTERVAL = 5000
"""The failed work that a stage may take per interval of its race's first mesh: so many iterations on that mesh.

In the runs of the shipped courses one stage of 48 takes any of it, 11; of 54 point masses on generated courses, 24 of
them under tight limits, 47 take none and the others 60 to 540. It is spent in 1.1 to 1.4 times the planned race time.
"""
INTERVALS_MIN = 100
"""The number of intervals that a race is taken to have at least: small ones have time to spare."""
WARM_ITERATIONS_MAX = 80
"""The iterations of a solve that begins with the multipliers of another mesh or stage.

Of 1,102 on 52 courses, the hardest of 206 among them, six took more. Where they mislead, the solvers go without them.
"""
CONTINUATIONS_MAX = 2
"""How often a solve without multipliers that ran out of iterations is continued; with multipliers it is once."""
TIME_GAIN_MIN = 0.02
"""The race time that a solve without multipliers must have gained to be continued, s."""
NEARLY_FEASIBLE = 0.1
"""The largest violation of the last point of a solve that is continued, scaled (1)."""
POLISH = 1e-2
"""The factor on the solver's tolerance (1) where its solution is not good enough for the certificate."""

MEASURED = "its errors are measured to be within the certificate's limit"
"""The words added to the status of a solution that its solver does not claim but that is an optimum."""

SearchResult = TypeVar("SearchResult")
JobResult = TypeVar("JobResult")


@dataclass
class Budget:
    """The work that a stage may take, and what is `spent` of it; by default only what ends without an optimum."""

    work: float = math.inf
    spent: int = 0
    failed_only: bool = True

    @classmethod
    def from_plan(cls, plan: Plan, settings: MeshSettings, per_interval: int | None = None) -> Self:
        """Return a budget from the plan of a race, by default that of each of its stages.

        Args:
            plan: of the race.
            settings: of its first mesh.
            per_interval: the work per interval of that mesh: so many iterations; by default that of a stage.
        """
        intervals = sum(len(fractions) for fractions in first_mesh(plan, settings))
        per_interval = WORK_PER_INTERVAL if per_interval is None else per_interval
        return cls(per_interval * max(intervals, INTERVALS_MIN))

    def reserve_for_diagnosis(self) -> "Budget":
        """Return what is left for finding out why no flight exists: a third at least."""
        return Budget(self.work, min(self.spent, int(2 / 3 * self.work)) if math.isfinite(self.work) else 0)

    @property
    def exhausted(self) -> bool:
        """Whether nothing is left."""
        return self.spent >= self.work


@dataclass(frozen=True)
class _SolverStart:
    """A solver with what it begins from, and how often it may be continued from where it runs out of iterations."""

    solver: str
    guess: Iterate
    multipliers: Multipliers | None
    options: SolverOptions
    continuations: int
    is_continuation: bool = False

    def leads_on(self, solution: ProgramSolution) -> bool:
        """Return whether it is worth while to continue from its solution."""
        gain = self.guess.durations.sum() - solution.iterate.durations.sum()
        return (
            self.continuations > 0
            and solution.ending is Ending.ITERATION_LIMIT
            and solution.kkt.primal < NEARLY_FEASIBLE
            and (self.multipliers is not None or bool(gain > TIME_GAIN_MIN))
        )

    def continued_from(self, solution: ProgramSolution, iterations_max: int) -> "_SolverStart":
        """Return the continuation, with the multipliers that were reached if it began with any."""
        is_warm = self.multipliers is not None
        barrier = InitialBarrier.OTHER_PROBLEM if is_warm else InitialBarrier.COARSE
        return replace(
            self,
            guess=solution.iterate,
            multipliers=solution.multipliers if is_warm else None,
            options=replace(self.options, barrier=barrier.value, iterations_max=iterations_max),
            continuations=self.continuations - 1,
            is_continuation=True,
        )


class BackgroundSearch(Generic[SearchResult]):
    """A search whose result is asked for later, the same whenever and wherever it is made.

    It is a context manager; what is still searched for at its end is given up.

    Args:
        search: what is searched for, with a pool to solve what it needs.
        pool: makes the pool that searches when the result is asked for.
        make: starts the solver process of a search that begins at once, in a thread; None to wait until the result is
            asked for.
    """

    def __init__(
        self,
        search: Callable[[SolverPool], SearchResult],
        pool: Callable[[], SolverPool],
        make: Callable[[], SolverService] | None,
    ) -> None:
        self._search, self._pool, self._make = search, pool, make
        self._service: SolverService | None = None
        self._threads: ThreadPoolExecutor | None = None
        self._future: Future[SearchResult] | None = None

    def __enter__(self) -> Self:
        if self._make is not None:
            self._service = self._make()
            self._threads = ThreadPoolExecutor(1, thread_name_prefix="background search")
            self._future = self._threads.submit(self._run, SolverPool([self._service]))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._service is not None:
            self._service.end()
        if self._threads is not None:
            self._threads.shutdown()

    @property
    def running(self) -> bool:
        """Whether it is searched meanwhile, and nothing is found yet."""
        return self._future is not None and not self._future.done()

    def result(self) -> SearchResult:
        """Return what was found.

        Raises:
            SolverCrash: the solver process died.
        """
        return self._run(self._pool()) if self._future is None else self._future.result()

    def _run(self, pool: SolverPool) -> SearchResult:
        with pool:
            return self._search(pool)


@dataclass
class SolverSession:
    """The means with which the stages solve: a solver process, settings, threads, and the record of attempts.

    `deadline` is the time, by `time.monotonic`, after which nothing is solved any more; `budget` is what a stage may
    solve without success, whatever the time. The search for routes is not counted: it has limits of its own.
    `companions` are solver processes beside the session's own, started when there is work for them until it is
    closed.
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
    background: BackgroundSearch[Any] | None = None  # Any: whatever is searched for
    companions: list[SolverService] = field(default_factory=list[SolverService])

    def close(self) -> None:
        """End the solver processes that were started beside the session's own."""
        while self.companions:
            self.companions.pop().end()

    def side_by_side(self, jobs: Sequence[Callable[["SolverSession"], JobResult]]) -> list[JobResult]:
        """Return what jobs lead to that do not depend on one another, as many at once as there are threads.

        Each has a session of its own, with the budget as it is now, so that no result depends on how many are done at
        once. What they solve is on record in the order of the jobs; only the first reports its progress.
        """
        if len(jobs) < 2:
            return [job(self) for job in jobs]
        spent, processes = self.budget.spent, min(self.threads, len(jobs))
        sessions = [
            replace(
                self,
                progress=Silent() if number else self.progress,
                threads=self.threads // processes,
                attempts=[],
                budget=replace(self.budget),
                derivative_seconds=0.0,
                companions=[],
            )
            for number in range(len(jobs))
        ]

        def work(service: SolverService, number: int) -> JobResult:
            with closing(sessions[number]) as session:
                session.service = service
                return jobs[number](session)

        with self.pool(processes) as pool:
            results = pool.work(range(len(jobs)), work)
        for session in sessions:
            self.attempts += session.attempts
            self.derivative_seconds += session.derivative_seconds
            self.budget.spent += session.budget.spent - spent
        return results

    def pool(self, processes_max: int = 8) -> SolverPool:
        """Return the solver process and others beside it, for solves that do not depend on each other.

        Args:
            processes_max: a quick search rarely has more jobs at once than 8.
        """
        count = min(self.threads, processes_max) - 1
        while len(self.companions) < count:
            self.companions.append(self._start_companion())
        return SolverPool([self.service, *self.companions[:count]])

    def search_in_background(self, search: Callable[[SolverPool], SearchResult]) -> BackgroundSearch[SearchResult]:
        """Return a search beside what is solved here: at once where there are two threads, else afterwards."""

        def search_and_load(pool: SolverPool) -> SearchResult:
            result = search(pool)
            load_in_background()  # not before: two solver processes and this one would share two cores
            return result

        background = BackgroundSearch(search_and_load, self.pool, self._start_companion if self.threads > 1 else None)
        self.background = background
        return background

    @property
    def _searching(self) -> bool:
        return self.background is not None and self.background.running

    def _start_companion(self) -> SolverService:
        return SolverService(stall_seconds=self.settings.solver.stall_seconds, deadline=self.deadline)

    def reset_log(self) -> None:
        """Start a new stage: forget the attempts of the one before."""
        self.restore_log((), Timings(0.0, 0.0, 0.0))

    def restore_log(self, attempts: Sequence[Attempt], timings: Timings) -> None:
        """Take up a stage that was solved before: what is solved now is added to that."""
        self.attempts = list(attempts)
        self.derivative_seconds = timings.derivatives
        self.started = time.perf_counter() - timings.wall
        self.budget.spent = 0

    @property
    def solvers(self) -> tuple[str, ...]:
        """The primary solver, then the fallback where it is another one."""
        return tuple(dict.fromkeys((self.settings.solver.primary, self.settings.solver.fallback)))

    def solve(
        self,
        problem: Problem,
        guess: Iterate,
        purpose: str,
        *,
        barrier: InitialBarrier,
        solvers: Sequence[str] = (),
        iterations_max: int | None = None,
        loose_tolerance: float = 0.0,
        reference_only: bool = False,
        multipliers: Multipliers | None = None,
    ) -> ProgramSolution | None:
        """Solve to the tolerance of the settings, and to a smaller one where the certificate asks for it.

        A solver that begins with multipliers is asked with them first. A solve that ran out of iterations at a nearly
        feasible point is continued: with multipliers once, a cold one as long as the race time falls. A roll that
        changes its place among bang-bang arcs took 1,100 short steps, in which a second was gained.

        Args:
            solvers: asked in this order; without any, all that there are.
            iterations_max: fewer iterations than the settings allow, without continuation; None for as many.
            loose_tolerance: that of an optimum which is only where the next mesh starts from and never certified; 0 for
                that of the settings.
            reference_only: whether the optimum is only compared with and never certified: then it is not polished.
            multipliers: a guess of them; None if nothing is known.

        Returns:
            The first solution that claims success, else the last one; None if no solver came back at all.
        """
        settings, is_certified = self.settings.solver, not (loose_tolerance or reference_only)
        most = min(settings.iterations_max, iterations_max or settings.iterations_max)
        cold = SolverOptions(max(settings.tolerance, loose_tolerance), most, barrier.value, curvature=is_certified)
        warm = replace(cold, iterations_max=min(most, WARM_ITERATIONS_MAX))
        # Multipliers mislead where the optimum is farther away than the barrier parameter was chosen for: with 1e-3
        # instead of 1e-5 second meshes took 91, 107 and 121 iterations, and not 206, 189 and 258.
        misled = replace(cold, barrier=max(cold.barrier, InitialBarrier.COARSE.value)) if barrier.near_optimum else cold
        starts: list[_SolverStart] = []
        for solver in solvers or self.solvers:
            if multipliers is not None and SOLVERS[solver].begins_with_multipliers:
                starts.append(_SolverStart(solver, guess, multipliers, warm, 1))
                # Without continuations: on the one mesh of 130 courses that neither of these starts led on, they took
                # 1,000 iterations in vain, and the other solver 40.
                starts.append(_SolverStart(solver, guess, None, misled, 0))
            else:
                starts.append(_SolverStart(solver, guess, None, cold, CONTINUATIONS_MAX))
        result: ProgramSolution | None = None
        while starts and not (result is not None and result.success):
            start = starts.pop(0)
            words = f"{purpose}, farther down" if start.is_continuation else purpose
            solution = self.attempt(problem, start.guess, words, start.solver, start.options, start.multipliers)
            if solution is None:
                continue
            if result is None or solution.ending is not Ending.BUDGET_EXHAUSTED:
                result = solution
            if iterations_max is None and start.leads_on(solution):
                starts.insert(0, start.continued_from(solution, settings.iterations_max))
        if is_certified and result is not None and result.success:
            return self._polish(problem, result, purpose)
        return result

    def _polish(self, problem: Problem, solution: ProgramSolution, purpose: str) -> ProgramSolution:
        """Solve more closely from a solution whose errors are larger than the certificate allows."""
        if solution.kkt.largest <= self.settings.certificate.kkt_error:
            return solution
        tolerance = POLISH * self.settings.solver.tolerance
        options = SolverOptions(tolerance, self.settings.solver.iterations_max, tolerance, curvature=True)
        closer = self.attempt(problem, solution.iterate, f"{purpose}, closer", solution.solver, options)
        if closer is None or not closer.success or closer.kkt.largest >= solution.kkt.largest:
            return solution
        return closer

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
    ) -> ProgramSolution | None:
        """Solve once, on record; return None if the solver did not come back.

        Within the budget, unless it is a small solve that explains why there is no flight: of a budget that is spent
        the solution says nothing but that (`Ending.BUDGET_EXHAUSTED`).

        What a certificate asks for is measured here, whatever a solver says: it may stop at an optimum without claiming
        it.
        """
        if not self._searching:
            load_in_background()  # what measures the solution
        cost, most = problem.intervals * SOLVERS[solver].effort, options.iterations_max
        left = (self.budget.work - self.budget.spent) / cost
        if not beyond_budget and left < most:
            most = max(0, math.ceil(left))
        if most == 0:
            return ProgramSolution.without_answer(problem, guess, solver, Ending.BUDGET_EXHAUSTED)
        started = time.perf_counter()
        try:
            solution = self.service.solve(
                problem,
                guess,
                solver=solver,
                options=replace(options, iterations_max=most),
                multipliers=multipliers,
                on_iteration=self._report,
                threads=self.threads - self._searching,  # a search beside it has a thread to itself
            )
        except (SolverTimeout, SolverCrash) as error:
            if isinstance(error, SolverCrash) and not error.is_fault:
                raise
            self.attempts.append(Attempt(purpose, solver, str(error), False, 0, time.perf_counter() - started))
            return None
        is_optimal = solution.kkt.largest <= self.settings.certificate.kkt_error
        if is_optimal and not solution.success and solution.ending is not Ending.SADDLE:
            solution = replace(solution, success=True, status=f"{solution.status}; {MEASURED}")
        if not (solution.success and self.budget.failed_only):
            self.budget.spent += solution.iterations * cost
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
