"""Replanned lines begin where the aircraft is and change nothing undisturbed; without one, it is the optimum again."""

import json
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from safety_courses import inputs, loop, optimum

from airrace.errors import OutOfTime, UsageError
from airrace.flights.safety.closed_loop import fly
from airrace.flights.safety.disturbances import UNDISTURBED, Disturbances, Scatter
from airrace.flights.safety.judge import Judge, measure
from airrace.flights.safety.monte_carlo import fly_closed_loop
from airrace.flights.safety.nominal import TABLE_STEP, displace
from airrace.flights.safety.plant import CONTROLS, DISTURBANCES, advance
from airrace.flights.safety.replanning import JOBS, PAST, ReplannedLines, Replanning, ensure_replanned
from airrace.procedure.cost_to_go import CostToGo, new_service
from airrace.procedure.result import Silent
from airrace.procedure.solver_session import SolverSession
from airrace.runs.safety_case import fly_safety_case
from airrace.runs.safety_rose import is_cut

INTERVAL = 1.0
LIGHT = Disturbances()


@pytest.fixture(scope="module")
def replanning() -> Iterator[Replanning]:
    rest = CostToGo.of_result(inputs().race, inputs().settings, optimum())
    with new_service(1) as service, closing(SolverSession(service, inputs().settings, Silent())) as session:
        yield Replanning(rest, session, INTERVAL)


def lines_of(replanning: Replanning, count: int) -> ReplannedLines:
    flown = loop()
    return ReplannedLines(replanning, flown.plant, flown.nominal, flown.pilot, flown.gains.feedback, count)


def test_undisturbed_a_replanned_flight_is_the_optimum(replanning: Replanning) -> None:
    flights = fly(loop(), UNDISTURBED, 0, [0], replanning)
    measured = measure(Judge.from_optimum(inputs().race, optimum(), loop()), loop(), flights)
    assert np.abs(measured.crossed[:, :2, 0]).max() < 0.1
    assert abs(float(measured.crossed[-1, 4, 0])) < 5e-3
    assert not any(breach.any() for breach in (*measured.breaches.values(), *measured.along.values(), measured.touched))


def test_a_line_begins_where_the_aircraft_is_and_with_the_stick_that_is_decided(replanning: Replanning) -> None:
    lines, sample, waiting = lines_of(replanning, 2), loop().pilot.sample, loop().pilot.waiting
    clock = np.array([2.0, 2.0])
    error = np.zeros((16, 2))
    error[1, 0], error[3, 0] = 2.0, -1.0
    x = displace(loop().nominal.at(clock), error)
    stick = np.zeros((waiting, CONTROLS, 2))
    stick[:, 0] = -0.05
    every = round(INTERVAL / sample)
    assert not lines.replan(every + 1, x, clock, stick, np.array([True, True])).any()
    assert lines.replan(every, x, clock, stick, np.array([True, False])).tolist() == [True, False]
    np.testing.assert_allclose(lines.line.at(lines.clock)[:, 0], x[:, 0], atol=1e-12)
    np.testing.assert_allclose(lines.sticks_ahead()[:, :, 0], stick[:, :, 0], atol=1e-12)
    inputs_now = np.zeros((CONTROLS + DISTURBANCES, 1))
    inputs_now[0] = -0.05
    flown = x[:, :1]
    for _ in range(waiting):
        flown = advance(loop().plant.rates_of(inputs_now), flown, sample)
    after = lines.clock + np.array([waiting * sample, 1.0])
    np.testing.assert_allclose(lines.line.at(after)[:, 0], flown[:, 0], atol=1e-4)
    ahead = lines.line.state[0, round(PAST / TABLE_STEP) :]
    steps = np.linalg.norm(np.diff(ahead[:, :3], axis=0), axis=1) / TABLE_STEP
    assert np.abs(steps - ahead[1:, 3]).max() < 1.0  # nowhere a jump
    optimum_stays = loop().nominal.at(np.array([1.0]))[:, 0]
    np.testing.assert_allclose(lines.line.at(after)[:, 1], optimum_stays, atol=1e-9)


