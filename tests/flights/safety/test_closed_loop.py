"""Closed-loop flights of a short course in wind: they hold their line, scatter as predicted, and are judged right."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from safety_courses import eight_inputs, eight_optimum, inputs, loop, optimum

from airrace.errors import UsageError
from airrace.files.inputs.air import Wind, winds_named
from airrace.flights.safety.closed_loop import Flights, fly
from airrace.flights.safety.disturbances import UNDISTURBED, Disturbances, Gusts, Scatter
from airrace.flights.safety.judge import Judge, grid_of, measure, together
from airrace.flights.safety.monte_carlo import (
    Count,
    closed_loop_of,
    fly_closed_loop,
    gate_stretches,
    leg_stretches,
    linear_at_passings,
)
from airrace.flights.safety.nominal import ERRORS, displace, errors
from airrace.flights.safety.pilot import PilotModel
from airrace.flights.safety.plant import CONTROLS, GustFilter, advance
from airrace.model.frames import rotation
from airrace.model.track.course import Obstacle
from airrace.model.track.gates import Gate
from airrace.model.track.polygons import Point
from airrace.optimal_control.quantities import KNOT
from airrace.optimal_control.trajectory import Array
from airrace.procedure.planning.clearance import pylons_of
from airrace.procedure.result import Status
from airrace.runs.safety_case import SafetyCase, fly_safety_case
from airrace.runs.safety_rose import SafetyRose

FEW = Scatter()
SMALL = Scatter(Gusts.NONE, 0.1 * KNOT, 0.001, 0.001, 0.0, 0.0)
"""Disturbances so small that no limit of stick or stall counts."""


def judge() -> Judge:
    return Judge.from_optimum(inputs().race, optimum(), loop())


def test_errors_and_displacements_are_inverse() -> None:
    clock = np.linspace(0.0, loop().nominal.passing_times[-1], 40)
    line = loop().nominal.at(clock)
    line[4:8] /= np.linalg.norm(line[4:8], axis=0)
    some = 0.1 * np.random.default_rng(1).standard_normal((len(ERRORS), 40))
    np.testing.assert_allclose(errors(displace(line, some), line), some, atol=1e-12)


def test_the_linearised_aircraft_predicts_one_sample_of_the_real_one() -> None:
    """A small error, stick and gust at once: what F, G and E say, but for what the clock takes off along the flow."""
    one, k = loop(), 100
    nominal, sample = one.nominal, one.pilot.sample
    rng = np.random.default_rng(2)
    e, v, d = (1e-4 * rng.standard_normal(size) for size in (len(ERRORS), CONTROLS, 6))
    inputs_now = np.concatenate([nominal.stick(np.array([k * sample]), sample)[:, 0], np.zeros(6)])[:, None]
    line = nominal.at(np.array([k * sample]))
    line[4:8] /= np.linalg.norm(line[4:8])
    undisturbed = advance(one.plant.rates_of(inputs_now), line, sample)
    off = inputs_now + np.concatenate([v, d])[:, None]
    after = advance(one.plant.rates_of(off), displace(line, e[:, None]), sample)
    found = errors(after, undisturbed)[:, 0]
    flow = errors(nominal.at(np.array([(k + 1.25) * sample])), nominal.at(np.array([(k + 0.75) * sample])))[:, 0]
    found -= flow / flow[0] * found[0]
    expected = one.linear.F[k] @ e + one.linear.G[k] @ v + one.linear.E[k] @ d
    np.testing.assert_allclose(found, expected, atol=2e-7)


def test_undisturbed_it_stays_within_5_cm_and_a_third_of_a_degree_at_all_gates_and_breaks_nothing() -> None:
    flights = fly(loop(), UNDISTURBED, 0, [0])
    found = measure(judge(), loop(), flights)
    assert np.abs(found.crossed[:, :2, 0]).max() < 0.05
    assert np.degrees(np.abs(found.crossed[:, 2, 0])).max() < 0.3
    assert np.abs(found.crossed[:, 4, 0]).max() < 1e-3
    assert not any(one.any() for one in (*found.breaches.values(), *found.along.values(), found.touched, found.lost))


def test_a_flight_is_the_same_bit_by_bit_in_any_company_and_on_any_thread() -> None:
    among, alone = fly(loop(), FEW, 7, range(5)), fly(loop(), FEW, 7, [3])
    count = len(alone.clock)
    assert (among.state[:count, :, 3] == alone.state[:, :, 0]).all()
    assert (fly(loop(), FEW, 8, [3]).state[:200] != alone.state[:200]).any()
    one, two = (
        fly_closed_loop(inputs().race, optimum(), flights=130, scatter=FEW, seed=7, threads=threads)
        for threads in (1, 2)
    )
    assert one.counts == two.counts
    np.testing.assert_array_equal(one.envelope, two.envelope)
    assert np.isfinite(one.envelope[1:4]).all()


def test_the_covariance_is_that_of_the_flights_where_all_is_linear() -> None:
    undisturbed = measure(judge(), loop(), fly(loop(), UNDISTURBED, 0, [0])).crossed
    for scatter in (SMALL, replace(SMALL, wind=0.0, mass=0.0, power=0.0, timing=1e-4)):
        flights = measure(judge(), loop(), fly(loop(), scatter, 1, range(400)))
        found = np.std(flights.crossed - undisturbed, axis=2)[1:]
        expected = linear_at_passings(loop(), judge(), scatter)[1:]
        # 400 flights know a standard deviation within 3.5 %; rounding and the table hide what is below a fifth of a mm
        np.testing.assert_allclose(found[:, :2], expected[:, :2], rtol=0.1, atol=2e-4)
        np.testing.assert_allclose(found[:, 2], expected[:, 2], rtol=0.1, atol=2e-4)
        # The line ends at the finish, and with it the change of its load factor: whoever is late misses that.
        np.testing.assert_allclose(found[:, 3], expected[:, 3], rtol=0.1, atol=2e-4)
        np.testing.assert_allclose(found[:, 4], expected[:, 4], rtol=0.1, atol=2e-5)


def test_so_it_is_where_no_gate_stands_and_on_a_vertical() -> None:
    """In a loop at the stall, with a pilot who pulls on regardless, for the linear one does."""
    race = eight_inputs().race
    trained = closed_loop_of(race, eight_optimum(), PilotModel())
    system = trained.plant.system
    path = [replace(one, lower=-np.inf, upper=np.inf) if one.name == "alpha_A" else one for one in system.path]
    eight = replace(trained, plant=replace(trained.plant, system=replace(system, path=tuple(path))))
    places = Judge.from_optimum(race, eight_optimum(), eight)
    assert abs(rotation([float(one) for one in places.states[4:8, 1]])[2][0]) > 0.999  # straight up
    undisturbed = measure(places, eight, fly(eight, UNDISTURBED, 0, [0])).crossed
    flights = measure(places, eight, fly(eight, SMALL, 1, range(200)))
    found, expected = np.std(flights.crossed - undisturbed, axis=2), linear_at_passings(eight, places, SMALL)
    np.testing.assert_allclose(found[1:, :2], expected[1:, :2], rtol=0.15, atol=2e-3)
    np.testing.assert_allclose(found[1:, 4], expected[1:, 4], rtol=0.15, atol=2e-5)


def test_gusts_scatter_more_the_stronger_they_are_and_none_scatter_nothing() -> None:
    def spread(gusts: Gusts) -> float:
        found = measure(judge(), loop(), fly(loop(), replace(UNDISTURBED, gusts=gusts), 2, range(20)))
        return float(np.nanstd(found.crossed[1:, 1]))

    spreads = [spread(gusts) for gusts in (Gusts.LIGHT, Gusts.MODERATE)]
    assert spread(Gusts.NONE) < 1e-3 < spreads[0] < spreads[1]


def test_more_delay_scatters_more_and_too_much_is_reported() -> None:
    quick, slow = (
        fly_closed_loop(inputs().race, optimum(), flights=40, pilot=PilotModel(delay=delay), threads=1)
        for delay in (0.0, 0.3)
    )
    assert quick.gates[-1].deviations["height"].linear < slow.gates[-1].deviations["height"].linear
    with pytest.raises(UsageError, match="must lie between 0 and 1 s"):
        closed_loop_of(inputs().race, optimum(), PilotModel(delay=3.0))
    with pytest.raises(UsageError, match=r"decides every 0\.02 s, so it must be 0\.14 or 0\.16 s"):
        closed_loop_of(inputs().race, optimum(), PilotModel(delay=0.15))
    hopeless = replace(quick, counts={**quick.counts, "lost": Count.with_interval(30, 40)})
    assert "cannot hold this optimum: 30 of 40 flights" in hopeless.note
    assert not quick.note


def test_a_flight_without_a_finite_state_is_lost_alone_and_the_undisturbed_one_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    steps: list[int] = []

    def broken(rates: Callable[[Array], Array], state: Array, seconds: float) -> Array:
        after = advance(rates, state, seconds)
        steps.append(0)
        if len(steps) == 100:
            after[:, 0] = np.nan
        return after

    whole = fly(loop(), FEW, 7, range(3))
    monkeypatch.setattr("airrace.flights.safety.closed_loop.advance", broken)
    flights = fly(loop(), FEW, 7, range(3))
    assert flights.lost[0] == 100
    assert (flights.state[: len(whole.state), :, 1:] == whole.state[: len(flights.state), :, 1:]).all()
    assert np.isfinite(flights.state).all()
    steps.clear()
    with pytest.raises(UsageError, match=r"even undisturbed the flight has no finite state at 2\.0 s"):
        closed_loop_of(inputs().race, optimum(), PilotModel())


def test_gusts_go_by_at_the_speed_through_the_air() -> None:
    """Of the same ground speed, with and against the wind of the course: 4 m/s from 250 degrees."""
    towards = np.radians(70.0)
    line = np.repeat(loop().nominal.at(np.zeros(1)), 2, axis=1)
    for flight, course in enumerate((towards, towards + np.pi)):
        line[4:8, flight] = np.cos(0.5 * course), 0.0, 0.0, np.sin(0.5 * course)
    found = loop().plant.airspeed_of(line)
    np.testing.assert_allclose(found, line[3] + np.array([-4.0, 4.0]))
    filters = loop().gust_filter(Gusts.LIGHT, 1)
    first = loop().nominal.at(np.zeros(1))
    expected = GustFilter.of(Gusts.LIGHT, -first[2], loop().plant.airspeed_of(first), 0.02)
    np.testing.assert_array_equal(filters.step, expected.step)


# What is judged, with a line that is the optimum itself, moved.


def moved(north: float, east: float, up: float) -> Flights:
    """The undisturbed flight somewhere else."""
    flights = fly(loop(), UNDISTURBED, 0, [0])
    state: Array = flights.state.copy()
    state[:, :3, 0] += np.array([north, east, -up])
    return replace(flights, state=state)


def test_a_flight_beside_its_gates_misses_them_and_too_low_is_too_low() -> None:
    last = next(one.element for one in inputs().race.course.passages if one.element.name == "last")
    assert isinstance(last, Gate)
    beside = measure(judge(), loop(), moved(-14.0 * np.sin(last.heading), 14.0 * np.cos(last.heading), 0.0))
    assert beside.breaches["missed"][-1, 0]
    assert beside.crossed[-1, 0, 0] == pytest.approx(14.0, abs=0.05)
    low = measure(judge(), loop(), moved(0.0, 0.0, -20.0))
    assert low.breaches["height"][:, 0].all()
    assert low.along["floor"].all()
    assert low.crossed[-1, 1, 0] == pytest.approx(-20.0, abs=0.05)


def test_a_pylon_in_the_way_is_touched() -> None:
    line = loop().nominal.at(np.array([0.5 * loop().nominal.passing_times[-1]]))[:, 0]
    free = judge()
    post = replace(free.pylons[0], north=float(line[0]), east=float(line[1]), height=200.0)
    one = replace(free, pylons=(*free.pylons, post))
    found = measure(one, loop(), fly(loop(), UNDISTURBED, 0, range(2)))
    assert found.touched[-1].all()
    assert not found.touched[:-1].any()
    assert (found.nearest[:-1] > 0.4).all()


def test_a_pylon_at_the_finish_is_touched_by_the_step_that_crosses_it() -> None:
    line = loop().nominal.at(loop().nominal.passing_times[-1:])[:, 0]
    post = replace(judge().pylons[0], north=float(line[0]), east=float(line[1]), height=200.0)
    assert measure(replace(judge(), pylons=(post,)), loop(), fly(loop(), UNDISTURBED, 0, [0])).touched.all()


def test_a_flight_that_was_lost_touches_nothing_afterwards() -> None:
    line = loop().nominal.at(np.array([0.5 * loop().nominal.passing_times[-1]]))[:, 0]
    free = judge()
    post = replace(free.pylons[0], north=float(line[0]), east=float(line[1]), height=200.0)
    flights = fly(loop(), UNDISTURBED, 0, [0])
    lost = replace(flights, lost=np.array([len(flights.clock) // 4]))
    found = measure(replace(free, pylons=(post,)), loop(), lost)
    assert not found.touched.any()
    assert found.lost.all()


def test_a_wing_tip_below_the_origin_touches_the_ground() -> None:
    """The right wing points down by the sine of the bank, but for the sideslip."""
    flights = fly(loop(), UNDISTURBED, 0, [0])
    q0, q1, q2, q3 = (flights.state[:, row, 0] for row in range(4, 8))
    tips = -flights.state[:, 2, 0] - judge().semispan * np.abs(2.0 * (q2 * q3 + q0 * q1))
    lowest = float(tips[flights.clock[:, 0] <= loop().nominal.passing_times[-1]].min())
    for above in (0.2, -0.2):
        found = measure(judge(), loop(), moved(0.0, 0.0, above - lowest))
        assert found.along["ground"].tolist() == [above < 0.0]


def test_a_wing_too_near_to_a_pylon_or_an_obstacle_breaks_a_rule_without_a_touch() -> None:
    """A mast a metre below the middle of the line, of an aircraft without wings: 1.5 m are asked for, or 0.9 m."""
    line = loop().nominal.at(np.array([0.5 * loop().nominal.passing_times[-1]]))[:, 0]
    for asked, near in ((1.5, True), (0.9, False)):
        mast = Obstacle("mast", (Point(float(line[0]), float(line[1])),), 0.0, float(-line[2]) - 1.0, asked)
        course = replace(inputs().race.course, obstacles=(mast,))
        one = replace(judge(), course=course, pylons=pylons_of(course), semispan=1e-6)
        found = measure(one, loop(), fly(loop(), UNDISTURBED, 0, [0]))
        assert found.along["flight clearance"].tolist() == [near]
        assert not found.touched.any()


def test_counts_have_the_interval_of_clopper_and_pearson() -> None:
    assert Count.with_interval(0, 100).upper == pytest.approx(1.0 - 0.025 ** (1 / 100))
    assert Count.with_interval(100, 100).lower == pytest.approx(0.025 ** (1 / 100))
    half = Count.with_interval(50, 100)
    assert half.lower == pytest.approx(1.0 - half.upper)
    assert half.lower == pytest.approx(0.3983, abs=1e-4)  # table of the binomial distribution


def test_a_quantile_is_reported_only_of_so_many_flights_that_one_is_beyond() -> None:
    def told(count: int) -> list[bool]:
        flights = fly(loop(), UNDISTURBED, 0, [0])
        many = together([measure(judge(), loop(), flights)] * count)
        (_, *gates) = gate_stretches(["a", "b", "c"], many, np.zeros((3, 5)))
        (*legs,) = leg_stretches(["a", "b", "c"], loop().nominal.passing_times, grid_of(loop().nominal), many)
        deviations = [one.deviations["height"] for one in (*gates, *legs)]
        assert np.isfinite([one.mean for one in gates[0].deviations.values()]).all()
        (same,) = {tuple(np.isfinite(one.quantiles).tolist()) for one in deviations}
        return list(same)

    assert [told(count) for count in (19, 20, 333, 334)] == [[False] * 2, [True, False], [True, False], [True] * 2]


# In tables.


def test_a_rose_of_winds_is_understood_or_refused() -> None:
    assert [one.text for one in winds_named("0,5kt@4")] == [
        "calm",
        *("5 kt from 000", "5 kt from 090", "5 kt from 180", "5 kt from 270"),
    ]
    assert len(winds_named("2.5kt")) == 8
    for wrong in ("", "5", "5kt@0", "kt@8", "5,kt@8", "5kt@100"):
        with pytest.raises(UsageError, match="is no rose of winds"):
            winds_named(wrong)


def test_a_case_is_documented_in_full_and_what_is_out_of_range_is_refused() -> None:
    def case(flights: int = 3, gusts: str = "none", wind: float = 1.0, seed: int = 0) -> SafetyCase:
        disturbances = Disturbances(gusts, wind, 0.0, 0.0, 0.0, 0.0)
        return fly_safety_case(inputs().race, optimum(), "short", flights, disturbances, seed=seed, threads=1)

    one = case()
    found = json.loads(json.dumps(one.as_object(), allow_nan=False))
    assert found["flights"] == 3
    assert found["wind_error_kt"] == pytest.approx(1.0)
    assert [gate["passage"] for gate in found["gates"]] == [one.name for one in inputs().race.course.passages]
    assert one.to_csv().count("\n") == 1 + len(found["gates"])
    assert "names no crowd" in repr(one)
    assert one.uncertified == ""
    assert all(gate["height_997_m"] is None for gate in found["gates"])
    assert "99.7 % of 334" in repr(one)
    rose = SafetyRose("short", {Wind(5.0, 90.0): one, Wind(50.0, 0.0): "no flight was found: too windy"})
    rows = json.loads(json.dumps(rose.as_object(), allow_nan=False))["winds"]
    assert rows[0]["contact_percent"] == 100.0 * one.result.contact.share
    assert rows[1]["remark"] == "no flight was found: too windy"
    assert rose.messages == ("50 kt from 000: no flight was found: too windy",)
    with pytest.raises(UsageError, match="known are none, light, moderate, severe"):
        case(gusts="breezy")
    with pytest.raises(UsageError, match="0 flights are out of range"):
        case(flights=0)
    with pytest.raises(UsageError, match="an error of -1 kt in the wind is out of range"):
        case(wind=-1.0)
    with pytest.raises(UsageError, match="a seed of -1"):
        case(seed=-1)


def test_an_optimum_that_is_not_certified_is_flown_but_not_without_a_word() -> None:
    doubtful = replace(optimum(), outcome=Status.NOT_CERTIFIED, message="a defect is too large")
    undisturbed = Disturbances("none", 0.0, 0.0, 0.0, 0.0, 0.0)
    case = fly_safety_case(inputs().race, doubtful, "short", 1, undisturbed, seed=0, threads=1)
    assert case.uncertified == "the optimum is not certified: six-dof: a defect is too large"
    assert case.uncertified in repr(case)
    rose = SafetyRose("short", {Wind(5.0, 90.0): case})
    assert rose.messages == (f"5 kt from 090: {case.uncertified}",)
    assert rose.table().objects()[0]["remark"] == case.uncertified
