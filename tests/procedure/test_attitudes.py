"""Histories of attitudes keep their meaning when signs are aligned or they are turned."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from airrace.dynamics.point_mass import PointMassState
from airrace.frames import quaternion, rotation
from airrace.procedure.attitudes import ROWS, align_quaternions, turned
from airrace.trajectory import Array

NODES = 7
angle = st.floats(-3.1, 3.1)
signs = arrays(np.float64, (NODES,), elements=st.sampled_from([-1.0, 1.0]))


def history(angles: list[tuple[float, float, float]]) -> Array:
    """A state history with these courses, climbs and banks; the other rows hold their own numbers."""
    state = np.arange(PointMassState.size(), dtype=float)[:, None] + np.arange(len(angles), dtype=float)
    state[ROWS] = np.array([quaternion(*one) for one in angles]).T
    return state


histories = st.builds(history, st.lists(st.tuples(angle, angle, angle), min_size=NODES, max_size=NODES))


def matrices(state: Array) -> Array:
    """`R_OKbar` at every node, shape (3, 3, N)."""
    return np.array(rotation(list(state[ROWS])))


def test_rows_are_those_of_the_quaternion() -> None:
    assert [PointMassState.names()[row] for row in ROWS] == ["q0", "q1", "q2", "q3"]


@settings(max_examples=30)
@given(histories, signs)
def test_aligning_changes_no_attitude_and_no_other_row(state: Array, sign: Array) -> None:
    state[ROWS] *= sign
    aligned = state.copy()
    align_quaternions(aligned)
    assert np.allclose(matrices(aligned), matrices(state), atol=1e-12)
    others = [row for row in range(len(state)) if row not in ROWS]
    assert (aligned[others] == state[others]).all()


@settings(max_examples=30)
@given(histories, signs)
def test_neighbours_lie_on_the_same_side_after_aligning(state: Array, sign: Array) -> None:
    state[ROWS] *= sign
    align_quaternions(state)
    q = state[ROWS]
    assert ((q[:, 1:] * q[:, :-1]).sum(axis=0) >= 0.0).all()


@settings(max_examples=30)
@given(histories, signs)
def test_aligning_keeps_the_first_node_and_a_second_time_changes_nothing(state: Array, sign: Array) -> None:
    state[ROWS] *= sign
    aligned = state.copy()
    align_quaternions(aligned)
    assert (aligned[:, 0] == state[:, 0]).all()
    again = aligned.copy()
    align_quaternions(again)
    assert (again == aligned).all()


@settings(max_examples=30)
@given(histories, histories)
def test_turning_from_an_attitude_to_itself_changes_nothing(state: Array, reference: Array) -> None:
    assert np.allclose(turned(state, reference, reference), state[ROWS], atol=1e-12)


@settings(max_examples=30)
@given(histories, histories)
def test_turning_the_reference_itself_leads_to_where_the_reference_goes(before: Array, after: Array) -> None:
    assert np.allclose(turned(before, before, after), after[ROWS], atol=1e-12)


@settings(max_examples=30)
@given(histories, histories, histories)
def test_turning_there_and_back_is_a_round_trip(state: Array, before: Array, after: Array) -> None:
    there = state.copy()
    there[ROWS] = turned(state, before, after)
    assert np.allclose((there[ROWS] ** 2).sum(axis=0), 1.0, atol=1e-12)
    assert np.allclose(turned(there, after, before), state[ROWS], atol=1e-12)


@settings(max_examples=30)
@given(histories, histories, histories)
def test_directions_turn_with_the_reference(state: Array, before: Array, after: Array) -> None:
    """What `before` is turned by, in O, is what `state` is turned by: R_new R_old^T is the same for both."""
    new = state.copy()
    new[ROWS] = turned(state, before, after)
    for node in range(NODES):
        turn = matrices(after)[:, :, node] @ matrices(before)[:, :, node].T
        assert np.allclose(matrices(new)[:, :, node], turn @ matrices(state)[:, :, node], atol=1e-9)
