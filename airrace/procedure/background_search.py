"""A search beside the stages: in a thread and a solver process of its own, or afterwards where there is one thread."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Generic, Self, TypeVar

from airrace.optimal_control.solvers.process.service import SolverService
from airrace.procedure.multistart.solver_pool import SolverPool

Found = TypeVar("Found")


class BackgroundSearch(Generic[Found]):
    """A search whose result is asked for later, the same whenever and wherever it is made.

    It is a context manager; what is still searched for at its end is given up.

    Args:
        search: what is searched for, with a pool to solve what it needs.
        pool: makes the pool that searches when the result is asked for.
        make: starts the solver process of a search that begins at once; None to wait until the result is asked for.
    """

    def __init__(
        self,
        search: Callable[[SolverPool], Found],
        pool: Callable[[], SolverPool],
        make: Callable[[], SolverService] | None,
    ) -> None:
        self._search, self._crew, self._make = search, pool, make
        self._service: SolverService | None = None
        self._pool: ThreadPoolExecutor | None = None
        self._future: Future[Found] | None = None

    def __enter__(self) -> Self:
        if self._make is not None:
            self._service = self._make()
            self._pool = ThreadPoolExecutor(1, thread_name_prefix="aside")
            self._future = self._pool.submit(self._searched, SolverPool(self._service, 1, self._make))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._service is not None:
            self._service.end()
        if self._pool is not None:
            self._pool.shutdown()

    @property
    def running(self) -> bool:
        """Whether it is searched beside what else is done, and nothing is found yet."""
        return self._future is not None and not self._future.done()

    def result(self) -> Found:
        """Return what was found.

        Raises:
            SolverCrash: the solver process died.
        """
        return self._searched(self._crew()) if self._future is None else self._future.result()

    def _searched(self, pool: SolverPool) -> Found:
        with pool:
            return self._search(pool)
