"""What makes a flight hard to fly is counted, and decides between flights that are hardly different in race time."""

import dataclasses
import functools
import math

import numpy as np
import pytest
from races import PLAN, SMALL, optimum, prepared

from airrace.model.frames import quaternion
from airrace.optimal_control.trajectory import Array
from airrace.procedure import choice
from airrace.procedure.choice import simplest_of, with_note_on_faster
from airrace.procedure.complexity import FlightComplexity, complexity_of
from airrace.procedure.result import HARDLY_SLOWER, NoteKind, StageResult, Status


@functools.cache
def flown() -> StageResult:
    return optimum(SMALL, PLAN)


def nodes() -> int:
    return len(flown().trajectory.time)


def plain() -> dict[str, Array]:
    """The histories of a straight and level flight."""
    still = {name: np.zeros(nodes()) for name in ("y", "z", "q1", "q2", "q3")}
    return {**still, "x": np.linspace(0.0, 900.0, nodes()), "q0": np.ones(nodes()), "n_z": np.ones(nodes())}


def counted(**rows: Array) -> FlightComplexity:
    """What is counted of a straight and level flight with some of its histories replaced."""
    trajectory = flown().trajectory
    state, names = trajectory.state.copy(), [one.name for one in trajectory.states]
    for name, row in {**plain(), **rows}.items():
        state[names.index(name)] = row
    return complexity_of(prepared(SMALL), dataclasses.replace(trajectory, state=state))


def test_a_straight_flight_has_nothing_to_count() -> None:
    assert counted() == FlightComplexity(0, 0, 0)
    assert counted().describe() == "no circle, no push, no roll through inverted flight"


@pytest.mark.parametrize(("degrees", "circles"), [(170.0, 0), (290.0, 0), (360.0, 1), (-360.0, 1), (710.0, 2)])
def test_circles_are_counted_by_the_turn_on_a_leg(degrees: float, circles: int) -> None:
    first, last = flown().trajectory.first_node[1:3]
    course = np.zeros(nodes())
    course[first : last + 1] = np.linspace(0.0, math.radians(degrees), last + 1 - first)
    course[last + 1 :] = math.radians(degrees)
    x, y = (np.concatenate([[0.0], np.cumsum(10.0 * wave(course[:-1]))]) for wave in (np.cos, np.sin))
    assert counted(x=x, y=y).circles == circles


@pytest.mark.parametrize(("load", "seconds", "pushes"), [(-1.0, 1.0, 1), (-0.3, 1.0, 0), (-1.0, 0.2, 0)])
def test_pushes_last_and_are_no_mere_unloading(load: float, seconds: float, pushes: int) -> None:
    time = flown().trajectory.time
    assert counted(n_z=np.where(np.abs(time - 3.0) <= 0.5 * seconds, load, 2.0)).pushes == pushes


@pytest.mark.parametrize(("turn", "inverted_rolls"), [(-math.pi, 0), (math.pi, 1)])
def test_rolls_through_inverted_flight_are_told_from_those_through_level(turn: float, inverted_rolls: int) -> None:
    bank = 0.5 * math.pi + turn * np.clip((np.arange(nodes()) - 10.0) / 8.0, 0.0, 1.0)
    q = np.array([quaternion(0.0, 0.0, float(one)) for one in bank]).T
    assert counted(**{f"q{row}": q[row] for row in range(4)}).inverted_rolls == inverted_rolls


SIMPLE, HARD = FlightComplexity(0, 0, 1), FlightComplexity(0, 1, 0)


def chosen(*flights: tuple[float, FlightComplexity], certified: bool = True) -> tuple[int, StageResult]:
    """The number of the flight that is chosen, by its race time (s), and the flight with its notes."""
    count = len(flown().trajectory.durations)
    results = [
        dataclasses.replace(
            flown(),
            trajectory=dataclasses.replace(flown().trajectory, durations=np.full(count, seconds / count)),
            outcome=Status.SOLVED if certified or number else Status.NOT_CERTIFIED,
        )
        for number, (seconds, _) in enumerate(flights)
    ]
    counts = {id(one.trajectory): complexity for one, (_, complexity) in zip(results, flights, strict=True)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(choice, "complexity_of", lambda _, trajectory: counts[id(trajectory)])
        best = simplest_of(prepared(SMALL), results)
        noted = with_note_on_faster(prepared(SMALL), best, results)
    return next(number for number, one in enumerate(results) if one is best), noted


def test_of_flights_that_hardly_differ_the_simpler_one_wins_and_what_the_other_saves_is_reported() -> None:
    number, result = chosen((9.0, HARD), (9.009, SIMPLE), (9.008, SIMPLE))
    assert number == 2
    (note,) = result.notes
    assert note.kind is NoteKind.SIMPLER_ROUTE
    assert note.text == (
        "a route that saves 8.0 ms was left for a simpler one: no circle, no push, 1 roll through inverted flight, "
        "instead of no circle, 1 push, no roll through inverted flight"
    )


def test_a_flight_that_is_faster_by_more_or_as_simple_wins() -> None:
    for others in ((9.0 + 1.1 * HARDLY_SLOWER, SIMPLE), (9.005, HARD)):
        number, result = chosen((9.0, HARD), others)
        assert (number, result.notes) == (0, ())


def test_a_simpler_flight_that_does_not_hold_wins_over_nothing() -> None:
    number, result = chosen((9.0, SIMPLE), (9.005, HARD), certified=False)
    assert (number, result.notes) == (1, ())


def test_circles_count_before_pushes_and_these_before_rolls() -> None:
    ranks = [FlightComplexity(0, 0, 5).rank, FlightComplexity(0, 1, 0).rank, FlightComplexity(1, 0, 0).rank]
    assert ranks == sorted(ranks)
