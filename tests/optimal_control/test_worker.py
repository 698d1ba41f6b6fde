"""What solvers print is read as iterations, and nothing else is; the process ends with the one that asks."""

import contextlib
import pickle
from functools import partial
from typing import Any

import pytest
from known_flights import rest_to_rest

from airrace.optimal_control.solvers.process.idle_processes import start
from airrace.optimal_control.solvers.process.messages import Inbox, IterationReport, Sender, SolveRequest
from airrace.optimal_control.solvers.process.worker import ProgressReader
from airrace.optimal_control.solvers.solver import SolverOptions

LONGEST = 60.0
"""The time after which a reply is considered to be lost, s; it takes less than one."""


class Replies:
    """Keeps what is sent."""

    def __init__(self) -> None:
        self.sent: list[Any] = []

    def send(self, reply: Any) -> None:
        self.sent.append(reply)


def read(text: str, *, piece: int = 1000) -> list[Any]:
    """What is reported of a text that arrives in pieces."""
    replies = Replies()
    reader = ProgressReader(replies)  # type: ignore[arg-type]  (only its `send` is used)
    for place in range(0, len(text), piece):
        reader.write(text[place : place + piece])
    return replies.sent


FATROP = """iter    objective   inf_pr   inf_du lg(mu)    ||d||   lg(rg)   alpha_du   alpha_pr ls
   0  -7.60514286e+00 1.47e+00 3.63e-02   -1.0 0.00e+00      -  0.00e+00   0.00e+00x  1
   9r -2.12842594e+01 4.22e+01 3.73e+06    0.8 0.00e+00      -  8.23e-02   1.12e-03f  1
"""
IPOPT = """iter    objective    inf_pr   inf_du lg(mu)  ||d||  lg(rg) alpha_du alpha_pr  ls
   1  5.5123456e+01 2.00e-01 2.78e+07   0.6 5.98e-01   4.4 1.02e-01 1.47e-01h  1
 279r-2.8609775e-02 3.78e+02 2.78e+07   0.6 5.98e-01   4.4 1.02e-01 1.47e-01h  1
 280r 2.8657715e-02 2.95e+02 2.16e+07   0.6 2.51e-01   4.9 1.74e-01 2.94e-01h  1
"""


@pytest.mark.parametrize("piece", [1000, 7, 1])
def test_iterations_of_both_solvers_are_reported_however_they_arrive(piece: int) -> None:
    assert read(FATROP, piece=piece) == [IterationReport(0, -7.60514286, 1.47), IterationReport(9, -21.2842594, 42.2)]
    assert read(IPOPT, piece=piece) == [
        IterationReport(1, 55.123456, 0.2),
        IterationReport(279, -0.028609775, 378.0),
        IterationReport(280, 0.028657715, 295.0),
    ]


def test_all_else_that_solvers_print_is_dropped() -> None:
    summary = "Number of Iterations....: 12\n  compute search dir                    0.009899\n1.0e+00 1.0e+00 \n"
    assert read(summary + "fatrop                                  0.016844   57.7%\n") == []


def test_worker_ends_in_mid_solve_when_nobody_is_left_to_answer() -> None:
    """As it does on systems that end no process with another one."""
    problem, guess = rest_to_rest(30000)
    worker = start()
    assert worker.stdin is not None
    assert worker.stdout is not None
    sender, replies = Sender(worker.stdin), Inbox(worker.stdout, partial(pickle.load, worker.stdout))
    sender.send(SolveRequest(problem, guess, None, "fatrop", SolverOptions(), 1))
    heard = [replies.next(LONGEST)]
    sender.close()
    assert worker.wait(LONGEST) == 0
    with contextlib.suppress(EOFError):
        while True:
            heard.append(replies.next(LONGEST))
    assert {type(reply) for reply in heard} == {IterationReport}
