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

    It is a context manager that ends those processes that it has started, and all of them after an error. The result of
    a job does not depend on who does it, nor on how many there are.

    Args:
        service: a process that exists already and is one of the pool.
        size: how many there are in all.
        make: starts another process.
    """

    def __init__(self, service: SolverService, size: int, make: Callable[[], SolverService]) -> None:
        self._own, self._added = service, list[SolverService]()
        try:
            for _ in range(size - 1):
                self._added.append(make())
        except BaseException:
            self._end_added()
            raise
        self._free: queue.SimpleQueue[SolverService] = queue.SimpleQueue()
        for one in (service, *self._added):
            self._free.put(one)
        self._pool = ThreadPoolExecutor(size, thread_name_prefix="pool")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)  # first, or a process that is ended would be given a job
        self._end_added()
        if error is not None:  # which may leave any of them in mid-solve
            self._own.end()
        self._pool.shutdown()
        self._own.stop_unless_started_here()

    def _end_added(self) -> None:
        for service in self._added:
            service.end()

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
