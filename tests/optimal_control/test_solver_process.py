"""The solver process: service, worker, messages, and a solve from Python."""

import contextlib
import io
import multiprocessing
import os
import pickle
import queue
import subprocess
import sys
import textwrap
import threading
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from known_flights import oscillator, rest_to_rest
from waiting import has_passed, instant, wait_until_gone

from airrace.errors import OutOfTime, SolverCrash
from airrace.optimal_control import program_call as module
from airrace.optimal_control.kernels import Kernels, build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Iterate, Objective, Problem
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.solve_problem import solve
from airrace.optimal_control.solvers import start
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.messages import (
    Inbox,
    IterationReport,
    Notice,
    PreloadRequest,
    Receiver,
    Sender,
    SolveRequest,
)
from airrace.optimal_control.solvers.service import SolverService, SolverTimeout
from airrace.optimal_control.solvers.solver import SOLVERS, PreparedProblem, ProgramSolution
from airrace.optimal_control.solvers.worker import ProgressReader, SolveServer
from airrace.optimal_control.system import System

TESTS = Path(__file__).parent
PIPE_BYTES = 2**16
"""What a pipe holds before who writes must wait, on Linux."""
LONGEST_SOLVE = 120.0
"""The time after which a solve is considered to hang, s; it takes less than one."""


def solve_by(
    service: SolverService,
    stated: tuple[Problem, Iterate] | None = None,
    *,
    solver: str = "interior-point",
    on_iteration: Callable[[IterationReport], None] | None = None,
    stall_seconds: float | None = None,
) -> ProgramSolution:
    problem, guess = stated or rest_to_rest()
    options = SolverOptions()
    return service.solve(
        problem, guess, solver=solver, options=options, on_iteration=on_iteration, stall_seconds=stall_seconds
    )


def children(of: int | None = None) -> set[int]:
    return {child.pid for child in psutil.Process(of).children()}


def worker_of(service_started_after: set[int]) -> int:
    (worker,) = children() - service_started_after
    return worker


@pytest.mark.parametrize("solver", ["interior-point", "ipopt"])
def test_solution_and_iterations_come_back(solver: str) -> None:
    reports: list[IterationReport] = []
    with SolverService() as service:
        solution = solve_by(service, solver=solver, on_iteration=reports.append)
    assert solution.success
    assert solution.solver == solver
    assert solution.kkt.largest < 1e-6
    numbers = [report.number for report in reports]
    assert numbers == sorted(numbers)
    assert numbers[-1] == solution.iterations > 1
    assert reports[-1].infeasibility < 1e-6 < reports[0].infeasibility


def test_one_process_serves_all_solves_and_solves_the_same_again() -> None:
    before = children()
    with SolverService() as service:
        worker = worker_of(before)
        first, second = solve_by(service), solve_by(service)
        other = solve_by(service, rest_to_rest(24))
        third = solve_by(service)
        assert worker_of(before) == worker
    wait_until_gone(worker)
    assert children() == before
    for again in (second, third):
        assert (again.iterate.state == first.iterate.state).all()
        assert (again.objective, again.iterations) == (first.objective, first.iterations)
    assert other.iterate.control.shape == (1, 24)


def test_worker_killed_in_mid_solve_is_a_solver_crash_and_the_next_solve_has_a_new_one() -> None:
    before = children()
    with SolverService() as service:
        first = worker_of(before)
        with pytest.raises(SolverCrash, match="died"):
            solve_by(service, rest_to_rest(60_000), on_iteration=lambda _: psutil.Process(first).kill())
        wait_until_gone(first)
        assert solve_by(service).success
        assert worker_of(before) != first


def test_worker_that_finishes_no_iteration_is_stopped_and_replaced() -> None:
    before = children()
    with SolverService() as service:
        solve_by(service)  # by now everything is loaded
        first = worker_of(before)
        with pytest.raises(SolverTimeout, match="no iteration finished within 4 s"):
            solve_by(
                service, rest_to_rest(60_000), on_iteration=lambda _: psutil.Process(first).suspend(), stall_seconds=4.0
            )
        wait_until_gone(first)
        assert solve_by(service).success


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
        assert solve_by(service).success
    assert len(stopped) == 1


