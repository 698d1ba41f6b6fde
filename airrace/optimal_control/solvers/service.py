"""The service of a solver process: it starts the process, hands it problems, watches it and stops it.

A solver may spend minutes in one call, or never come back from a bad guess, so it lives in a process that can be killed
at any moment. One process serves a whole run.
"""

import contextlib
import math
import pickle
import queue
import subprocess
import threading
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import TracebackType
from typing import Self, TypeVar

from airrace.errors import OutOfTime, SolverCrash
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.solvers import acquire, messages
from airrace.optimal_control.solvers.interface import Multipliers, SolverOptions
from airrace.optimal_control.solvers.messages import IterationReport, Reply
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.optimal_control.system import Observation, System
from airrace.runtime.process import SYSTEM_ERROR

STALL_SECONDS = 120.0
"""The longest time that a solver may spend on one iteration before it is considered to hang, s.

An iteration that hangs never ends. Of those that end, the slowest of the problems with known answers takes 0.5 s (that
of the soaring glider on 800 intervals, evaluated by casadi), and those of a whole six-dof race with native kernels
less; the rest is for slower machines and for setting a large problem up, which counts into the first iteration.
"""


class SolverTimeout(Exception):
    """The error of a solver that has finished no iteration for too long and was stopped."""


class SolverEnded(SolverCrash):
    """The error of a solver process that was ended on purpose."""

    def __init__(self) -> None:
        super().__init__("the solver process was ended")


