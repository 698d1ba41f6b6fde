"""Windows: the rest of the flight stays as it is, and only another route saves anything."""

import dataclasses
import math

import numpy as np
import pytest
from races import EDGE_540, SMALL, course, level, prepared, pylon
from races import planned as plan_of
from search_races import OFF, QUICK, SLALOM, open_session, optimum, planned_coarse_solution, slalom
from transformations import mirrored

from airrace.environment.air import Air
from airrace.planning.plan import plan
from airrace.planning.race import Race
from airrace.planning.route_decisions import RouteDecisions
from airrace.planning.waypoints import candidates
from airrace.procedure.multistart.budget import QUICK as QUICK_EFFORT
from airrace.procedure.multistart.budget import scaled
from airrace.procedure.multistart.coarse_solution import CoarseSolution, planned_guess, solve_coarse
from airrace.procedure.multistart.moves import Move, MoveGenerator
from airrace.procedure.multistart.search import EvaluatedWindow
from airrace.procedure.multistart.segments import Segment, shape, stretches
from airrace.procedure.multistart.window import (
    END_SPEED_TRUST,
    EvaluatedMove,
    Window,
    apply_moves,
    priced,
)
from airrace.procedure.phase_segments import phase_piece
from airrace.procedure.start import InitialBarrier
from airrace.quantities import Interval

ATTITUDE = slice(4, 8)


def own_window(base: CoarseSolution, first: int, last: int) -> Window:
    """A window around a flight's own way."""
    pieces = [phase_piece(base.iterate, base.problem, index) for index in range(first, last)]
    return Window(base, first, last, base.flight, pieces)


def solved_or_none(window: Window) -> EvaluatedMove | None:
    with open_session() as session:
        return priced(session.service, window)


def solved(window: Window) -> EvaluatedMove:
    found = solved_or_none(window)
    assert found is not None
    return found


@pytest.mark.parametrize(("first", "last"), [(0, 1), (1, 2), (2, 3), (0, 2), (1, 3), (0, 3)])
def test_own_way_saves_nothing(first: int, last: int) -> None:
    found = solved(own_window(planned_coarse_solution(SMALL), first, last))
    assert abs(found.saved) < 3e-3
    assert found.iterate.durations.shape == (last - first,)


def test_window_begins_and_ends_in_the_states_of_the_flight_around_it() -> None:
    base = planned_coarse_solution(SMALL)
    found = solved(own_window(base, 1, 2))
    nodes = base.problem.first_node
    before, behind = base.iterate.state[:, nodes[1]], base.iterate.state[:, nodes[2]]
    names = [one.name for one in base.problem.system.states]
    assert found.iterate.state[:, 0] == pytest.approx(before, abs=1e-4)
    for row, name in enumerate(names):
        if name == "V_K":
            assert abs(found.iterate.state[row, -1] - behind[row]) <= END_SPEED_TRUST
        elif name not in ("q0", "q1", "q2", "q3"):
            assert found.iterate.state[row, -1] == pytest.approx(behind[row], abs=1e-3), name
    # Both signs of a quaternion are the same attitude.
    assert abs(found.iterate.state[ATTITUDE, -1] @ behind[ATTITUDE]) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("first", [0, 1, 2])
def test_window_at_an_end_of_the_race_keeps_its_conditions(first: int) -> None:
    base = planned_coarse_solution(SMALL)
    found = solved(own_window(base, first, 3))
    whole = base.flight.problem(base.problem.mesh)
    assert found.problem.phases[-1].end == whole.phases[-1].end
    assert (found.problem.start == whole.start) is (first == 0)


def moves(base: CoarseSolution, race: Race, changed: set[int] | None = None) -> list[Move]:
    move_generator = MoveGenerator(base, race.course, scaled(base.flight.plan.cruise, QUICK_EFFORT.thinking))
    phases = set(range(len(base.problem.phases))) if changed is None else changed
    return list(move_generator.moves(phases))


def test_some_way_through_a_window_unwinds_a_wound_flight_and_fits_into_it() -> None:
    base = planned_coarse_solution(SLALOM)
    tried = [one for one in moves(base, SLALOM) if one.plan_penalty <= QUICK_EFFORT.max_plan_penalty]
    with open_session() as session:
        found = [priced(session.service, one.window) for one in tried]
        best = max((one for one in found if one is not None), key=lambda one: one.saved)
        whole = apply_moves(
            session.service, dataclasses.replace(base.flight, plan=best.window.flight.plan), base, [best]
        )
    assert best.saved > 5.0
    assert whole is not None
    assert whole.race_time == pytest.approx(base.race_time - best.saved, abs=0.05)
    assert whole.race_time == pytest.approx(optimum(SLALOM).trajectory.race_time, abs=0.05)


@pytest.mark.parametrize("race", [pytest.param(SMALL, id="four gates"), pytest.param(SLALOM, id="slalom")])
def test_every_thought_has_a_piece_for_each_of_its_phases(race: Race) -> None:
    for move in moves(planned_coarse_solution(race), race):
        window = move.window
        assert len(window.pieces) == window.last - window.first
        assert window.first <= move.stretch.first < move.stretch.last <= window.last
        for piece in window.pieces:
            assert np.isfinite(piece.state).all()
            assert np.isfinite(piece.control).all()
            assert piece.durations.min() > 0.0


