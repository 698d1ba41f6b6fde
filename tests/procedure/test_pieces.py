"""A flight cut into pieces and joined again is the same flight."""

import itertools

import numpy as np
import pytest
from races import RACES, planned, prepared

from airrace.optimal_control.problem import Iterate, Problem
from airrace.procedure.attitudes import ROWS
from airrace.procedure.guess import first_mesh, guess
from airrace.procedure.phase_segments import SHORTEST_SHARE, joined, moved, phase_piece
from airrace.procedure.settings import MeshSettings

every_race = pytest.mark.parametrize("name", RACES)


def flight(name: str) -> tuple[Problem, Iterate]:
    """The guess of a race, with numbers in its controls that differ from interval to interval."""
    mesh = first_mesh(planned(RACES[name]), MeshSettings())
    made = guess(planned(RACES[name]), mesh)
    made.control[-1] = np.linspace(0.0, 1.0, made.control.shape[1])
    return prepared(RACES[name]).problem(mesh), made


def pieces_of(problem: Problem, whole: Iterate) -> list[Iterate]:
    return [phase_piece(whole, problem, index) for index in range(len(problem.phases))]


@every_race
def test_cutting_and_joining_is_a_round_trip(name: str) -> None:
    problem, whole = flight(name)
    again = joined(pieces_of(problem, whole))
    assert (again.durations == whole.durations).all()
    assert (again.control == whole.control).all()
    assert (again.state == whole.state).all()


@every_race
def test_pieces_share_the_node_at_their_gate(name: str) -> None:
    problem, whole = flight(name)
    pieces = pieces_of(problem, whole)
    for piece, phase in zip(pieces, problem.phases, strict=True):
        assert piece.state.shape[1] == len(phase.fractions) + 1 == piece.control.shape[1] + 1
    for before, after in itertools.pairwise(pieces):
        assert (before.state[:, -1] == after.state[:, 0]).all()


def test_of_two_states_at_a_gate_the_later_is_kept() -> None:
    problem, whole = flight("four_gates")
    first, second, third = pieces_of(problem, whole)
    later = Iterate(second.durations, second.state + 5.0, second.control)
    node = problem.first_node[1]
    assert joined([first, later, third]).state[0, node] == whole.state[0, node] + 5.0
    assert joined([first, later, third]).state[0, node - 1] == whole.state[0, node - 1]


def test_joining_aligns_the_signs_of_attitudes() -> None:
    problem, whole = flight("four_gates")
    first, second, third = pieces_of(problem, whole)
    flipped = second.state.copy()
    flipped[ROWS] *= -1.0
    again = joined([first, Iterate(second.durations, flipped, second.control), third])
    assert np.allclose(again.state, whole.state, atol=1e-12)


@every_race
def test_what_lies_on_one_plan_moves_onto_the_other(name: str) -> None:
    problem, whole = flight(name)
    before = phase_piece(whole, problem, 0)
    after = Iterate(before.durations + 0.3, before.state + 2.0, before.control - 0.1)
    after.state[ROWS] = before.state[ROWS][:, ::-1]
    shifted = moved(before, before, after)
    assert np.allclose(shifted.state, after.state, atol=1e-9)
    assert np.allclose(shifted.control, after.control)
    assert np.allclose(shifted.durations, after.durations)


def test_moving_by_no_difference_changes_nothing() -> None:
    problem, whole = flight("four_gates")
    piece, reference = phase_piece(whole, problem, 0), phase_piece(whole, problem, 0)
    shifted = moved(piece, reference, reference)
    assert np.allclose(shifted.state, piece.state, atol=1e-12)
    assert (shifted.durations == piece.durations).all()


def test_moved_piece_keeps_a_positive_duration() -> None:
    problem, whole = flight("four_gates")
    piece = phase_piece(whole, problem, 0)
    long = Iterate(piece.durations * 10.0, piece.state, piece.control)
    assert moved(piece, long, piece).durations == pytest.approx(SHORTEST_SHARE * piece.durations)