class SolverService:
    """A solver process; a context manager that leaves no process behind.

    Args:
        threads: threads that evaluate derivatives.
        stall_seconds: longest wait for the next iteration before the process is stopped and restarted.
        deadline: the time, by `time.monotonic`, after which nothing is solved any more.
        on_notice: called with what the process does besides solving.
        prepared_intervals: of all problems that the process keeps ready to be solved again.
    """

    def __init__(
        self,
        *,
        threads: int = 1,
        stall_seconds: float = STALL_SECONDS,
        deadline: float = math.inf,
        on_notice: Callable[[str], None] | None = None,
        prepared_intervals: int = messages.PREPARED_INTERVALS,
    ) -> None:
        self._on_notice = on_notice
        self._prepared_intervals = prepared_intervals
        self._threads = threads
        self._stall_seconds = stall_seconds
        self._deadline = deadline
        self._process: subprocess.Popen[bytes] | None = None
        self._starter = 0  # the thread that has started the process, with which the process ends on Linux
        self._ended = False
        self._stopping = threading.Lock()
        self._solving = False
        self._deferred: list[Callable[[], None]] = []
        self._start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def preload(
        self, system: System, scheme: RungeKutta = Problem.scheme, observed: Sequence[Observation] = ()
    ) -> None:
        """Let the process make the kernels of the system of a coming problem ready, and of what is observed of it.

        Queued while a solve is running: the worker does not read its input then, and a full pipe would deadlock.
        """
        if self._process is not None:
            self._sender.pack(
                messages.PreloadRequest(system, scheme, tuple(observation.values for observation in observed))
            )
            if not self._solving:
                self._deliver()

    def _deliver(self) -> None:
        """Send what waits; the next solve finds out where the process is dead or was ended."""
        with contextlib.suppress(OSError, ValueError):
            self._sender.deliver()

    def defer(self, call: Callable[[], None]) -> None:
        """Put a call off until the process works on the next problem, while this one would only wait.

        It is made once, by the thread that waits, and its errors are those of `solve`.
        """
        self._deferred.append(call)

    def solve(
        self,
        problem: Problem,
        guess: Iterate,
        *,
        solver: str,
        options: SolverOptions,
        multipliers: Multipliers | None = None,
        on_iteration: Callable[[IterationReport], None] | None = None,
        threads: int | None = None,
        stall_seconds: float | None = None,
    ) -> ProgramSolution:
        """Solve a problem in the solver process.

        Args:
            threads, stall_seconds: for this solve; None for those of the service.

        Raises:
            SolverTimeout: no iteration was finished for `stall_seconds`; the process was restarted.
            OutOfTime: the deadline has passed; the process was stopped.
            SolverEnded: `end` was called, before the solve or meanwhile.
            MemoryError: the process ended for lack of memory.
            SolverCrash: the process died, or could not work on the request.
        """
        if self._process is None:
            self._start()
        request = messages.SolveRequest(
            problem, guess, multipliers, solver, options, threads or self._threads, self._prepared_intervals
        )
        try:
            with self._diagnose_death():
                self._sender.send(request)
            self._solving = True
            try:
                while self._deferred:
                    self._deferred.pop(0)()
                solution = self._solution(stall_seconds or self._stall_seconds, on_iteration)
            finally:
                self._solving = False
            self._deliver()
        except BaseException:  # an interrupt, or an error of the listener, leaves the process in mid-solve: it is of no
            self.stop()  # more use
            raise
        return solution

    def _solution(self, timeout: float, on_iteration: Callable[[IterationReport], None] | None) -> ProgramSolution:
        """Return the solution of the request that the process works on."""
        while True:
            with self._diagnose_death():
                reply = self._receive(timeout)
            if isinstance(reply, ProgramSolution):
                return reply
            if isinstance(reply, messages.WorkerFailure):
                raise SolverCrash(f"the solver process failed:\n{reply.text}")
            if isinstance(reply, messages.Notice):
                if self._on_notice is not None:
                    self._on_notice(reply.text)
            elif on_iteration is not None:
                on_iteration(reply)

    @contextlib.contextmanager
    def _diagnose_death(self) -> Generator[None]:
        """Turn errors of the pipes into the one that the process is dead; of nothing else."""
        try:
            yield
        except (OSError, EOFError, pickle.UnpicklingError) as error:
            process, status = self._process, None
            if process is not None:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(0.5)  # s to end by itself, so that its exit code gives the reason
                process.kill()  # without its pipes it is of no use
                status = process.wait()
            if self._ended:
                raise SolverEnded from error
            if status == SYSTEM_ERROR:
                raise MemoryError from error
            raise SolverCrash(f"the solver process died (status {status})", status) from error

    def stop(self) -> None:
        """Kill the process, if there is one; the next solve starts another."""
        with self._stopping:
            if self._process is not None:
                self._process.kill()
                self._process.wait()
                with contextlib.suppress(OSError):
                    self._sender.stream.close()
                self._process = None

    def end(self) -> None:
        """Kill the process, and start no other."""
        self._ended = True
        self.stop()

    def stop_unless_started_here(self) -> None:
        """Kill a process that another thread has started: it would die, at any moment, with that thread."""
        if self._starter != threading.get_ident():
            self.stop()

    def _start(self) -> None:
        if self._ended:
            raise SolverEnded
        worker = acquire()
        assert worker.stdin is not None  # it was started with both
        assert worker.stdout is not None
        with self._stopping:
            self._process = worker
            self._sender = messages.Sender(worker.stdin)
            self._replies = messages.Inbox(worker.stdout, partial(pickle.load, worker.stdout)).start()
            self._starter = threading.get_ident()
        if self._ended:  # meanwhile
            self.stop()
            raise SolverEnded

    def _receive(self, timeout: float) -> Reply:
        """Return the next reply, waited for so many seconds at most, and not beyond the deadline.

        Time in which this process itself stood still is none in which the solver could have worked, so no part of the
        waiting counts for more than it was meant to take.
        """
        left = timeout
        while True:
            part = max(0.0, min(left, 1.0, self._deadline - time.monotonic()))  # s
            try:
                return self._replies.next(part)
            except queue.Empty:
                left -= part
                if time.monotonic() >= self._deadline:
                    raise OutOfTime("there is no time left") from None
                if left <= 0.0:
                    raise SolverTimeout(f"no iteration finished within {timeout:g} s") from None


Job = TypeVar("Job")
Done = TypeVar("Done")


class SolverPool:
    """Solver processes side by side, for jobs that do not depend on one another.

    It is a context manager that ends all of them after an error. The result of a job does not depend on who does it,
    nor on how many there are.
    """

    def __init__(self, services: Sequence[SolverService]) -> None:
        self._services = services
        self._free: queue.SimpleQueue[SolverService] = queue.SimpleQueue()
        for service in services:
            self._free.put(service)
        self._pool = ThreadPoolExecutor(len(services), thread_name_prefix="pool")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)  # first, or a process that is ended would be given a job
        if error is not None:  # which may leave any of them in mid-solve
            for service in self._services:
                service.end()
        self._pool.shutdown()
        for service in self._services:
            service.stop_unless_started_here()

    def work(self, jobs: Sequence[Job], do: Callable[[SolverService, Job], Done]) -> list[Done]:
        """Do all jobs and return their results in order; an error is that of the first job that has one."""

        def run_job(job: Job) -> Done:
            service = self._free.get()
            try:
                return do(service, job)
            finally:
                self._free.put(service)

        futures = [self._pool.submit(run_job, job) for job in jobs]
        return [future.result() for future in futures]
