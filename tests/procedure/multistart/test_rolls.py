"""Rolls from one side to the other, flown the other way, and the words for them."""

import dataclasses
import math

import numpy as np
import pytest
from races import DEGREE, DIVING_EIGHT, SMALL
from search_races import SLALOM, open_session, planned_coarse_solution
from test_moves import each_small_race, own_window
from transformations import mirrored

from airrace.model.frames import quaternion, rotation
from airrace.optimal_control.trajectory import Array
from airrace.procedure.guess import QUATERNION_ROWS, align_quaternions
from airrace.procedure.multistart import moves
from airrace.procedure.multistart import rolls as roll_moves
from airrace.procedure.multistart.coarse_solution import CoarseSolution
from airrace.procedure.multistart.moves import MoveGenerator
from airrace.procedure.multistart.rolls import LOAD_FACTOR_ROW, ROLL_RATE_ROW, rerolls, reversals
from airrace.procedure.multistart.search import QUICK
from airrace.procedure.multistart.segments import differing, segments_of
from airrace.procedure.multistart.window import Move, evaluate
from airrace.race import Race

PULLED = "pull instead of push"


def attitudes(banks: Array) -> Array:
    """Attitudes on a course of 30 degrees, climbing by 10, at banks in degrees."""
    state = np.zeros((max(QUATERNION_ROWS) + 1, len(banks)))
    state[QUATERNION_ROWS] = np.transpose([quaternion(30 * DEGREE, 10 * DEGREE, bank * DEGREE) for bank in banks])
    align_quaternions(state)
    return state[QUATERNION_ROWS]


@pytest.mark.parametrize(
    ("end", "angle", "words"),
    [
        (-80.0, -160.0, "rolling left through level"),
        (280.0, 200.0, "rolling right through inverted"),
    ],
)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_roll_leads_through_level_or_through_inverted_flight(end: float, angle: float, words: str, side: float) -> None:
    banks = side * np.concatenate([np.linspace(0.0, 80.0, 9), np.linspace(80.0, end, 21)])
    (found,) = reversals(attitudes(banks))
    assert 0.3 * abs(angle) * DEGREE < side * math.copysign(1.0, angle) * found.angle <= abs(angle) * DEGREE
    expected = words if side > 0.0 else words.replace("left", "?").replace("right", "left").replace("?", "right")
    assert found.describe() == expected
    assert found.inverted is ("inverted" in words)


def test_bank_that_stays_on_one_side_is_no_roll() -> None:
    assert reversals(attitudes(np.array([0.0, 60.0, 90.0, 120.0, 60.0, 5.0, -10.0, 20.0, 80.0]))) == []


@each_small_race
def test_roll_the_other_way_keeps_the_path_and_is_a_full_turn_apart(race: Race) -> None:
    base = planned_coarse_solution(race)
    own = base.iterate.state
    for one in (one for one in rerolls(base.problem, base.iterate) if one.kind != PULLED):
        state = one.flight.state
        other_rows = [row for row in range(len(own)) if row not in (*QUATERNION_ROWS, ROLL_RATE_ROW)]
        assert state[other_rows] == pytest.approx(own[other_rows])
        for here, there in zip(
            rotation(list(own[QUATERNION_ROWS])), rotation(list(state[QUATERNION_ROWS])), strict=True
        ):
            assert there[0] == pytest.approx(here[0], abs=1e-9)  # the direction of flight
        cosine = (own[QUATERNION_ROWS] * state[QUATERNION_ROWS]).sum(axis=0)
        assert cosine[0] == pytest.approx(1.0)
        assert cosine[-1] == pytest.approx(-1.0 if one.kind.startswith("roll") else 1.0)


@pytest.mark.parametrize(
    ("within", "behind"), [(170.0, 340.0), (170.0, 20.0), (20.0, 20.0)], ids=["rolls on", "rolls back", "pushes over"]
)
def test_what_is_pushed_is_pulled_with_the_same_lift(within: float, behind: float) -> None:
    base = planned_coarse_solution(SMALL)
    nodes = np.arange(base.iterate.state.shape[1])
    middle = len(nodes) // 2
    pushed, away = abs(nodes - middle) <= 8, abs(abs(nodes - middle) - 8) > 3
    banks: list[Array] = []
    for side in (1.0, -1.0):
        state = base.iterate.state.copy()
        state[QUATERNION_ROWS] = attitudes(side * np.where(pushed, within, np.where(nodes < middle, 20.0, behind)))
        state[LOAD_FACTOR_ROW] = np.where(pushed, -1.5, 1.5)
        own = dataclasses.replace(base.iterate, state=state)
        (found,) = [one for one in rerolls(base.problem, own) if one.kind == PULLED]
        assert (found.first, found.last) == (middle - 8, middle + 8)
        there = found.flight.state
        assert (there[LOAD_FACTOR_ROW] > 0.0).all()
        R, own_R = (rotation(list(one[QUATERNION_ROWS])) for one in (there, state))
        lift = there[LOAD_FACTOR_ROW] * np.array([row[2] for row in R])
        own_lift = state[LOAD_FACTOR_ROW] * np.array([row[2] for row in own_R])
        assert lift[:, away] == pytest.approx(own_lift[:, away], abs=1e-9)
        cosine = (there[QUATERNION_ROWS] * state[QUATERNION_ROWS]).sum(axis=0)
        assert cosine[-1] * cosine[0] == pytest.approx(-1.0 if behind == 340.0 else 1.0)
        banks.append(np.unwrap(np.arctan2(R[2][1], R[2][2])))
    assert banks[1] == pytest.approx(-banks[0], abs=1e-9)  # as in the mirror


