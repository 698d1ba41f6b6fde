"""The messages between a process and its solver process, and how they travel.

Systems and observations are large and few: they are sent once and then named, by `Sender` and `Receiver`.
"""

import hashlib
import io
import pickle
import queue
import threading
from collections.abc import Callable
from typing import IO, Any

from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.solvers.solver import Multipliers, Solution, SolverOptions
from airrace.records import record
from airrace.system import Observation, System


@record
class SolveRequest:
    """A request to solve `problem` from `guess`."""

    problem: Problem
    guess: Iterate
    multipliers: Multipliers | None
    solver: str
    options: SolverOptions
    threads: int


@record
class PreloadRequest:
    """A system that will be flown, whose kernels can be made ready. It has no answer."""

    system: System
    scheme: RungeKutta


@record
class IterationReport:
    """A line of a solver's progress: iteration, objective, largest scaled infeasibility."""

    number: int
    objective: float
    infeasibility: float


@record
class Notice:
    """A text for people on what the worker does besides solving."""

    text: str


@record
class WorkerFailure:
    """An answer that a request could not be worked on; a bug, not a failed solve."""

    text: str


Reply = IterationReport | Notice | Solution | WorkerFailure


@record
class _Definition:
    """A shared object under the name by which later messages refer to it."""

    name: str
    shared: System | Observation


class _Pickler(pickle.Pickler):
    def __init__(self, stream: IO[bytes], names: dict[int, str]) -> None:
        super().__init__(stream, protocol=pickle.HIGHEST_PROTOCOL)
        self._names = names

    def persistent_id(self, obj: Any) -> str | None:  # Any: pickle offers every object it meets
        return self._names.get(id(obj)) if isinstance(obj, System | Observation) else None


class _Unpickler(pickle.Unpickler):
    def __init__(self, stream: IO[bytes], shared: dict[str, System | Observation]) -> None:
        super().__init__(stream)
        self._shared = shared

    def persistent_load(self, pid: str) -> System | Observation:
        return self._shared[pid]


class Sender:
    """A writer of messages, which sends every System and Observation once."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._packed: list[bytes] = []
        self._names: dict[int, str] = {}
        self._kept: list[System | Observation] = []  # keeps the ids valid

    def send(self, message: SolveRequest | PreloadRequest) -> None:
        """Write one message, after those that wait.

        Raises:
            OSError: the other side is gone.
            ValueError: the stream is closed.
        """
        self.pack(message)
        self.deliver()

    def pack(self, message: SolveRequest | PreloadRequest) -> None:
        """Get a message ready that is to wait until `deliver`."""
        for shared in _shared(message):
            if id(shared) not in self._names:
                self._define(shared)
        self._pack(message)

    def deliver(self) -> None:
        """Write the messages that wait, if any.

        Raises:
            OSError: the other side is gone.
            ValueError: the stream is closed.
        """
        while self._packed:
            self._stream.write(self._packed.pop(0))
            self._stream.flush()

    def close(self) -> None:
        """Close the stream."""
        self._stream.close()

    def _define(self, shared: System | Observation) -> None:
        content = pickle.dumps(shared, protocol=pickle.HIGHEST_PROTOCOL)
        name = hashlib.sha256(content).hexdigest()
        self._pack(_Definition(name, shared))
        self._names[id(shared)] = name
        self._kept.append(shared)

    def _pack(self, message: SolveRequest | PreloadRequest | _Definition) -> None:
        buffer = io.BytesIO()
        _Pickler(buffer, self._names).dump(message)
        self._packed.append(buffer.getvalue())


def _shared(message: SolveRequest | PreloadRequest) -> list[System | Observation]:
    if isinstance(message, PreloadRequest):
        return [message.system]
    problem = message.problem
    exact = [watch.exact for phase in problem.phases for watch in phase.watches if watch.exact is not None]
    return [problem.system, *problem.observations, *exact]


class Receiver:
    """A reader of messages, in which equal Systems and Observations arrive as the same object."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._shared: dict[str, System | Observation] = {}

    def receive(self) -> SolveRequest | PreloadRequest | None:
        """Return the next message; None at the end of the stream."""
        while True:
            try:
                message = _Unpickler(self._stream, self._shared).load()
            except EOFError:
                return None
            if isinstance(message, _Definition):
                self._shared.setdefault(message.name, message.shared)
            else:
                return message


class Outbox:
    """A writer of replies."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._writing = threading.Lock()

    def send(self, reply: Reply) -> None:
        """Write a reply.

        Raises:
            OSError: the other side is gone.
        """
        content = pickle.dumps(reply, protocol=pickle.HIGHEST_PROTOCOL)
        with self._writing:
            self._stream.write(content)
            self._stream.flush()


class Inbox:
    """The messages of a stream, read by a thread: on every system one can wait for it with patience.

    Args:
        stream: is closed when it has ended.
        receive: reads the next message from it; its first error is the end, and arrives as well.
    """

    def __init__(self, stream: IO[bytes], receive: Callable[[], Any]) -> None:  # Any: whatever arrives
        self._arrived: queue.SimpleQueue[Any] = queue.SimpleQueue()
        threading.Thread(target=self._read, args=(stream, receive), daemon=True).start()

    def next(self, patience: float | None = None) -> Any:  # Any: see above
        """Return the next message, waited for `patience` seconds at most (None: for ever).

        Raises:
            queue.Empty: there is none yet.
            Exception: that of `receive`, once all messages were returned.
        """
        message = self._arrived.get(timeout=patience)
        if isinstance(message, Exception):
            self._arrived.put(message)
            raise message
        return message

    def _read(self, stream: IO[bytes], receive: Callable[[], Any]) -> None:
        with stream:
            try:
                while True:
                    self._arrived.put(receive())
            except Exception as error:
                self._arrived.put(error)
