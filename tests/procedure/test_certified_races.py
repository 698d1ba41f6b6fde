"""Races are certified from either guess, in any wind, and on extreme courses."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from races import EDGE_540, RACES, RULES, SMALL, blown, course, level, optimum, planned, settings, solve_point_mass

from airrace.model.dynamics.limits import LEAST_ROOM
from airrace.model.environment import Air
from airrace.model.track.course import Rules
from airrace.model.track.gates import Gate, Passing, Pylon
from airrace.optimal_control.quantities import Interval
from airrace.procedure.planning.plan import ONE_PLACE
from airrace.procedure.procedure import recertify
from airrace.procedure.result import StageResult, Status
from airrace.procedure.settings import GuessKind, Settings
from airrace.procedure.stage import Stage
from airrace.procedure.stored_stages import sampler
from airrace.race import Race

GUESSES = tuple(GuessKind)
WIND = 8.0  # m/s
DIRECTIONS = (0, 90, 180, 270)
QUICK = ("half_cuban_eight", "four_gates")
LONG = ("rovinj_2014", "sixteen_phases")
each_quick_race = pytest.mark.parametrize(
    "name", [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in LONG)]
)


def is_quick(name: str, guess: GuessKind) -> bool:
    """One of the long races is flown, and that from the plan; the sixteen phases are flown for one lap elsewhere."""
    return name in QUICK or (name, guess) == ("rovinj_2014", GuessKind.PLAN)


def represents(name: str, guess: GuessKind, direction: int) -> bool:
    """Each quick race is flown in every wind, by turns from either guess."""
    turn = DIRECTIONS.index(direction) + QUICK.index(name) if name in QUICK else -1
    return turn >= 0 and guess is GUESSES[turn % len(GUESSES)]


def windy_cases() -> list[object]:
    """All races, guesses and directions; all but the representatives are slow."""
    cases: list[object] = []
    for name, guess, direction in itertools.product((*QUICK, *LONG), GUESSES, DIRECTIONS):
        marks = [] if represents(name, guess, direction) else [pytest.mark.slow]
        cases.append(pytest.param(name, guess, direction, marks=marks, id=f"{name}-{guess.value}-{direction}"))
    return cases


every_race_and_guess = pytest.mark.parametrize(
    ("name", "guess"),
    [
        pytest.param(name, guess, marks=[] if is_quick(name, guess) else [pytest.mark.slow], id=f"{name}-{guess.value}")
        for name, guess in itertools.product((*QUICK, *LONG), GUESSES)
    ],
)


def assert_certified(result: StageResult) -> None:
    assert result.outcome is Status.SOLVED, result.remarks
    assert result.certificate is not None
    assert result.certified, [dataclasses.astuple(item) for item in result.certificate.failed]


@every_race_and_guess
def test_race_is_certified_in_still_air_and_when_measured_again_from_the_result_alone(
    name: str, guess: GuessKind
) -> None:
    result = optimum(RACES[name], settings(guess))
    assert_certified(result)
    assert result.certificate is not None
    again = recertify(RACES[name], settings(guess), result)
    assert again.certified
    assert [item.name for item in again.items] == [item.name for item in result.certificate.items]
    for one, other in zip(again.items, result.certificate.items, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-3, abs=1e-7)
    stages = [result.stage for result in solve_point_mass(RACES[name], settings(guess))]
    assert stages == [Stage.HOMOTOPY, Stage.POINT_MASS][guess is GuessKind.PLAN :]


@pytest.mark.parametrize(("name", "guess", "direction"), windy_cases())
def test_race_is_certified_in_wind(name: str, guess: GuessKind, direction: int) -> None:
    assert_certified(optimum(blown(RACES[name], direction, WIND), settings(guess)))


@each_quick_race
def test_homotopy_flies_every_phase_and_the_joint_optimum_saves_time_over_the_plan(name: str) -> None:
    """Optima are local; two guesses may end in two, but neither in a needless loop."""
    pieces = solve_point_mass(RACES[name], settings(GuessKind.HOMOTOPY))[0]
    assert (pieces.remarks, pieces.certificate, pieces.certified) == ("", None, False)
    assert len(pieces.trajectory.phases) == len(RACES[name].course.passages) - 1
    times = {guess: optimum(RACES[name], settings(guess)).trajectory.race_time for guess in GUESSES}
    assert max(times.values()) < 1.005 * min(times.values())
    seconds = planned(RACES[name]).seconds
    assert 0.8 * seconds < times[GuessKind.PLAN] < seconds


@every_race_and_guess
def test_splits_are_the_passages_as_they_were_flown(name: str, guess: GuessKind) -> None:
    result, passages = optimum(RACES[name], settings(guess)), RACES[name].course.passages
    assert [split.name for split in result.splits] == [passage.name for passage in passages]
    times = [split.time for split in result.splits]
    assert times[0] == 0.0
    assert times == sorted(times)
    assert times[-1] == pytest.approx(result.trajectory.race_time, rel=1e-12)
    assert np.diff(times) == pytest.approx(result.trajectory.durations, rel=1e-9)
    tolerance = Settings().certificate
    for split, passage in zip(result.splits, passages, strict=True):
        element = passage.element
        assert split.V_K - passage.speed.upper <= tolerance.speed
        if isinstance(element, Gate):
            assert abs(math.remainder(split.bank - element.bank, math.tau)) < element.tolerances.bank + 0.01
        if isinstance(element, Gate | Pylon):
            exact = element.passing is Passing.POINT
            legal = Interval.exactly(element.height) if exact else element.tolerances.height
            assert legal.lower - tolerance.gate_length <= split.height <= legal.upper + tolerance.gate_length


@every_race_and_guess
def test_limits_hold_wherever_the_flight_is_sampled(name: str, guess: GuessKind) -> None:
    """Load factor, floor and speed between the nodes, at times that no mesh knows of."""
    race, result = RACES[name], optimum(RACES[name], settings(guess))
    limits, rules, envelope = Settings().certificate, race.course.rules, race.aircraft.envelope
    times = np.linspace(0.0, result.trajectory.race_time, 1234)
    at = sampler(race, result)(times)
    assert at["n_z"].max() <= rules.n_z.upper + limits.load_factor
    assert at["n_z"].min() >= rules.n_z.lower - limits.load_factor
    assert (-at["z"]).min() >= rules.height.lower - limits.length
    assert at["V_K"].max() <= envelope.V.upper + limits.speed
    assert at["V_K"].min() >= envelope.V.lower - limits.speed
    assert np.abs(at["p_Kbar"]).max() <= race.aircraft.point_mass.p + limits.angle


def test_race_is_flown_alike_every_time() -> None:
    chosen = settings(GuessKind.HOMOTOPY)
    first = optimum(SMALL, chosen)
    *_, again = solve_point_mass.__wrapped__(SMALL, chosen)
    assert (again.trajectory.state == first.trajectory.state).all()
    assert again.trajectory.race_time == first.trajectory.race_time


HEIGHT = 20.0  # m, of all gates


def flown(*distances: float, rules: Rules = RULES) -> StageResult:
    """The optimum through gates one behind the other, at these distances from the first (m)."""
    gates = [level(f"g{number}", north, 0.0, 0.0) for number, north in enumerate([0.0, *distances])]
    race = Race(course("in a row", *gates, rules=rules), EDGE_540, Air())
    return optimum(race, settings(GuessKind.PLAN))


@pytest.mark.parametrize("apart", [2.0 * ONE_PLACE, 0.05, 1.0, 5.0])
def test_a_gate_right_behind_another_one_costs_no_time(apart: float) -> None:
    close, alone = flown(300.0, 300.0 + apart, 600.0), flown(300.0, 600.0)
    assert close.certified
    assert close.trajectory.race_time == pytest.approx(alone.trajectory.race_time, abs=2e-3)


def test_a_gate_that_is_passed_again_at_once_is_come_back_to() -> None:
    again = flown(300.0, 300.0, 600.0)
    assert again.certified
    assert again.trajectory.race_time > flown(300.0, 600.0).trajectory.race_time + 2.0


@pytest.mark.parametrize("turned", [pytest.param(0.0, marks=pytest.mark.slow), 60.0])
def test_one_height_alone_can_be_kept(turned: float) -> None:
    """Straight on and in a turn."""
    kept = dataclasses.replace(RULES, height=Interval.exactly(HEIGHT))
    gates = level("a", 0.0, 0.0, 0.0), level("b", 500.0, 100.0, turned), level("c", 800.0, 900.0, 90.0)
    result = optimum(Race(course("level", *gates, rules=kept), EDGE_540, Air()), settings(GuessKind.PLAN))
    assert result.certified
    assert result.trajectory["z"] == pytest.approx(-HEIGHT, abs=0.51 * LEAST_ROOM)
