"""The messages between a process and its solver process, and how they travel.

Casadi functions are large and few: they are sent once and then named, by `Sender` and `Receiver`.
"""

import hashlib
import io
import pickle
import queue
import struct
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import IO, Any, Self

import casadi as ca

from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.solvers.interface import Multipliers, SolverOptions
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.optimal_control.system import SYMBOLS, System

PREPARED_INTERVALS = 600
"""The number of intervals of all problems together that a solver process keeps ready for the next request.

A hundred intervals take 7 to 10 MB of memory, so these are 60 MB at most. They take 0.15 s (point mass) to 0.4 s
(six-dof) to prepare, which is saved where a structure comes again, as in the steps of a homotopy.
"""


@dataclass(frozen=True)
class SolveRequest:
    """A request to solve `problem` from `guess`, and to keep so many intervals prepared for the next one."""

    problem: Problem
    guess: Iterate
    multipliers: Multipliers | None
    solver: str
    options: SolverOptions
    threads: int
    prepared_intervals: int = PREPARED_INTERVALS


@dataclass(frozen=True, eq=False)
class PreloadRequest:
    """A system of a coming problem and what is observed of it, whose kernels can be made ready. It has no answer."""

    system: System
    scheme: RungeKutta
    observed: tuple[ca.Function, ...] = ()


@dataclass(frozen=True)
class IterationReport:
    """A line of a solver's progress: iteration, objective, largest scaled infeasibility."""

    number: int
    objective: float
    infeasibility: float


@dataclass(frozen=True)
class Notice:
    """A text for people on what the worker does besides solving."""

    text: str


@dataclass(frozen=True)
class WorkerFailure:
    """An answer that a request could not be worked on; a bug, not a failed solve."""

    text: str


Reply = IterationReport | Notice | ProgramSolution | WorkerFailure


@dataclass(frozen=True)
class _Definition:
    """A pickled function under the name by which later messages refer to it."""

    name: str
    content: bytes


_pickled: dict[int, tuple[ca.Function, _Definition]] = {}  # by id, which the reference keeps valid


def _definition(function: ca.Function) -> _Definition:
    """Pickle a function, once for all solver processes."""
    with SYMBOLS:
        if id(function) not in _pickled:
            content = pickle.dumps(function, protocol=pickle.HIGHEST_PROTOCOL)
            _pickled[id(function)] = function, _Definition(hashlib.sha256(content).hexdigest(), content)
            if len(_pickled) > 64:  # up to 0.1 MB each; a race through all stages has two dozen
                del _pickled[next(iter(_pickled))]
        return _pickled[id(function)][1]


_SIZE = struct.Struct("<Q")
"""The head of a message: its size in bytes."""


class _Pickler(pickle.Pickler):
    """A pickler that puts a name in the place of a function."""

    def __init__(self, stream: IO[bytes], name_of: Callable[[ca.Function], str]) -> None:
        super().__init__(stream, protocol=pickle.HIGHEST_PROTOCOL)
        self._name_of = name_of

    def persistent_id(self, obj: Any) -> str | None:  # Any: pickle offers every object it meets
        return self._name_of(obj) if isinstance(obj, ca.Function) else None


class _Unpickler(pickle.Unpickler):
    def __init__(self, stream: IO[bytes], functions: dict[str, ca.Function]) -> None:
        super().__init__(stream)
        self._functions = functions

    def persistent_load(self, pid: str) -> ca.Function:
        return self._functions[pid]


class Sender:
    """A writer of messages, which sends every function once.

    Writing raises OSError where the other side is gone, ValueError where the stream is closed.
    """

    def __init__(self, stream: IO[bytes]) -> None:
        self.stream = stream
        self._waiting: list[bytes] = []
        self._names: dict[int, str] = {}
        self._sent: list[ca.Function] = []  # keeps the ids valid

    def send(self, message: SolveRequest | PreloadRequest) -> None:
        """Write one message, after those that wait."""
        self.pack(message)
        self.deliver()

    def pack(self, message: SolveRequest | PreloadRequest) -> None:
        """Get a message ready that is to wait until `deliver`, behind the functions that it is the first to use."""
        buffer = io.BytesIO()
        _Pickler(buffer, self._name_of).dump(message)
        self._append(buffer)

    def _name_of(self, function: ca.Function) -> str:
        if id(function) not in self._names:
            definition, buffer = _definition(function), io.BytesIO()
            pickle.dump(definition, buffer, protocol=pickle.HIGHEST_PROTOCOL)
            self._append(buffer)
            self._names[id(function)] = definition.name
            self._sent.append(function)
        return self._names[id(function)]

    def deliver(self) -> None:
        """Write the messages that wait, if any."""
        while self._waiting:
            self.stream.write(self._waiting.pop(0))
            self.stream.flush()

    def _append(self, buffer: io.BytesIO) -> None:
        self._waiting += [_SIZE.pack(buffer.tell()), buffer.getvalue()]


class Receiver:
    """A reader of messages, in which equal functions arrive as the same object.

    Any thread may `read`, but only the one that works with casadi may `unpack`: casadi lets other threads run, and
    counts the references to its nodes without a lock.
    """

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._functions: dict[str, ca.Function] = {}

    def read(self) -> bytes | None:
        """Return the next message as it was sent; None at the end of the stream."""
        head = self._stream.read(_SIZE.size)
        if len(head) < _SIZE.size:
            return None
        content = self._stream.read(_SIZE.unpack(head)[0])
        return content if len(content) == _SIZE.unpack(head)[0] else None

    def unpack(self, content: bytes) -> SolveRequest | PreloadRequest | None:
        """Return a message; None if it only defines what later ones refer to."""
        message = _Unpickler(io.BytesIO(content), self._functions).load()
        if not isinstance(message, _Definition):
            return message
        if message.name not in self._functions:
            self._functions[message.name] = pickle.loads(message.content)
        return None

    def receive(self) -> SolveRequest | PreloadRequest | None:
        """Return the next request; None at the end of the stream."""
        while (content := self.read()) is not None:
            if (message := self.unpack(content)) is not None:
                return message
        return None


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

    def __init__(self, stream: IO[bytes], receive: Callable[[], Any]) -> None:  # Any: a message of any kind
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
