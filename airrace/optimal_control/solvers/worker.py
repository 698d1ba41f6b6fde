"""The solver process, which reads requests, solves them and reports iterations meanwhile.

`start` of this package starts it through `airrace.runtime.process`, as `python -m` starts a module. The solvers print
their progress to Python's `sys.stdout` only; here it is read line by line and turned into reports.
"""

import io
import logging
import math
import os
import re
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import casadi as ca

from airrace.errors import is_lack_of_memory
from airrace.optimal_control.kernels import Kernels, build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.solvers.messages import (
    Inbox,
    IterationReport,
    Notice,
    Outbox,
    PreloadRequest,
    Receiver,
    SolveRequest,
    WorkerFailure,
)
from airrace.optimal_control.solvers.solver import PreparedProblem, ProgramSolution
from airrace.optimal_control.system import System
from airrace.runtime import process

LARGE = 4000
"""The number of intervals of a problem from which on its memory is given back to the system when it is forgotten.

Of 16,000 intervals 450 MB were left otherwise; the allocator keeps what it has for what is to come.
"""

REPORT_SECONDS = 0.05
"""The least time between two reports, s: people read no faster, and reports of all took 4 % of a run of Rovinj 2014."""

# IPOPT leaves no space between the letter of a restoration and the sign of a negative objective.
_ITERATION = re.compile(r"^\s*(\d+)(?:r?\s+|r(?=-))([-+]?\d\.\d+e[-+]\d+)\s+(\d\.\d+e[-+]\d+)\s")

Numbers = tuple[int | None, ...]
"""Numbers of functions, None where there is none."""
Structure = tuple[str, bytes]
"""All that the prepared functions of a problem depend on; `bytes` are of its rows."""


class ProgressReader(io.TextIOBase):
    """A stand-in for standard output that turns iteration lines into reports and drops all else.

    Args:
        replies: where reports go.
        least_seconds: the time after a report within which no other follows, s.
    """

    def __init__(self, replies: Outbox, least_seconds: float = REPORT_SECONDS) -> None:
        self._replies, self._least_seconds = replies, least_seconds
        self._line, self._reported = "", -math.inf
        self._waiting: IterationReport | None = None

    def write(self, text: str) -> int:
        *lines, self._line = (self._line + text).split("\n")
        for line in lines:
            if match := _ITERATION.match(line):
                self._waiting = IterationReport(int(match[1]), float(match[2]), float(match[3]))
                if time.monotonic() >= self._reported + self._least_seconds:
                    self.report()
        return len(text)

    def report(self) -> None:
        """Report the last iteration, unless that was done."""
        if self._waiting is not None:
            self._reported = time.monotonic()
            self._replies.send(self._waiting)
            self._waiting = None


class NoticeHandler(logging.Handler):
    """A logging handler that sends records to the client, which shows them."""

    def __init__(self, replies: Outbox) -> None:
        super().__init__(logging.WARNING)
        self._replies = replies

    def emit(self, record: logging.LogRecord) -> None:
        self._replies.send(Notice(record.getMessage()))


