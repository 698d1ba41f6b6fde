"""The budget of the search for conflicts, which counts all that is solved for it, and its progress."""

import dataclasses
from collections.abc import Generator
from contextlib import contextmanager

from airrace.procedure.planning.plan import Plan
from airrace.procedure.result import Iteration, Progress, StageResult
from airrace.procedure.settings import MeshSettings, Settings
from airrace.procedure.solver_session import Budget, SolverSession
from airrace.procedure.stage import Stage

WORK_PER_INTERVAL = 2500
"""The work that the search for the conflicts of a race may take, per interval of its first mesh: so many iterations."""


def conflict_budget(plan: Plan, settings: MeshSettings) -> Budget:
    """Return the budget of the search for the conflicts of a race, from its plan."""
    whole = Budget.from_plan(plan, settings, WORK_PER_INTERVAL)
    return dataclasses.replace(whole, failed_only=False)


@contextmanager
def limited_session(
    session: SolverSession, budget: Budget, settings: Settings | None = None
) -> Generator[SolverSession]:
    """Yield a session with another budget, by choice with other settings; all that it solves is on record in both."""
    limited = dataclasses.replace(session, budget=budget, settings=settings or session.settings)
    begun = limited.derivative_seconds
    try:
        yield limited
    finally:  # attempts are in the same list
        session.derivative_seconds += limited.derivative_seconds - begun


@contextmanager
def searching_conflicts(session: SolverSession, budget: Budget) -> Generator[SolverSession]:
    """Yield a session that solves for the conflicts of a race within their budget, and says so."""
    with limited_session(session, budget) as searching:
        searching.progress = ConflictProgress(session.progress, budget)
        yield searching


class ConflictProgress(Progress):
    """The progress of the search for conflicts, with the share of its budget that is spent.

    Args:
        progress: receives the reports.
        budget: of the search.
    """

    def __init__(self, progress: Progress, budget: Budget) -> None:
        self._progress, self._budget = progress, budget

    def stage_started(self, stage: Stage) -> None:
        self._progress.stage_started(stage)

    def activity(self, text: str, done: int, total: int) -> None:
        spent, work = self._budget.spent, self._budget.work
        share = f"{min(100.0, 100.0 * spent / work):.0f} % of the budget spent"
        message = f"no flight found; searching for the limits in conflict ({share}): {text}"
        self._progress.activity(message, min(spent, int(work)), int(work))

    def iteration(self, iteration: Iteration) -> None:
        self._progress.iteration(iteration)

    def stage_finished(self, result: StageResult) -> None:
        self._progress.stage_finished(result)