def test_nothing_is_thought_of_where_nothing_has_changed() -> None:
    assert moves(planned_coarse_solution(SLALOM), SLALOM, changed=set()) == []


def test_mirrored_flight_is_thought_of_likewise() -> None:
    own = [(one.stretch, one.kind) for one in moves(planned_coarse_solution(SLALOM), SLALOM)]
    image = mirrored(SLALOM)
    assert [(one.stretch, one.kind) for one in moves(planned_coarse_solution(image), image)] == own


def test_start_that_may_be_passed_either_way_is_thought_of_the_other_way() -> None:
    """Begun backwards past a pylon, the flight is a turn of 180 degrees longer; its window says so."""
    elements = (pylon("first", 0.0, 0.0, 90.0), level("second", 500.0, 0.0, 0.0), level("third", 900.0, 0.0, 0.0))
    race = Race(course("from a pylon", *elements), EDGE_540, Air())
    forward = plan_of(race)
    backwards = [one for one in candidates(race.course, 0) if math.cos(one.axis - forward.waypoints[0].axis) < 0.0]
    chosen = RouteDecisions(ways={0: tuple(backwards)})
    flight = prepared(race)
    wrong = dataclasses.replace(flight, plan=plan(race.course, flight.plan.cruise, chosen))
    with open_session() as session:
        base = solve_coarse(session.service, planned_guess(wrong, wrong.plan, InitialBarrier.COLD))
    assert base is not None
    assert base.race_time > planned_coarse_solution(race).race_time + 2.0
    about_start = [one for one in moves(base, race) if one.kind == "other direction" and one.stretch.number == 0]
    saved = [solved(one.window).saved for one in about_start]
    assert max(saved) == pytest.approx(base.race_time - planned_coarse_solution(race).race_time, abs=0.05)


def test_ways_are_told_apart_whatever_they_hold() -> None:
    """Two ways through the same window differ in nothing but the numbers of their flights."""
    base = planned_coarse_solution(SLALOM)
    window = own_window(base, 0, 3)
    one, other = (
        EvaluatedWindow(
            Move(Segment(1, 1, 2), again, 0.0, "a way"), EvaluatedMove(again, base.iterate, base.problem, 0.1)
        )
        for again in (window, dataclasses.replace(window))
    )
    assert one in [one]
    assert other not in [one]


def twice(race: Race) -> Race:
    """The same elements flown twice."""
    passages = race.course.passages
    again = [dataclasses.replace(one, name=f"2:{one.name}", lap=2, speed=Interval()) for one in passages]
    return dataclasses.replace(race, course=dataclasses.replace(race.course, passages=(*passages, *again)))


def test_what_wins_in_one_lap_is_thought_of_in_the_other() -> None:
    race = twice(SLALOM)
    base = planned_coarse_solution(race)
    move_generator = MoveGenerator(base, race.course, scaled(base.flight.plan.cruise, QUICK_EFFORT.thinking))
    about = [one for one in move_generator.moves(set(range(len(base.problem.phases)))) if one.stretch.number == 1]
    best = max((solved_or_none(one.window) for one in about), key=lambda one: 0.0 if one is None else one.saved)
    assert best is not None
    assert best.saved > 3.0
    (again,) = move_generator.replicate_in_other_laps(best, "unwound")
    assert (again.stretch.number, again.kind) == (4, "unwound in another lap")
    assert solved(again.window).saved == pytest.approx(best.saved, rel=0.2)


def test_way_of_another_flight_is_worth_what_that_flight_is_faster() -> None:
    """The window is the whole race here: what it saves is the difference between both flights."""
    base, good = planned_coarse_solution(SLALOM), planned_coarse_solution(slalom(8.0))
    move_generator = MoveGenerator(base, SLALOM.course, scaled(base.flight.plan.cruise, QUICK_EFFORT.thinking))
    found = solved(move_generator.from_flight(good, move_generator.stretches).window)
    assert found.saved == pytest.approx(base.race_time - optimum(SLALOM).trajectory.race_time, abs=0.05)


def test_races_of_these_tests_are_what_they_are_said_to_be() -> None:
    assert optimum(SLALOM, OFF).trajectory.race_time > optimum(SLALOM, QUICK).trajectory.race_time + 5.0
    assert planned_coarse_solution(slalom(8.0)).race_time < planned_coarse_solution(SLALOM).race_time - 5.0


def test_short_turn_that_leads_high_is_thought_of_flat() -> None:
    base = planned_coarse_solution(SLALOM)
    problem, long = base.problem, math.radians(100.0)
    short = next(one for one in stretches(SLALOM.course) if abs(shape(base, one).turn) < long)
    first, last = problem.first_node[short.first], problem.first_node[short.last]
    z, state = [one.name for one in problem.system.states].index("z"), base.iterate.state.copy()
    state[z, first : last + 1] -= 90.0 * np.sin(np.linspace(0.0, math.pi, last - first + 1))
    high = dataclasses.replace(base, iterate=dataclasses.replace(base.iterate, state=state))

    def shapes(flown: CoarseSolution) -> list[str]:
        about = [one for one in moves(flown, SLALOM) if one.stretch == short]
        return [one.kind for one in about if one.kind == "flat" or one.kind.startswith("slanted")]

    assert shapes(base) == []
    assert shapes(high) == ["flat"]