def test_where_no_line_is_found_the_flight_is_that_along_the_optimum(
    replanning: Replanning, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_line(*_: object) -> None:
        return None

    monkeypatch.setattr(ReplannedLines, "_plan", no_line)
    fixed, replanned = (fly(loop(), Scatter(), 3, range(3), way) for way in (None, replanning))
    np.testing.assert_allclose(replanned.state, fixed.state, atol=1e-6)


def test_a_line_that_is_not_followed_by_another_lasts_once_more_and_then_the_optimum_is_flown(
    replanning: Replanning, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines, waiting, every = lines_of(replanning, 1), loop().pilot.waiting, round(INTERVAL / loop().pilot.sample)
    clock, stick, racing = np.array([1.0]), np.zeros((waiting, CONTROLS, 1)), np.array([True])
    far_off = np.zeros((16, 1))
    far_off[1] = 60.0
    late = np.array([loop().nominal.passing_times[1] - 0.4])  # the gate ahead cannot be made any more
    assert not lines.replan(every, displace(loop().nominal.at(late), far_off), late, stick, racing).any()
    x = loop().nominal.at(clock)
    assert lines.replan(every, x, clock, stick, racing).all()
    planned = lines.line.state.copy()

    def no_line(*_: object) -> None:
        return None

    monkeypatch.setattr(ReplannedLines, "_plan", no_line)
    assert not lines.replan(2 * every, x, clock, stick, racing).any()
    np.testing.assert_array_equal(lines.line.state, planned)
    assert lines.replan(3 * every, x, clock, stick, racing).all()
    np.testing.assert_allclose(lines.line.at(lines.clock), x, atol=1e-9)
    assert not lines.replan(4 * every, x, clock, stick, racing).any()


def test_a_replanned_flight_is_the_same_bit_by_bit_in_any_company(replanning: Replanning) -> None:
    among, alone = (fly(loop(), Scatter(), 7, numbers, replanning) for numbers in (range(2), [1]))
    count = len(alone.clock)
    np.testing.assert_array_equal(among.state[:count, :, 1], alone.state[:, :, 0])
    assert (fly(loop(), Scatter(), 7, [1]).state[:count] != alone.state).any()


def test_a_case_holds_both_lines_of_the_same_flights() -> None:
    race, settings = inputs().race, inputs().settings
    case = fly_safety_case(race, optimum(), "short", 2, LIGHT, seed=0, threads=2, replan=(3.0, settings))
    plain = fly_safety_case(race, optimum(), "short", 2, LIGHT, seed=0, threads=1)
    np.testing.assert_array_equal(case.result.race_times, plain.result.race_times)
    assert case.replanned is not None
    assert (case.replanned.result.race_times != case.result.race_times).all()
    answer = json.loads(json.dumps(case.as_object(), allow_nan=False))
    assert answer["replanned"]["every_s"] == 3.0
    assert answer["counts"] == json.loads(json.dumps(plain.as_object()))["counts"]
    first, second = answer["lines"]
    assert [first["line"], second["line"]] == ["the optimum", "replanned every 3 s"]
    assert second["mean_race_time_s"] == pytest.approx(case.replanned.result.race_times.mean())
    apart = abs(float(np.diff(case.replanned.result.race_times)[0]))
    assert second["race_time_interval_s"] == pytest.approx(12.7062 * apart / 2.0, rel=1e-4)  # Student, one degree
    assert "replanned every 3 s" in repr(case)
    with pytest.raises(UsageError, match=r"every 0\.05 s is out of range: it must be every 0\.1 to 10 s"):
        fly_safety_case(race, optimum(), "short", 2, LIGHT, seed=0, threads=1, replan=(0.05, settings))


def test_a_time_limit_ends_the_flights_of_replanned_lines_in_their_midst(replanning: Replanning) -> None:
    """The first flights are no exception: they alone may take minutes."""
    late = replace(replanning, until=0.0)
    with pytest.raises(OutOfTime):
        fly_closed_loop(inputs().race, optimum(), flights=8, replanning=late)


def test_replanned_flights_come_in_small_batches(replanning: Replanning) -> None:
    done: list[int] = []
    fly_closed_loop(
        inputs().race, optimum(), flights=JOBS + 1, replanning=replanning, watch=lambda n, *_: done.append(n)
    )
    assert done == [0, JOBS, JOBS + 1]


def test_what_was_not_replanned_in_time_is_told_as_cut() -> None:
    options = {"seed": 0, "threads": 1, "replan": (1.0, inputs().settings), "until": 0.0}
    case = fly_safety_case(inputs().race, optimum(), "course", 2, LIGHT, **options)
    assert (case.result.flights, case.replanned, is_cut(case)) == (2, None, True)
    assert "the time was over before any flight along replanned lines" in case.remarks


def test_replanned_flights_are_a_task_of_their_own() -> None:
    told: list[object] = []
    fly_safety_case(
        *(inputs().race, optimum(), "short", 2, LIGHT),
        seed=0,
        threads=2,
        replan=(3.0, inputs().settings),
        watch=lambda done, of, broken: told.append((done, of)),
        begin=told.append,
    )
    assert told == [(0, 2), (2, 2), "short, replanned every 3 s", (0, 2), (2, 2)]


def test_a_race_that_is_over_before_a_line_is_planned_is_refused() -> None:
    most = 0.5 * (optimum().trajectory.race_time - 0.1)
    flown: list[int] = []
    with pytest.raises(UsageError, match=rf"it must be less than every {most:.1f} s"):
        fly_safety_case(
            *(inputs().race, optimum(), "short", 2, LIGHT),
            seed=0,
            threads=1,
            replan=(most + 0.01, inputs().settings),
            watch=lambda done, *_: flown.append(done),
        )
    assert not flown
    ensure_replanned(most - 0.01, optimum().trajectory.race_time, 0.1)