def test_stall_is_noticed_although_the_worker_is_busy() -> None:
    with SolverService(stall_seconds=0.01) as service, pytest.raises(SolverTimeout):
        solve_by(service, rest_to_rest(400))


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
            solve_by(service)
    assert told == ["casadi evaluates it, slower"]


def test_nothing_is_solved_after_the_deadline_and_no_process_is_left() -> None:
    before = children()
    deadline = instant(1.5)
    service = SolverService(deadline=deadline)
    problem = rest_to_rest(200_000)  # which takes longer
    with pytest.raises(OutOfTime):
        solve_by(service, problem)
    assert has_passed(deadline)
    assert children() == before
    with pytest.raises(OutOfTime):
        solve_by(service)


def test_interrupt_in_mid_solve_leaves_no_process() -> None:
    def interrupt(_: IterationReport) -> None:
        raise KeyboardInterrupt

    before = children()
    service = SolverService()
    worker = worker_of(before)
    with pytest.raises(KeyboardInterrupt):
        solve_by(service, on_iteration=interrupt)
    wait_until_gone(worker)
    assert children() == before


@pytest.mark.parametrize("deferred", [True, False])
def test_an_error_of_a_listener_or_a_deferred_call_is_its_own_and_leaves_no_process(deferred: bool) -> None:
    """A pipe that is broken behind a callback is none of the service's."""

    def refuse(*_: object) -> None:
        raise BrokenPipeError("the reader has gone")

    before = children()
    with SolverService() as service:
        worker = worker_of(before)
        if deferred:
            service.defer(refuse)
        with pytest.raises(BrokenPipeError, match="the reader has gone"):
            solve_by(service, on_iteration=None if deferred else refuse)
        wait_until_gone(worker)
        assert solve_by(service).success


def test_what_is_put_off_is_done_once_before_the_next_solution_is_waited_for() -> None:
    done: list[str] = []
    with SolverService() as service:
        service.defer(lambda: done.append("first"))
        service.defer(lambda: done.append("second"))
        assert not done
        solve_by(service, on_iteration=lambda _: done.append("iteration"))
        assert done[:3] == ["first", "second", "iteration"]
        done.clear()
        solve_by(service)
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
            solution = solve_by(service, (problem, guess))
        finally:
            watchdog.cancel()
        assert len(pickle.dumps(solution)) > PIPE_BYTES
        assert solve_by(service).success


def test_request_that_cannot_be_worked_on_is_a_solver_crash_that_says_why() -> None:
    with SolverService() as service:
        with pytest.raises(SolverCrash, match="no such solver"):
            solve_by(service, solver="no such solver")
        assert solve_by(service).success


def test_contradicting_bounds_are_an_answer() -> None:
    problem, guess = rest_to_rest()
    (phase,) = problem.phases
    narrow = replace(problem, phases=(replace(phase, duration=replace(phase.duration, lower=9.5)),))
    with SolverService() as service:
        solution = solve_by(service, (narrow, guess))
    assert not solution.success
    assert solution.infeasible


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone ends a process with its parent")
def test_worker_dies_with_its_parent_even_where_it_cannot_notice() -> None:
    program = f"""
        import os, sys
        sys.path.insert(0, {str(TESTS)!r})
        from known_flights import rest_to_rest
        from airrace.optimal_control.solvers.service import SolverService
        from airrace.optimal_control.solvers.interface import SolverOptions
        service = SolverService()
        problem, guess = rest_to_rest()
        service.solve(problem, guess, solver="interior-point", options=SolverOptions())
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
    request = SolveRequest(problem, guess, None, "interior-point", SolverOptions(), 1)
    assert server.solve(request).success
    assert built == [problem.system]


def kernels_that_are_built(monkeypatch: pytest.MonkeyPatch) -> list[System]:
    """The systems whose kernels a server has made so far."""
    made: list[System] = []

    def watched(system: System, scheme: RungeKutta) -> Kernels:
        made.append(system)
        return build_kernels(system, scheme)

    monkeypatch.setattr("airrace.optimal_control.solvers.worker.build_kernels", watched)
    return made


def test_a_process_that_died_is_announced_to_in_vain_and_reported_by_the_next_solve() -> None:
    problem, guess = rest_to_rest()
    before = children()
    with SolverService() as service:
        worker = worker_of(before)
        psutil.Process(worker).kill()
        wait_until_gone(worker)
        service.preload(problem.system, problem.scheme)
        with pytest.raises(SolverCrash, match="the solver process died"):
            solve_by(service, (problem, guess))
        assert solve_by(service, (problem, guess)).success


LONGEST = 60.0
"""The time after which a reply is considered to be lost, s; it takes less than one."""


class Replies:
    def __init__(self) -> None:
        self.sent: list[Any] = []

    def send(self, reply: Any) -> None:
        self.sent.append(reply)


def read(text: str, *, piece: int = 1000) -> list[Any]:
    replies = Replies()
    reader = ProgressReader(replies, 0.0)  # type: ignore[arg-type]  (only its `send` is used)
    for place in range(0, len(text), piece):
        reader.write(text[place : place + piece])
    return replies.sent


OWN = """   0 -7.60514286e+00 1.47e+00 interior point
   9 -2.12842594e+01 4.22e+01 interior point
