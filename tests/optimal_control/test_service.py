"""The solver process: it answers, it can be stopped, it leaves nothing behind."""

import io
import pickle
import queue
import subprocess
import sys
import textwrap
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil
import pytest
from known_flights import rest_to_rest
from waiting import has_passed, instant, wait_until_gone

from airrace.errors import OutOfTime, SolverCrash
from airrace.optimal_control.kernels import Kernels, build_kernels
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.solvers.process.messages import (
    Inbox,
    IterationReport,
    Notice,
    PreloadRequest,
    SolveRequest,
)
from airrace.optimal_control.solvers.process.service import SolverService, SolverTimeout
from airrace.optimal_control.solvers.process.worker import SolveServer
from airrace.optimal_control.solvers.solver import Solution, SolverOptions
from airrace.system import System

TESTS = Path(__file__).parent
PIPE_BYTES = 2**16
"""What a pipe holds before who writes must wait, on Linux."""
LONGEST_SOLVE = 120.0
"""The time after which a solve is considered to hang, s; it takes less than one."""


def solve(
    service: SolverService,
    stated: tuple[Problem, Iterate] | None = None,
    *,
    solver: str = "fatrop",
    on_iteration: Callable[[IterationReport], None] | None = None,
    stall_seconds: float | None = None,
) -> Solution:
    problem, guess = stated or rest_to_rest()
    options = SolverOptions()
    return service.solve(
        problem, guess, solver=solver, options=options, on_iteration=on_iteration, stall_seconds=stall_seconds
    )


def children(of: int | None = None) -> set[int]:
    """Processes started by this one, or by another."""
    return {child.pid for child in psutil.Process(of).children()}


def worker_of(service_started_after: set[int]) -> int:
    (worker,) = children() - service_started_after
    return worker


@pytest.mark.parametrize("solver", ["fatrop", "ipopt"])
def test_solution_and_iterations_come_back(solver: str) -> None:
    reports: list[IterationReport] = []
    with SolverService() as service:
        solution = solve(service, solver=solver, on_iteration=reports.append)
    assert solution.success
    assert solution.solver == solver
    assert solution.kkt.largest < 1e-6
    numbers = [report.number for report in reports]
    assert numbers == sorted(numbers)
    assert numbers[-1] == solution.iterations > 1
    assert reports[-1].infeasibility < 1e-6 < reports[0].infeasibility


def test_second_solve_in_the_same_process_gives_the_same_solution() -> None:
    with SolverService() as service:
        first, second = solve(service), solve(service)
    assert (second.iterate.state == first.iterate.state).all()
    assert second.objective == first.objective
    assert second.iterations == first.iterations


def test_problems_of_another_structure_are_solved_in_between() -> None:
    with SolverService() as service:
        coarse, fine = solve(service, rest_to_rest(12)), solve(service, rest_to_rest(24))
        again = solve(service, rest_to_rest(12))
    assert (again.iterate.state == coarse.iterate.state).all()
    assert fine.iterate.control.shape == (1, 24)


def test_one_process_serves_all_solves() -> None:
    before = children()
    with SolverService() as service:
        worker = worker_of(before)
        solve(service)
        solve(service)
        assert worker_of(before) == worker


def test_killed_worker_is_a_solver_crash() -> None:
    before = children()
    with SolverService() as service:
        psutil.Process(worker_of(before)).kill()
        with pytest.raises(SolverCrash, match="died"):
            solve(service)


def test_worker_killed_in_mid_solve_is_a_solver_crash_and_the_next_solve_has_a_new_one() -> None:
    before = children()
    with SolverService() as service:
        first = worker_of(before)
        with pytest.raises(SolverCrash, match="died"):
            solve(service, on_iteration=lambda _: psutil.Process(first).kill())
        wait_until_gone(first)
        assert solve(service).success
        assert worker_of(before) != first


def test_worker_that_finishes_no_iteration_is_stopped_and_replaced() -> None:
    before = children()
    with SolverService() as service:
        solve(service)  # by now everything is loaded
        first = worker_of(before)
        with pytest.raises(SolverTimeout, match="no iteration finished within 4 s"):
            solve(
                service, rest_to_rest(2000), on_iteration=lambda _: psutil.Process(first).suspend(), stall_seconds=4.0
            )
        wait_until_gone(first)
        assert solve(service).success


