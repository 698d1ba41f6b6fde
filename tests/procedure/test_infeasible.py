"""A race without a flight is explained in its user's units, and what is suggested flies and is about the least."""

import dataclasses
import math
from pathlib import Path

import pytest
from races import DEGREE, EDGE_540, ROOT, RULES, course, level, optimum, settings
from transformations import mirrored

from airrace.environment.air import Air
from airrace.inputs import load_inputs
from airrace.inputs.variation import Variation
from airrace.planning.race import Race
from airrace.procedure.infeasibility.parameters import relaxables
from airrace.procedure.result import Outcome, StageResult, SuggestedChange
from airrace.procedure.settings import GuessKind
from airrace.quantities import Interval
from airrace.track.course import Course
from airrace.track.gates import Gate, Manoeuvre
from airrace.track.limits import Crowd, CrowdShape
from airrace.track.polygons import Point

G = 9.80665
SPEED, RADIUS = 60.0, 150.0
LEAST = math.hypot(1.0, SPEED**2 / (G * RADIUS))  # the load factor of a level turn


def rectangle(south: float, west: float, north: float, east: float) -> tuple[Point, ...]:
    return Point(south, west), Point(south, east), Point(north, east), Point(north, west)


def level_turn(n_z_max: float) -> Race:
    """Half a circle, flown level and at one speed, in an airspace that ends where the circle does."""

    def at(name: str, east: float, heading: float) -> Manoeuvre:
        exactly = Interval.exactly
        north, height = exactly(0.0), exactly(20.0)
        return Manoeuvre(name, climb=0.0, heading=heading, north=north, east=exactly(east), height=height)

    rules = dataclasses.replace(RULES, n_z=Interval(-2.0, n_z_max), height=Interval(19.9, 20.1))
    flown = course("half a circle", at("a", 0.0, 0.0), at("b", 2.0 * RADIUS, math.pi), rules=rules)
    passages = tuple(dataclasses.replace(one, speed=Interval()) for one in flown.passages)
    airspace = rectangle(-50.0, -1.0, RADIUS, 2.0 * RADIUS + 1.0)
    envelope = dataclasses.replace(EDGE_540.envelope, V=Interval(SPEED - 0.05, SPEED + 0.05))
    aircraft = dataclasses.replace(EDGE_540, envelope=envelope)
    return Race(dataclasses.replace(flown, passages=passages, airspace=airspace), aircraft, Air())


def result_of(race: Race) -> StageResult:
    return optimum(race, settings(GuessKind.PLAN))


def suggested_changes(race: Race) -> dict[str, SuggestedChange]:
    """What is suggested for a race without a flight, by key."""
    result = result_of(race)
    assert result.outcome is Outcome.INFEASIBLE
    return {one.key: one for one in result.suggested_changes}


# The numbers that may be relaxed.


@pytest.mark.parametrize("path", sorted((ROOT / "tracks").glob("*.yaml")), ids=lambda path: path.stem)
def test_a_lever_changes_what_set_changes_by_its_key(path: Path) -> None:
    inputs = load_inputs(path)
    variation = Variation(inputs)
    known = [one for one in relaxables(inputs.race) if one.settable(one.milder)]
    assert len(known) >= 10
    for relaxable in known:
        changed, expected = (
            relaxable.changed(inputs.race, relaxable.milder),
            variation.race(relaxable.key, relaxable.milder),
        )
        assert (changed.course, changed.aircraft) == (expected.course, expected.aircraft), relaxable.key
        assert relaxable.value == pytest.approx(variation.numbers[relaxable.key], rel=1e-9), relaxable.key


def test_levers_are_relaxed_to_the_milder_side_and_rounded_to_it() -> None:
    race = level_turn(2.0)
    for relaxable in relaxables(race):
        assert (relaxable.at_steps(1.0) - relaxable.value) * relaxable.step > 0.0
        assert relaxable.at_steps(relaxable.steps_max) == pytest.approx(relaxable.furthest)
        told = relaxable.rounded(relaxable.at_steps(0.3))
        assert (told - relaxable.at_steps(0.3)) * relaxable.step >= 0.0
    n_z = next(one for one in relaxables(race) if one.key == "rules.n_z_max")
    assert [n_z.rounded(value) for value in (2.31, 2.3, 99.0)] == [2.4, 2.3, n_z.furthest]


