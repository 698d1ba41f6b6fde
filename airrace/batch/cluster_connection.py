"""The connection to a scheduler of dask.distributed and to those of its workers that can fly.

All that is asked of the library is asked here. Any: `distributed` has few annotations.
"""

import asyncio
import logging
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any, cast

import dask.config
from distributed import Client
from distributed import Event as Flag
from distributed.comm.core import connect  # pyright: ignore[reportUnknownVariableType]  (few annotations)
from distributed.security import Security

from airrace.errors import ClusterError

CONNECT = 4.0
"""The time in which the scheduler must be reached, s."""
REPLY = 5.0
"""The time in which a scheduler or a worker must answer, s."""

_log = logging.getLogger(__name__)


class Connection:
    """A connection to a scheduler whose workers all fitted when it was reached.

    Args:
        address: the address of the scheduler, e.g. `tcp://head:8786`.
        versions: the versions of airrace and of what its numbers depend on, by name. Workers with others get no jobs.

    Raises:
        ClusterError: the scheduler cannot be reached, or it or a worker lacks airrace or has other versions.
    """

    def __init__(self, address: str, versions: Mapping[str, str]) -> None:
        self.address = address
        self._versions = versions
        self._client = _client_of(address)
        self._fitting: dict[str, bool] = {}
        self._warned: set[str] = set()
        try:
            self._refuse_misfits()
        except BaseException:
            self.close()
            raise

    def threads(self) -> Mapping[str, int]:
        """Return the number of threads of each fitting worker, by its address.

        Raises:
            Exception: the scheduler does not answer.
        """
        known: Mapping[str, int] = self._client.nthreads(callback_timeout=REPLY)
        self._fitting = {one: fits for one, fits in self._fitting.items() if one in known}
        for worker, misfit in self._misfits([one for one in known if one not in self._fitting]).items():
            self._fitting[worker] = not misfit
            if misfit and misfit not in self._warned:
                self._warned.add(misfit)
                _log.warning("worker %s gets no jobs: it has %s", worker, misfit)
        return {worker: number for worker, number in known.items() if self._fitting.get(worker, False)}

    def submit(self, function: Callable[..., Any], argument: Any, *, key: str, workers: Sequence[str]) -> Any:
        """Submit a task that dask repeats only if its worker dies, and return its future."""
        with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 GiB"}):  # a checkpoint is large
            return self._client.submit(
                function, argument, key=key, pure=False, retries=0, workers=list(workers), allow_other_workers=False
            )

    def call(self, function: Callable[..., Any], *arguments: Any, workers: Sequence[str]) -> Mapping[str, Any]:
        """Call a function in the processes of workers, beside their tasks, and return its results by address.

        Raises:
            Exception: they do not answer in time.
        """
        return self._client.run(function, *arguments, workers=list(workers), on_error="ignore", callback_timeout=REPLY)

    def forget(self, future: Any, key: str) -> None:
        """Release a task that is done, and the mark that it was begun."""
        future.release()
        Flag(key, client=self._client).clear()

    def cancel(self, futures: Sequence[Any]) -> None:
        """Cancel tasks, queued or running."""
        self._client.cancel(list(futures))

    def listen(self, topic: str, hear: Callable[[Any], None]) -> None:
        """Pass on everything that workers report under a topic; `hear` is called in another thread."""

        def heard(event: tuple[float, Any]) -> None:
            hear(event[1])

        self._client.subscribe_topic(topic, heard)

    def close(self) -> None:
        """Close the connection; the scheduler cancels tasks that are under way."""
        self._client.close(timeout=REPLY)

    def _refuse_misfits(self) -> None:
        """Check the versions of the scheduler and of all its workers.

        With a cluster that was set up wrongly nothing is begun.
        """
        try:
            try:
                own = self._client.run_on_scheduler(version, "airrace", callback_timeout=REPLY)
            except PackageNotFoundError:
                raise ClusterError(f"the scheduler {self.address} has no airrace, which it needs as well") from None
            if own != self._versions["airrace"]:
                raise ClusterError(
                    f"the scheduler {self.address} has airrace {own}, here is {self._versions['airrace']}"
                )
            for worker, misfit in self._misfits(list(self._client.nthreads(callback_timeout=REPLY))).items():
                if misfit:
                    raise ClusterError(f"worker {worker} of {self.address} has {misfit}")
                self._fitting[worker] = True
        except ClusterError:
            raise
        except Exception as error:  # any error of the library
            raise ClusterError(f"the scheduler {self.address} does not answer as it should: {words(error)}") from error

    def _misfits(self, workers: Sequence[str]) -> Mapping[str, str]:
        """Return what is wrong with each of these workers, empty if nothing is.

        Workers that do not answer are left out.
        """
        if not workers:
            return {}
        found = dict.fromkeys(workers, "")
        for name, here in self._versions.items():
            answers = self._client.run(version, name, workers=list(workers), on_error="return", callback_timeout=REPLY)
            for worker in list(found):
                there = answers.get(worker)
                if isinstance(there, PackageNotFoundError):
                    found[worker] = found[worker] or f"no {name}"
                elif not isinstance(there, str):
                    del found[worker]
                elif there != here:
                    found[worker] = found[worker] or f"{name} {there}, here is {here}"
        return found


def words(error: BaseException) -> str:
    """Return an error of a library in one line of at most 300 characters."""
    return " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")[:300]


def _client_of(address: str) -> Any:
    for name in [one for one in logging.root.manager.loggerDict if one.partition(".")[0] == "distributed"]:
        logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported as the end of a job
    try:
        asyncio.run(asyncio.wait_for(_shake_hands(address), CONNECT))
        return Client(address, timeout=CONNECT, set_as_default=False, name="airrace")
    except TimeoutError as error:
        raise ClusterError(f"cannot reach the scheduler {address}: no answer within {CONNECT:g} s") from error
    except Exception as error:  # any error of the library: no such host, no answer, not an address
        raise ClusterError(f"cannot reach the scheduler {address}: {words(error)}") from error


async def _shake_hands(address: str) -> None:
    """Find out whether a scheduler is there at all.

    A client would wait for ever for one that listens and is silent.
    """
    security: Any = Security()
    comm = await cast(Any, connect)(address, timeout=CONNECT, **security.get_connection_args("client"))
    await comm.close()