def test_time_in_which_this_process_stands_still_is_no_stall(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever was stopped while waiting is told, when it goes on, that all of its time has passed."""
    wait, stopped = Inbox.next, list[float | None]()

    def first_stopped(replies: Inbox, patience: float | None = None) -> Any:
        if not stopped:
            stopped.append(patience)
            raise queue.Empty
        return wait(replies, patience)

    monkeypatch.setattr(Inbox, "next", first_stopped)
    with SolverService(stall_seconds=20.0) as service:
        assert solve(service).success
    assert len(stopped) == 1


def test_stall_is_noticed_although_the_worker_is_busy() -> None:
    with SolverService(stall_seconds=0.01) as service, pytest.raises(SolverTimeout):
        solve(service, rest_to_rest(400))


def test_what_the_process_tells_besides_leaves_the_patience_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    replies = iter([Notice("casadi evaluates it, slower")])

    def silent_afterwards(_: float) -> Notice:
        for reply in replies:
            return reply
        raise queue.Empty

    with SolverService(stall_seconds=0.01, on_notice=told.append) as service:
        monkeypatch.setattr(service._replies, "next", silent_afterwards)
        with pytest.raises(SolverTimeout):
            solve(service)
    assert told == ["casadi evaluates it, slower"]


def test_nothing_is_solved_after_the_deadline_and_no_process_is_left() -> None:
    before = children()
    deadline = instant(1.5)
    service = SolverService(deadline=deadline)
    problem = rest_to_rest(30000)  # which takes longer
    with pytest.raises(OutOfTime):
        solve(service, problem)
    assert has_passed(deadline)
    assert children() == before
    with pytest.raises(OutOfTime):
        solve(service)


def test_leaving_the_context_leaves_no_process() -> None:
    before = children()
    with SolverService() as service:
        worker = worker_of(before)
        solve(service)
    wait_until_gone(worker)
    assert children() == before


def test_interrupt_in_mid_solve_leaves_no_process() -> None:
    def interrupt(_: IterationReport) -> None:
        raise KeyboardInterrupt

    before = children()
    service = SolverService()
    worker = worker_of(before)
    with pytest.raises(KeyboardInterrupt):
        solve(service, on_iteration=interrupt)
    wait_until_gone(worker)
    assert children() == before


def test_an_error_of_who_is_told_is_its_own_and_not_the_death_of_the_process() -> None:
    """A pipe that is broken behind a callback is none of the service's."""

    def tell(report: IterationReport) -> None:
        raise BrokenPipeError("the reader has gone")

    with SolverService() as service:
        with pytest.raises(BrokenPipeError, match="the reader has gone"):
            solve(service, on_iteration=tell)
        assert solve(service).success


def test_what_is_put_off_is_done_once_before_the_next_solution_is_waited_for() -> None:
    done: list[str] = []
    with SolverService() as service:
        service.defer(lambda: done.append("first"))
        service.defer(lambda: done.append("second"))
        assert not done
        solve(service, on_iteration=lambda _: done.append("iteration"))
        assert done[:3] == ["first", "second", "iteration"]
        done.clear()
        solve(service)
        assert not done


def test_what_is_announced_meanwhile_and_the_solution_do_not_wait_for_each_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Neither fits into a pipe: who writes one waits until the other side reads."""
    problem, guess = rest_to_rest(2000)
    large = replace(problem.system, name="oscillator" * 100_000)
    with SolverService() as service:
        service.defer(lambda: service.preload(large, problem.scheme))
        watchdog = threading.Timer(LONGEST_SOLVE, service.end)
        watchdog.start()
        try:
            solution = solve(service, (problem, guess))
        finally:
            watchdog.cancel()
        assert len(pickle.dumps(solution)) > PIPE_BYTES
        assert solve(service).success


def test_an_error_of_what_was_put_off_is_its_own_and_leaves_no_process() -> None:
    before = children()

    def refuse() -> None:
        raise ValueError("refused")

    with SolverService() as service:
        service.defer(refuse)
        worker = worker_of(before)
        with pytest.raises(ValueError, match="refused"):
            solve(service)
        wait_until_gone(worker)
        assert solve(service).success


def test_request_that_cannot_be_worked_on_is_a_solver_crash_that_says_why() -> None:
    with SolverService() as service:
        with pytest.raises(SolverCrash, match="no such solver"):
            solve(service, solver="no such solver")
        assert solve(service).success


def test_contradicting_bounds_are_an_answer() -> None:
    problem, guess = rest_to_rest()
    (phase,) = problem.phases
    narrow = replace(problem, phases=(replace(phase, duration=replace(phase.duration, lower=9.5)),))
    with SolverService() as service:
        solution = solve(service, (narrow, guess))
    assert not solution.success
    assert solution.infeasible


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone ends a process with its parent")
def test_worker_dies_with_its_parent_even_where_it_cannot_notice() -> None:
    program = f"""
        import sys
        sys.path.insert(0, {str(TESTS)!r})
        from known_flights import rest_to_rest
        from airrace.optimal_control.solvers.process.service import SolverService
        from airrace.optimal_control.solvers.solver import SolverOptions
        service = SolverService()
        problem, guess = rest_to_rest()
        service.solve(problem, guess, solver="fatrop", options=SolverOptions())
        print("ready", flush=True)
        sys.stdin.read()
    """
    command = [sys.executable, "-c", textwrap.dedent(program)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        assert parent.stdout.readline() == "ready\n"
        (worker,) = children(parent.pid)
        psutil.Process(worker).suspend()  # as good as lost in a solve that never ends
        parent.kill()
    wait_until_gone(worker)


def test_announced_kernels_are_made_ready_once(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, guess = rest_to_rest()
    server = SolveServer()
    built = kernels_that_are_built(monkeypatch)
    server.preload(PreloadRequest(problem.system, problem.scheme))
    assert built == [problem.system]
    monkeypatch.setattr(sys, "stdout", io.StringIO())  # what the solver prints
    request = SolveRequest(problem, guess, None, "fatrop", SolverOptions(), 1)
    assert server.solve(request).success
    assert built == [problem.system]


def kernels_that_are_built(monkeypatch: pytest.MonkeyPatch) -> list[System]:
    """The systems whose kernels a server has made so far."""
    made: list[System] = []

    def watched(system: System, scheme: RungeKutta) -> Kernels:
        made.append(system)
        return build_kernels(system, scheme)

    monkeypatch.setattr("airrace.optimal_control.solvers.process.worker.build_kernels", watched)
    return made


def test_a_process_that_died_is_announced_to_in_vain_and_told_by_the_next_solve() -> None:
    problem, guess = rest_to_rest()
    before = children()
    with SolverService() as service:
        worker = worker_of(before)
        psutil.Process(worker).kill()
        wait_until_gone(worker)
        service.preload(problem.system, problem.scheme)
        with pytest.raises(SolverCrash, match="the solver process died"):
            solve(service, (problem, guess))
        assert solve(service, (problem, guess)).success