@pytest.mark.parametrize("node", [0, -1])
def test_a_flight_that_begins_or_ends_in_a_pull_down_has_windows_for_its_rolls(node: int) -> None:
    """A pull down at a single node leaves nothing to be flown on the other side."""
    base = planned_coarse_solution(SMALL)
    state = base.iterate.state.copy()
    state[QUATERNION_ROWS, node] = quaternion(0.0, 0.0, 130.0 * DEGREE)
    align_quaternions(state)
    over = dataclasses.replace(base, iterate=dataclasses.replace(base.iterate, state=state))
    assert not any(one.first == one.last for one in rerolls(over.problem, over.iterate))
    assert all(move.own for move in rolls(over, SMALL))


def rolls(base: CoarseSolution, race: Race) -> list[Move]:
    generator = MoveGenerator(base, race.course, QUICK.planning_radius.scale(base.stage_problem.plan.cruise))
    return list(generator.rolls(set(range(len(base.problem.phases)))))


@each_small_race
def test_rolls_are_tried_like_those_of_the_mirrored_flight(race: Race) -> None:
    image = mirrored(race)
    own, seen = (rolls(planned_coarse_solution(one), one) for one in (race, image))
    assert [(one.segment, one.kind) for one in seen] == [(one.segment, one.kind) for one in own]


def test_flights_that_differ_in_a_roll_alone_are_on_different_routes() -> None:
    base, segments = planned_coarse_solution(SLALOM), segments_of(SLALOM.course)
    found = [one for one in rerolls(base.problem, base.iterate) if one.kind.startswith("roll")]
    assert found
    for one in found:
        other = dataclasses.replace(base, iterate=one.flight)
        different = differing(base, other, segments)
        assert different
        assert different == differing(other, base, segments)
        nodes = base.problem.first_node
        assert all(nodes[each.first] < one.last and one.first < nodes[each.last] for each in different)


def test_windows_of_rolls_have_room_before_and_behind_the_gates_at_their_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """With two intervals between a gate and eleven fixed states there is no step."""
    base, left_out, rest = planned_coarse_solution(SLALOM), 0, [math.inf]
    for reach in (0.5, 1.0, 1.5, 2.0, 2.5, 3.0):
        monkeypatch.setattr(roll_moves, "REACH", reach)
        monkeypatch.setattr(roll_moves, "PUSH_REACH", reach)
        for one in rolls(base, SLALOM):
            ends = zip((one.pieces[0], one.pieces[-1]), one.spare, strict=True)
            rest += [piece.control.shape[1] - spare for piece, spare in ends if spare]
            left_out += sum(one.spare)
    assert left_out
    assert min(rest) >= moves.FEWEST


def test_windows_of_pushes_are_wider_than_those_of_rolls() -> None:
    base = planned_coarse_solution(DIVING_EIGHT)
    (pulled,) = [one for one in rerolls(base.problem, base.iterate) if one.kind == PULLED]
    assert pulled.reach == roll_moves.PUSH_REACH > roll_moves.REACH
    (move,) = [one for one in rolls(base, DIVING_EIGHT) if one.kind == PULLED]
    assert (move.phases, move.changed) == (range(4), range(1))


def test_window_that_leaves_out_intervals_saves_nothing_on_the_own_route_and_fits_into_the_flight() -> None:
    base = planned_coarse_solution(SMALL)
    whole = own_window(base, 0, 3)
    nodes = base.problem.first_node
    with open_session() as session:
        found = evaluate(session.service, dataclasses.replace(whole, spare=(4, 5)))
    assert found is not None
    assert abs(found.saved) < 3e-3
    assert found.problem.intervals == base.problem.intervals
    assert found.iterate.durations == pytest.approx(base.iterate.durations, abs=0.01)
    outside = [*range(4), *range(nodes[3] - 4, nodes[3] + 1)]
    assert found.iterate.state[:, outside] == pytest.approx(base.iterate.state[:, outside], abs=1e-9)
