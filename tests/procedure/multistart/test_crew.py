"""A pool does all jobs, tells results in the order of the jobs, and leaves no process behind."""

import dataclasses
import logging
import threading
import time

import pytest
from races import SMALL
from search_races import open_session, planned_coarse_solution
from waiting import PATIENCE

from airrace.errors import SolverCrash
from airrace.optimal_control.solvers.process.service import SolverEnded, SolverService
from airrace.optimal_control.solvers.solver import Solution
from airrace.procedure.multistart.coarse_solution import try_solve
from airrace.procedure.multistart.solver_pool import SolverPool
from airrace.procedure.start import InitialBarrier


class Idle(SolverService):
    """A solver process that is none."""

    def __init__(self) -> None:
        self.ended = False
        self.working = False

    def end(self) -> None:
        self.ended = True

    def stop_unless_started_here(self) -> None:
        assert not self.working


def crew_of(size: int) -> tuple[SolverPool, Idle, list[Idle]]:
    own, added = Idle(), list[Idle]()

    def make() -> Idle:
        added.append(Idle())
        return added[-1]

    return SolverPool(own, size, make), own, added


@pytest.mark.parametrize("size", [1, 2, 4])
def test_results_come_in_the_order_of_the_jobs_whoever_is_first(size: int) -> None:
    pool, _, added = crew_of(size)
    assert len(added) == size - 1

    def do(_: SolverService, job: int) -> int:
        time.sleep(0.02 / (1 + job))
        return job * job

    with pool:
        assert pool.work(range(12), do) == [job * job for job in range(12)]
        assert pool.work([], do) == []


def test_nobody_works_on_two_jobs_at_once() -> None:
    pool, own, added = crew_of(3)
    all_at_work = threading.Barrier(3, timeout=PATIENCE)

    def do(service: SolverService, job: int) -> None:
        assert isinstance(service, Idle)
        assert not service.working
        service.working = True
        if job < 3:
            all_at_work.wait()
            assert all(one.working for one in (own, *added))
            all_at_work.wait()
        time.sleep(0.001)
        service.working = False

    with pool:
        pool.work(range(20), do)


def test_those_that_were_added_are_ended_and_the_first_one_works_on() -> None:
    pool, own, added = crew_of(3)
    with pool:
        pass
    assert [one.ended for one in added] == [True, True]
    assert not own.ended


def test_error_reaches_the_caller_and_ends_all_for_any_may_be_in_mid_solve() -> None:
    pool, own, added = crew_of(2)

    def do(_: SolverService, job: int) -> int:
        if job == 1:
            raise SolverCrash("the solver process died")
        return job

    with pytest.raises(SolverCrash, match="died"), pool:
        pool.work(range(4), do)
    assert own.ended
    assert all(one.ended for one in added)


def test_what_is_left_of_the_jobs_after_an_error_is_not_begun_on_a_process_that_was_ended() -> None:
    pool, own, added = crew_of(2)
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
    assert own.ended
    assert added[0].ended


def test_no_process_is_left_where_one_cannot_be_started() -> None:
    made: list[Idle] = []

    def make() -> Idle:
        if made:
            raise OSError("no memory")
        made.append(Idle())
        return made[-1]

    with pytest.raises(OSError, match="no memory"):
        SolverPool(Idle(), 3, make)
    assert made[0].ended


def test_process_that_was_started_anew_in_the_crew_does_not_die_with_it() -> None:
    """On Linux a process ends with the thread that has started it."""
    coarse = planned_coarse_solution(SMALL)

    def solve(service: SolverService, _: object = None) -> Solution | None:
        return try_solve(service, coarse.problem, coarse.iterate, InitialBarrier.COARSE)

    def solve_anew(service: SolverService, _: object) -> Solution | None:
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


def test_service_that_was_ended_starts_no_other_process() -> None:
    coarse = planned_coarse_solution(SMALL)
    with open_session() as session:
        session.service.end()
        with pytest.raises(SolverEnded):
            try_solve(session.service, coarse.problem, coarse.iterate, InitialBarrier.COARSE)


def test_flight_that_kills_its_solver_is_left_out_and_the_next_one_is_flown(caplog: pytest.LogCaptureFixture) -> None:
    coarse = planned_coarse_solution(SMALL)
    broken = dataclasses.replace(coarse.iterate, state=coarse.iterate.state[:-1])
    with open_session() as session, caplog.at_level(logging.WARNING):
        assert try_solve(session.service, coarse.problem, broken, InitialBarrier.COARSE) is None
        assert try_solve(session.service, coarse.problem, coarse.iterate, InitialBarrier.COARSE) is not None
    (record,) = caplog.records
    assert "left out" in record.getMessage()
