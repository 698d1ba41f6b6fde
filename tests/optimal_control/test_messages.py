"""Messages to the solver process: which thread works with casadi's symbols, which no other may touch meanwhile."""

import io
import pickle
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from known_flights import oscillator, rest_to_rest

from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.messages import Receiver, Sender, SolveRequest


def test_the_thread_that_reads_unpacks_nothing() -> None:
    problem, guess = rest_to_rest()
    stream = io.BytesIO()
    Sender(stream).send(SolveRequest(problem, guess, None, "interior-point", SolverOptions(), 1))
    whole = stream.getvalue()
    receiver = Receiver(io.BytesIO(whole[:8] + b"?" * (len(whole) - 8)))
    content = receiver.read()
    assert content is not None
    with pytest.raises(pickle.UnpicklingError):
        receiver.unpack(content)
    cut = Receiver(io.BytesIO(whole[:-1]))
    definitions = 0
    while (content := cut.read()) is not None:
        assert cut.unpack(content) is None  # a function, to which the request will refer
        definitions += 1
    assert definitions == 2  # rates and path


def test_a_function_is_pickled_once_by_one_thread_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many processes it is sent to, from however many threads."""
    problem, guess = rest_to_rest()
    system = oscillator()  # not yet known
    problem = replace(problem, system=system)
    alone = threading.Lock()
    calls: list[object] = []

    whole = pickle.dumps

    def dumps(one: object, *, protocol: int) -> bytes:
        assert alone.acquire(blocking=False)
        calls.append(one)
        content = whole(one, protocol=protocol)
        alone.release()
        return content

    monkeypatch.setattr(pickle, "dumps", dumps)
    with ThreadPoolExecutor(4) as pool:
        futures = [
            pool.submit(
                Sender(io.BytesIO()).send, SolveRequest(problem, guess, None, "interior-point", SolverOptions(), 1)
            )
            for _ in range(8)
        ]
    assert [future.result() for future in futures] == [None] * 8
    assert {id(one) for one in calls} == {id(system.rates), id(system.path_values)}
    assert len(calls) == 2
