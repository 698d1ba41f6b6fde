"""What is sent to the solver process: it arrives as it was sent, and systems are sent once."""

import io
from dataclasses import replace

import numpy as np
from known_flights import oscillator, rest_to_rest

from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.solvers.process.messages import PreloadRequest, Receiver, Sender, SolveRequest
from airrace.optimal_control.solvers.solver import SolverOptions


def request(problem: Problem, guess: Iterate) -> SolveRequest:
    return SolveRequest(problem, guess, None, "fatrop", SolverOptions(), 1)


def test_request_arrives_as_it_was_sent() -> None:
    problem, guess = rest_to_rest()
    stream = io.BytesIO()
    Sender(stream).send(request(problem, guess))
    stream.seek(0)
    receiver = Receiver(stream)
    received = receiver.receive()
    assert isinstance(received, SolveRequest)
    assert replace(received.problem, system=problem.system) == problem
    assert received.problem.system.states == problem.system.states
    assert (received.guess.state == guess.state).all()
    x, u, p = np.array([0.3, -1.0]), np.array([2.0]), np.array(problem.parameters)
    assert (np.asarray(received.problem.system.rates(x, u, p)) == np.asarray(problem.system.rates(x, u, p))).all()
    assert receiver.receive() is None


def test_systems_are_sent_once() -> None:
    problem, guess = rest_to_rest()
    stream = io.BytesIO()
    sender = Sender(stream)
    sizes = []
    for _ in range(3):
        before = stream.tell()
        sender.send(request(problem, guess))
        sizes.append(stream.tell() - before)
    assert sizes[0] > sizes[1] + 1000
    assert sizes[1] == sizes[2]


def test_equal_systems_arrive_as_one_object() -> None:
    problem, guess = rest_to_rest()
    stream = io.BytesIO()
    sender = Sender(stream)
    for system in (problem.system, oscillator(), problem.system):
        sender.send(request(replace(problem, system=system), guess))
    stream.seek(0)
    receiver = Receiver(stream)
    requests = [receiver.receive() for _ in range(3)]
    systems = [received.problem.system for received in requests if isinstance(received, SolveRequest)]
    assert len(systems) == 3
    assert systems[0] is systems[1] is systems[2]


def test_an_announced_system_is_the_one_that_is_solved_later() -> None:
    problem, guess = rest_to_rest()
    stream = io.BytesIO()
    sender = Sender(stream)
    sender.send(PreloadRequest(problem.system, problem.scheme))
    announced = stream.tell()
    sender.send(request(problem, guess))
    assert stream.tell() - announced < announced
    stream.seek(0)
    receiver = Receiver(stream)
    first, second = receiver.receive(), receiver.receive()
    assert isinstance(first, PreloadRequest)
    assert isinstance(second, SolveRequest)
    assert first.system is second.problem.system
    assert first.scheme == problem.scheme


def test_messages_that_wait_are_written_in_their_order_with_the_next() -> None:
    problem, guess = rest_to_rest()
    stream = io.BytesIO()
    sender = Sender(stream)
    sender.pack(PreloadRequest(problem.system, problem.scheme))
    assert stream.tell() == 0
    sender.send(request(problem, guess))
    written = stream.tell()
    sender.deliver()
    assert stream.tell() == written
    stream.seek(0)
    receiver = Receiver(stream)
    first, second = receiver.receive(), receiver.receive()
    assert isinstance(first, PreloadRequest)
    assert isinstance(second, SolveRequest)
    assert receiver.receive() is None