# What is told.


def test_the_least_load_factor_of_a_level_turn_follows_from_speed_and_radius() -> None:
    told = suggested_changes(level_turn(2.0))["rules.n_z_max"]
    assert (told.given, told.unit) == (2.0, "g")
    assert LEAST <= told.needed <= LEAST + 0.25 * (LEAST - 2.0) + 0.1


def test_what_is_suggested_flies_and_a_tenth_less_does_not() -> None:
    told = suggested_changes(level_turn(2.0))["rules.n_z_max"]
    assert result_of(level_turn(told.needed)).certified
    assert not result_of(level_turn(2.0 + 0.9 * (LEAST - 2.0))).certified


def test_the_sentence_says_where_and_which_limit_and_how_to_set_it() -> None:
    result = result_of(level_turn(2.0))
    told = suggested_changes(level_turn(2.0))["rules.n_z_max"]
    assert result.message.startswith("no flight was found: a -> b cannot be flown with ")
    assert f"(rules.n_z_max={told.needed:g})" in result.message


def test_suggestions_are_the_same_in_a_mirror() -> None:
    one, other = suggested_changes(level_turn(2.0)), suggested_changes(mirrored(level_turn(2.0)))
    assert one.keys() == other.keys()
    for key in one:
        assert one[key].needed == pytest.approx(other[key].needed, rel=1e-6), key


def test_little_is_flown_in_vain_where_limits_plainly_contradict_each_other() -> None:
    attempts = result_of(level_turn(2.0)).attempts
    assert [one.purpose for one in attempts].index("every limit giving way") <= 2  # after the plan, by both solvers
    alone = [one for one in attempts if one.purpose == "the legs around it alone"]
    assert len(alone) == 2  # from two guesses, of the first phase that the homotopy could not add
    assert {one.solver for one in alone} == {"fatrop"}


# Several conflicts.


def beside(name: str, north: float, distance: float) -> Crowd:
    return Crowd(name, CrowdShape.POINT, (Point(north, 40.0),), distance, slant=False)


def avenue(*crowd: Crowd) -> Course:
    """Gates in a row, in an airspace of 60 m to either side."""
    gates = [straight(level(f"g{place}", 250.0 * place, 0.0, 0.0)) for place in range(5)]
    rules = dataclasses.replace(RULES, height=Interval(10.0, 60.0))
    flown = course("avenue", *gates, rules=rules)
    return dataclasses.replace(flown, crowd=crowd, airspace=rectangle(-100.0, -60.0, 1200.0, 60.0))


def straight(gate: Gate) -> Gate:
    return dataclasses.replace(gate, tolerances=dataclasses.replace(gate.tolerances, crossing=40.0 * DEGREE))


def test_independent_conflicts_are_all_told_and_the_first_suggestions_together_fly() -> None:
    race = Race(avenue(beside("west", 375.0, 106.0), beside("east", 875.0, 108.0)), EDGE_540, Air())
    result = result_of(race)
    first = {one.conflict: one for one in reversed(result.suggested_changes)}
    assert [first[number].key for number in sorted(first)] in (
        ["crowd.west.distance_m", "crowd.east.distance_m"],
        ["crowd.east.distance_m", "crowd.west.distance_m"],
    )
    assert {first[number].where for number in first} == {"g1 -> g2", "g3 -> g4"}
    assert "; and " in result.message
    needed = {one.key.split(".")[1]: one.needed for one in first.values()}
    milder = avenue(beside("west", 375.0, needed["west"]), beside("east", 875.0, needed["east"]))
    assert result_of(Race(milder, EDGE_540, Air())).certified


@pytest.mark.slow
def test_a_race_that_has_a_flight_after_all_is_flown() -> None:
    """Neither the plan nor the homotopy leads to one with this ceiling, nor does any solver from them."""
    race = load_inputs(ROOT / "tracks" / "abu_dhabi_2016.yaml", overrides=["rules.ceiling_m=60"]).race
    result = result_of(race)
    assert result.certified
    assert result.suggested_changes == ()
