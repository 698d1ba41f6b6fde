"""A pool: several solver processes side by side, for solves that do not depend on one another."""

import queue
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Self, TypeVar

from airrace.optimal_control.solvers.process.service import SolverService

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
        for one in services:
            self._free.put(one)
        self._pool = ThreadPoolExecutor(len(services), thread_name_prefix="pool")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)  # first, or a process that is ended would be given a job
        if error is not None:  # which may leave any of them in mid-solve
            for one in self._services:
                one.end()
        self._pool.shutdown()
        for one in self._services:
            one.stop_unless_started_here()

    def work(self, jobs: Sequence[Job], do: Callable[[SolverService, Job], Done]) -> list[Done]:
        """Do all jobs and return their results in order; an error is that of the first job that has one."""

        def one(job: Job) -> Done:
            service = self._free.get()
            try:
                return do(service, job)
            finally:
                self._free.put(service)

        futures = [self._pool.submit(one, job) for job in jobs]
        return [future.result() for future in futures]