"""
IPOPT = """iter    objective    inf_pr   inf_du lg(mu)  ||d||  lg(rg) alpha_du alpha_pr  ls
   1  5.5123456e+01 2.00e-01 2.78e+07   0.6 5.98e-01   4.4 1.02e-01 1.47e-01h  1
 279r-2.8609775e-02 3.78e+02 2.78e+07   0.6 5.98e-01   4.4 1.02e-01 1.47e-01h  1
 280r 2.8657715e-02 2.95e+02 2.16e+07   0.6 2.51e-01   4.9 1.74e-01 2.94e-01h  1
"""


@pytest.mark.parametrize("piece", [1000, 7, 1])
def test_iterations_of_both_solvers_are_reported_however_they_arrive(piece: int) -> None:
    assert read(OWN, piece=piece) == [IterationReport(0, -7.60514286, 1.47), IterationReport(9, -21.2842594, 42.2)]
    assert read(IPOPT, piece=piece) == [
        IterationReport(1, 55.123456, 0.2),
        IterationReport(279, -0.028609775, 378.0),
        IterationReport(280, 0.028657715, 295.0),
    ]


def test_the_last_of_many_iterations_is_reported_once_and_those_between_are_not() -> None:
    replies = Replies()
    reader = ProgressReader(replies, 1e9)  # type: ignore[arg-type]  (only its `send` is used)
    reader.write(IPOPT)
    assert [one.number for one in replies.sent] == [1]
    reader.report()
    reader.report()
    assert [one.number for one in replies.sent] == [1, 280]


def test_all_else_that_solvers_print_is_dropped() -> None:
    summary = "Number of Iterations....: 12\n  compute search dir                    0.009899\n1.0e+00 1.0e+00 \n"
    assert read(summary + "nlp_f                                   0.016844   57.7%\n") == []


def test_worker_ends_in_mid_solve_when_nobody_is_left_to_answer() -> None:
    problem, guess = rest_to_rest(200_000)
    worker = start()
    assert worker.stdin is not None
    assert worker.stdout is not None
    sender, replies = Sender(worker.stdin), Inbox(worker.stdout, partial(pickle.load, worker.stdout)).start()
    sender.send(SolveRequest(problem, guess, None, "interior-point", SolverOptions(), 1))
    heard = [replies.next(LONGEST)]
    sender.stream.close()
    assert worker.wait(LONGEST) == 0
    with contextlib.suppress(EOFError):
        while True:
            heard.append(replies.next(LONGEST))
    assert {type(reply) for reply in heard} == {IterationReport}


def request(problem: Problem, guess: Iterate) -> SolveRequest:
    return SolveRequest(problem, guess, None, "interior-point", SolverOptions(), 1)


def test_requests_arrive_as_they_were_sent_and_functions_once() -> None:
    problem, guess = rest_to_rest()
    stream = io.BytesIO()
    sender = Sender(stream)
    sender.pack(PreloadRequest(problem.system, problem.scheme))  # waits for the next
    assert stream.tell() == 0
    sender.send(request(problem, guess))
    sizes = [stream.tell()]
    sender.deliver()
    states = tuple(replace(one, lower=-9.0) for one in problem.system.states)
    for system in (problem.system, problem.system, replace(problem.system, states=states), oscillator()):
        sender.send(request(replace(problem, system=system), guess))
        sizes.append(stream.tell())
    assert np.ptp(np.diff(sizes)[:3]) < 20 < np.diff(sizes)[0] < sizes[0] - 1000
    stream.seek(0)
    receiver = Receiver(stream)
    announced, received, *others = (receiver.receive() for _ in range(6))
    assert isinstance(announced, PreloadRequest)
    assert isinstance(received, SolveRequest)
    assert announced.scheme == problem.scheme
    assert replace(received.problem, system=problem.system) == problem
    assert received.problem.system.states == problem.system.states
    assert (received.guess.state == guess.state).all()
    x, u, p = np.array([0.3, -1.0]), np.array([2.0]), np.array(problem.parameters)
    assert (np.asarray(received.problem.system.rates(x, u, p)) == np.asarray(problem.system.rates(x, u, p))).all()
    for one in (received, *others):  # equal functions arrive as one object, whatever else the system is
        assert isinstance(one, SolveRequest)
        assert one.problem.system.rates is announced.system.rates
        assert one.problem.system.path_values is announced.system.path_values
    assert receiver.receive() is None


ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_answer_is_that_of_a_solver_in_this_process(solver: str) -> None:
    problem, guess = rest_to_rest()
    kernels = build_kernels(problem.system, problem.scheme)
    here = PreparedProblem(Layout(problem), kernels, solver, SolverOptions(), 1).solve(Layout(problem), guess)
    there = solve(problem, guess, solver=solver)
    assert there.success
    assert (there.status, there.iterations, there.objective) == (here.status, here.iterations, here.objective)
    assert (there.iterate.state == here.iterate.state).all()


def test_nothing_is_printed_and_the_options_are_the_solvers(capfd: pytest.CaptureFixture[str]) -> None:
    assert solve(*rest_to_rest()).success
    hasty = solve(*rest_to_rest(), options=SolverOptions(iterations_max=2))
    assert not hasty.success
    assert hasty.iterations <= 3
    assert capfd.readouterr().out == ""


def test_a_problem_that_means_something_else_is_refused_here() -> None:
    problem, guess = rest_to_rest()
    with pytest.raises(ValueError, match="unknown states or controls: g"):
        solve(replace(problem, objective=Objective(regularisation={"g": 1.0})), guess)


def test_a_solver_that_does_not_exist_is_an_error_and_no_end() -> None:
    with pytest.raises(SolverCrash, match="no such solver"):
        module.solve_program(*rest_to_rest(), solver="no such solver")
    assert solve(*rest_to_rest()).success


def test_a_solve_without_an_iteration_is_a_failed_one(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, guess = rest_to_rest()

    def stalls(*_: object, stall_seconds: float, **__: object) -> None:
        raise SolverTimeout(f"no iteration finished within {stall_seconds:g} s")

    monkeypatch.setattr(SolverService, "solve", stalls)
    solution = solve(problem, guess, stall_seconds=7.0)
    assert not solution.success
    assert not solution.infeasible
    assert solution.status == "no iteration finished within 7 s"
    assert solution.iterate is guess
    assert np.isnan([solution.objective, solution.kkt.largest]).all()
    assert solution.multipliers.constraints.shape == (Layout(problem).constraints,)


def test_threads_take_turns_and_leave_a_process_that_serves() -> None:
    """On Linux the process ends with the thread that has started it."""
    module._stop()
    found: list[bool] = []
    threads = [threading.Thread(target=lambda: found.append(solve(*rest_to_rest()).success)) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [True] * 3
    assert solve(*rest_to_rest()).success


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a system without fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")  # of Python 3.12 and later, about threads
def test_a_process_that_forks_leaves_its_solver_alone() -> None:
    assert solve(*rest_to_rest()).success
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply(_succeeds)
    assert solve(*rest_to_rest()).success


def _succeeds() -> bool:
    return solve(*rest_to_rest()).success


def test_the_solver_process_ends_with_this_one() -> None:
    script = textwrap.dedent("""
        import os, sys
        sys.path.insert(0, sys.argv[1])
        from known_flights import rest_to_rest
        from airrace.optimal_control import program_call as module
        assert module.solve_program(*rest_to_rest()).success
        service = module._SERVICES[os.getpid()]
        print(service._process.pid)
    """)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", script, str(Path(__file__).parent)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    assert not Path(f"/proc/{done.stdout.strip()}").exists()
