"""A crew does all jobs, tells results in the order of the jobs, and leaves no process behind."""

import threading
import time

import pytest

from airrace.errors import SolverCrash
from airrace.optimal_control.service import SolverService
from airrace.procedure.ways.crew import Crew


class Idle(SolverService):
    """A solver process that is none."""

    def __init__(self) -> None:
        self.stopped = False
        self.working = False

    def stop(self) -> None:
        self.stopped = True


def crew_of(size: int) -> tuple[Crew, Idle, list[Idle]]:
    own, added = Idle(), list[Idle]()

    def make() -> Idle:
        added.append(Idle())
        return added[-1]

    return Crew(own, size, make), own, added


@pytest.mark.parametrize("size", [1, 2, 4])
def test_results_come_in_the_order_of_the_jobs_whoever_is_first(size: int) -> None:
    crew, _, added = crew_of(size)
    assert len(added) == size - 1

    def do(_: SolverService, job: int) -> int:
        time.sleep(0.02 / (1 + job))
        return job * job

    with crew:
        assert crew.work(range(12), do) == [job * job for job in range(12)]
        assert crew.work([], do) == []


def test_nobody_works_on_two_jobs_at_once() -> None:
    crew, own, added = crew_of(3)
    most, lock = [0], threading.Lock()

    def do(service: SolverService, _: int) -> None:
        assert isinstance(service, Idle)
        assert not service.working
        service.working = True
        with lock:
            most[0] = max(most[0], sum(one.working for one in (own, *added)))
        time.sleep(0.01)
        service.working = False

    with crew:
        crew.work(range(20), do)
    assert most == [3]


def test_those_that_were_added_are_ended_and_the_first_one_works_on() -> None:
    crew, own, added = crew_of(3)
    with crew:
        pass
    assert [one.stopped for one in added] == [True, True]
    assert not own.stopped


def test_error_reaches_the_caller_and_ends_all_for_any_may_be_in_mid_solve() -> None:
    crew, own, added = crew_of(2)

    def do(_: SolverService, job: int) -> int:
        if job == 1:
            raise SolverCrash("the solver process died")
        return job

    with pytest.raises(SolverCrash, match="died"), crew:
        crew.work(range(4), do)
    assert own.stopped
    assert all(one.stopped for one in added)