class SolveServer:
    """A solver of requests that keeps kernels and prepared problems for the next request of the same structure."""

    def __init__(self) -> None:
        self._functions: list[ca.Function] = []
        self._kernels: dict[tuple[Numbers, RungeKutta], Kernels] = {}
        self._prepared: dict[Structure, tuple[PreparedProblem, int]] = {}

    def solve(self, request: SolveRequest) -> ProgramSolution:
        """Solve a request, with what was prepared for an earlier one of the same structure."""
        layout = Layout(request.problem)
        key = self._key(layout, request)
        prepared, _ = self._prepared.pop(key, (None, 0))
        if prepared is None:
            self._make_room(layout.intervals, request.prepared_intervals)
            kernels = self._kernels_of(request.problem.system, request.problem.scheme)
            prepared = PreparedProblem(layout, kernels, request.solver, request.options, request.threads)
        self._prepared[key] = prepared, layout.intervals
        return prepared.solve(layout, request.guess, request.multipliers)

    def preload(self, request: PreloadRequest) -> None:
        """Make the kernels of a system and of observations ready."""
        kernels = self._kernels_of(request.system, request.scheme)
        for values in request.observed:
            kernels.observations.kernel(values)

    def _make_room(self, intervals: int, most: int) -> None:
        """Forget the least recently used problems, so that there are at most so many intervals."""
        largest = max((size for _, size in self._prepared.values()), default=0)
        while self._prepared and intervals + sum(size for _, size in self._prepared.values()) > most:
            del self._prepared[next(iter(self._prepared))]
        if largest > LARGE:
            process.return_freed_memory()

    def _number(self, function: ca.Function) -> int:
        """Return the number of a function; equal ones are one object here, see `Receiver`."""
        for number, registered in enumerate(self._functions):
            if registered is function:
                return number
        self._functions.append(function)
        return len(self._functions) - 1

    def _equations(self, system: System) -> Numbers:
        functions = system.rates, system.path_values, system.projection
        return tuple(None if function is None else self._number(function) for function in functions)

    def _kernels_of(self, system: System, scheme: RungeKutta) -> Kernels:
        key = self._equations(system), scheme
        if key not in self._kernels:
            self._kernels[key] = build_kernels(system, scheme)
        return self._kernels[key]

    def _key(self, layout: Layout, request: SolveRequest) -> Structure:
        """Return everything that the prepared functions depend on; two problems with equal keys share them."""
        problem = request.problem
        samples = [
            (
                self._number(sample.observation.values),
                _scales(sample.observation.quantities),
                sample.offset,
                sample.jump,
            )
            for sample in layout.output_samples
        ]
        objective, at_start = problem.objective, problem.objective.start
        observed = (objective.observation, None if at_start is None else at_start.observation)
        ends = [end and (self._number(end.values), _scales(end.quantities)) for end in observed]
        weights = None if at_start is None else at_start.weights
        cost = replace(objective, observation=None, values=(), start=None), weights, ends
        system = problem.system
        quantities = [_scales(group) for group in (system.states, system.controls, system.path)]
        parts = (self._equations(system), quantities, problem.scheme, cost, problem.time_scale)
        solving = request.solver, request.options, request.threads
        key = repr((parts, layout.first_node.tolist(), len(layout.jump_at), samples, solving))
        return key, layout.rows.structure


def _scales(quantities: Sequence[Quantity]) -> list[tuple[str, float, str]]:
    """Return what derivatives depend on of quantities: all but their bounds."""
    return [(quantity.name, quantity.scale, quantity.rate_of) for quantity in quantities]


def main() -> None:
    """Serve requests until standard input is closed."""
    process.set_parent_death_signal()
    process.keep_freed_memory()
    incoming, answers = process.claim_stdio()
    replies = Outbox(answers)
    logging.getLogger("airrace").addHandler(NoticeHandler(replies))
    sys.stdout = progress = ProgressReader(replies)
    receiver = Receiver(incoming)
    requests = Inbox(incoming, partial(_read, receiver)).start()
    server = SolveServer()
    while True:
        if (request := receiver.unpack(requests.next())) is None:
            continue
        try:
            if isinstance(request, PreloadRequest):
                server.preload(request)
            else:
                try:
                    solution = server.solve(request)
                finally:
                    progress.report()  # or it would be taken for one of the next solve
                replies.send(solution)
        except BrokenPipeError:
            return
        except Exception as error:  # reported to the client, which raises it
            if is_lack_of_memory(error):
                raise
            if isinstance(request, SolveRequest):  # what is only preloaded is tried again when it is to be solved
                replies.send(WorkerFailure(traceback.format_exc()))


def _read(receiver: Receiver) -> bytes:
    """Return the next message; after the last one end this process, even in the middle of a solve."""
    content = receiver.read()
    if content is None:
        os._exit(0)
    return content


if __name__ == "__main__":
    main()
