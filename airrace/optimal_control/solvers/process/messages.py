"""The messages between a process and its solver process, and how they travel.

Systems and observations are large and few: they are sent once and then named, by `Sender` and `Receiver`.
"""

import hashlib
import io
import pickle
import queue
import threading
from collections.abc import Callable
from typing import IO, Any, Self

from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.solvers.interface import Multipliers, SolverOptions
from airrace.optimal_control.solvers.solver import Solution
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
Shared = System | Observation


@record
class _Definition:
    """A shared object under the name by which later messages refer to it."""

    name: str
    shared: Shared


class _Pickler(pickle.Pickler):
    def __init__(self, stream: IO[bytes], names: dict[int, str]) -> None:
        super().__init__(stream, protocol=pickle.HIGHEST_PROTOCOL)
        self._names = names

    def persistent_id(self, obj: Any) -> str | None:  # Any: pickle offers every object it meets
        return self._names.get(id(obj)) if isinstance(obj, Shared) else None


class _Unpickler(pickle.Unpickler):
    def __init__(self, stream: IO[bytes], shared: dict[str, Shared]) -> None:
        super().__init__(stream)
        self._shared = shared

    def persistent_load(self, pid: str) -> Shared:
        return self._shared[pid]


class Sender:
    """A writer of messages, which sends every System and Observation once.

    Writing raises OSError where the other side is gone, ValueError where the stream is closed.
    """

    def __init__(self, stream: IO[bytes]) -> None:
        self.stream = stream
        self._waiting: list[bytes] = []
        self._names: dict[int, str] = {}
        self._sent: list[Shared] = []  # keeps the ids valid

    def send(self, message: SolveRequest | PreloadRequest) -> None:
        """Write one message, after those that wait."""
        self.pack(message)
        self.deliver()

    def pack(self, message: SolveRequest | PreloadRequest) -> None:
        """Get a message ready that is to wait until `deliver`."""
        shared: list[Shared] = []
        if isinstance(message, PreloadRequest):
            shared.append(message.system)
        else:
            watches = [watch for phase in message.problem.phases for watch in phase.watches]
            exact = [watch.exact for watch in watches if watch.exact is not None]
            shared += [message.problem.system, *message.problem.observations, *exact]
        for one in shared:
            if id(one) not in self._names:
                name = hashlib.sha256(pickle.dumps(one, protocol=pickle.HIGHEST_PROTOCOL)).hexdigest()
                self._pack(_Definition(name, one))
                self._names[id(one)] = name
                self._sent.append(one)
        self._pack(message)

    def deliver(self) -> None:
        """Write the messages that wait, if any."""
        while self._waiting:
            self.stream.write(self._waiting.pop(0))
            self.stream.flush()

    def _pack(self, message: SolveRequest | PreloadRequest | _Definition) -> None:
        buffer = io.BytesIO()
        _Pickler(buffer, self._names).dump(message)
        self._waiting.append(buffer.getvalue())


class Receiver:
    """A reader of messages, in which equal Systems and Observations arrive as the same object."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._shared: dict[str, Shared] = {}

    def receive(self) -> SolveRequest | PreloadRequest | None:
        """Return the next message; None at the end of the stream."""
        while True:
            try:
                message = _Unpickler(self._stream, self._shared).load()
            except EOFError:
                return None
            if not isinstance(message, _Definition):
                return message
            self._shared.setdefault(message.name, message.shared)


class Outbox:
    """A writer of replies."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._lock = threading.Lock()

    def send(self, reply: Reply) -> None:
        """Write a reply.

        Raises:
            OSError: the other side is gone.
        """
        content = pickle.dumps(reply, protocol=pickle.HIGHEST_PROTOCOL)
        with self._lock:
            self._stream.write(content)
            self._stream.flush()


class Inbox:
    """The messages of a stream, read by a thread: on every system one can wait for it with a timeout.

    Args:
        stream: is closed when it has ended.
        receive: reads the next message from it; its first error is the end, and arrives as well.
    """

    def __init__(self, stream: IO[bytes], receive: Callable[[], Any]) -> None:  # Any: whatever arrives
        self._stream, self._receive = stream, receive
        self._messages: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def start(self) -> Self:
        """Begin to read."""
        threading.Thread(target=self._read, daemon=True).start()
        return self

    def next(self, timeout: float | None = None) -> Any:  # Any: see above
        """Return the next message, waited for so many seconds at most (None: for ever).

        Raises:
            queue.Empty: there is none yet.
            Exception: that of `receive`, once all messages were returned.
        """
        message = self._messages.get(timeout=timeout)
        if isinstance(message, Exception):
            self._messages.put(message)
            raise message
        return message

    def _read(self) -> None:
        with self._stream:
            try:
                while True:
                    self._messages.put(self._receive())
            except Exception as error:
                self._messages.put(error)
