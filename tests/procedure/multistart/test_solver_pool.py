"""Several solver processes at work side by side: the order of results, errors, and processes that end."""

import functools
import threading
import time

import pytest
from races import SMALL
from search_races import (
    open_session,
    planned_coarse_solution,
)
from waiting import PATIENCE

from airrace.errors import SolverCrash
from airrace.optimal_control.solvers.service import SolverEnded, SolverPool, SolverService
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.procedure.multistart.coarse_solution import coarse_options, try_solve
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.warm_start import InitialBarrier


class Idle(SolverService):
    """A solver process that is none."""

    def __init__(self) -> None:
        self.ended = False
        self.working = False

    def end(self) -> None:
        self.ended = True

    def stop_unless_started_here(self) -> None:
        assert not self.working


def pool_of(size: int) -> tuple[SolverPool, list[Idle]]:
    services = [Idle() for _ in range(size)]
    return SolverPool(services), services


@pytest.mark.parametrize("size", [1, 2, 4])
def test_results_come_in_the_order_of_the_jobs_whoever_is_first(size: int) -> None:
    pool, _ = pool_of(size)

    def do(_: SolverService, job: int) -> int:
        time.sleep(0.02 / (1 + job))
        return job * job

    with pool:
        assert pool.work(range(12), do) == [job * job for job in range(12)]
        assert pool.work([], do) == []


def test_nobody_works_on_two_jobs_at_once() -> None:
    pool, services = pool_of(3)
    all_at_work = threading.Barrier(3, timeout=PATIENCE)

    def do(service: SolverService, job: int) -> None:
        assert isinstance(service, Idle)
        assert not service.working
        service.working = True
        if job < 3:
            all_at_work.wait()
            assert all(one.working for one in services)
            all_at_work.wait()
        time.sleep(0.001)
        service.working = False

    with pool:
        pool.work(range(20), do)
    assert not any(one.ended for one in services)


def test_error_reaches_the_caller_and_ends_all_for_any_may_be_in_mid_solve() -> None:
    pool, services = pool_of(2)

    def do(_: SolverService, job: int) -> int:
        if job == 1:
            raise SolverCrash("the solver process died")
        return job

    with pytest.raises(SolverCrash, match="died"), pool:
        pool.work(range(4), do)
    assert all(one.ended for one in services)


def test_what_is_left_of_the_jobs_after_an_error_is_not_begun_on_a_process_that_was_ended() -> None:
    pool, services = pool_of(2)
    begun: list[int] = []

    def do(service: SolverService, job: int) -> None:
        begun.append(job)
        assert isinstance(service, Idle)
        if job == 0:
            raise SolverCrash("the solver process died")
        while not service.ended:
            time.sleep(0.001)

    with pytest.raises(SolverCrash), pool:
        pool.work(range(10), do)
    assert len(begun) <= 3
    assert all(one.ended for one in services)


def test_process_that_was_started_anew_in_the_pool_does_not_die_with_it() -> None:
    """On Linux a process ends with the thread that has started it."""
    coarse = planned_coarse_solution(SMALL)

    def solve(service: SolverService, _: object = None) -> ProgramSolution | None:
        return try_solve(service, coarse.problem, coarse.iterate, coarse_options(InitialBarrier.COARSE))

    def solve_anew(service: SolverService, _: object) -> ProgramSolution | None:
        service.stop()
        return solve(service)

    with open_session() as session:
        with session.pool() as pool:
            (inside,) = pool.work([None], solve_anew)
        time.sleep(0.2)  # its thread has ended by now
        outside = solve(session.service)
    assert inside is not None
    assert outside is not None
    assert outside.objective == inside.objective


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_jobs_side_by_side_are_solved_and_recorded_as_one_after_the_other(threads: int) -> None:
    coarse = planned_coarse_solution(SMALL)

    def solve(session: SolverSession, number: int) -> tuple[float, float]:
        time.sleep(0.1 * (3 - number))  # the last one is done first
        found = session.solve(coarse.problem, coarse.iterate, f"job {number}", barrier=InitialBarrier.COARSE)
        assert found is not None
        session.budget.spent += 1000  # what one job spends, no other lacks
        return found.objective, session.budget.spent

    with open_session(threads=threads) as session:
        session.budget.spent = 7
        results = session.side_by_side([functools.partial(solve, number=number) for number in range(3)])
        assert len(session.companions) == threads - 1
        assert {spent for _, spent in results} == {1007}
        assert session.budget.spent == 3007
        assert [one.purpose for one in session.attempts] == ["job 0", "job 1", "job 2"]
        assert len({objective for objective, _ in results}) == 1
    assert not session.companions


def test_service_that_was_ended_starts_no_other_process() -> None:
    coarse = planned_coarse_solution(SMALL)
    with open_session() as session:
        session.service.end()
        with pytest.raises(SolverEnded):
            try_solve(session.service, coarse.problem, coarse.iterate, coarse_options(InitialBarrier.COARSE))
