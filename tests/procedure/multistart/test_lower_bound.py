"""The lower bound of the race time from windows between priced gates, and the routes that it leads to."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import pytest
from races import course, level, prepared
from search_races import OFF, SLALOM, open_session, planned_coarse_solution
from transformations import mirrored

from airrace.files.inputs import load_inputs
from airrace.model.frames import product, quaternion
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.solvers.service import SolverPool, SolverService
from airrace.pages.views.stage_tables import bound_text
from airrace.procedure.multistart import lower_bound, multistart
from airrace.procedure.multistart.coarse_solution import (
    COMPARED_SECONDS,
    CoarseSolution,
    InitialGuess,
    finer_guess,
    solve_coarse,
    solve_finer,
)
from airrace.procedure.multistart.gate_prices import GatePrice, features_of
from airrace.procedure.multistart.lower_bound import ROUNDS_MAX, SAVED_MIN, PriceSearch
from airrace.procedure.multistart.plans import own_plans
from airrace.procedure.multistart.priced_window import PricedWindow, RaceGuess, WindowFlight, WindowGuess
from airrace.procedure.multistart.rolls import rerolls
from airrace.procedure.multistart.search import QUICK, planned_starts
from airrace.procedure.result import BoundedWindow, LowerBound
from airrace.procedure.warm_start import InitialBarrier
from airrace.race import Race


@contextmanager
def price_search(
    race: Race, flight: CoarseSolution | None = None, others: Sequence[InitialGuess] = ()
) -> Iterator[tuple[PriceSearch, SolverPool]]:
    """A search from a flight, the optimum of the race's own plan if there is none."""
    with open_session(OFF) as session, session.pool() as pool:
        flight = flight or planned_coarse_solution(race)
        plans = [*own_plans(prepared(race)), *others]
        cruise = prepared(race).plan.cruise
        counts = [len(phase) for phase in flight.problem.mesh]
        guesses = [RaceGuess.of(finer_guess(plan, OFF.mesh, counts)) for plan in plans]
        yield PriceSearch(flight, guesses, race.course, cruise, OFF.mesh, pool, lambda _: None), pool


STATES = prepared(SLALOM).model.system.states
NAMES = [quantity.name for quantity in STATES]
QUATERNION = [NAMES.index(f"q{component}") for component in range(4)]


ONE_LEG = replace(SLALOM, course=course("leg", level("first", 0.0, 0.0, 0.0), level("last", 700.0, 80.0, 20.0)))


def random_state(rng: np.random.Generator) -> np.ndarray:
    state = rng.normal(size=len(NAMES))
    state[QUATERNION] = quaternion(*rng.uniform(-math.pi, math.pi, 3))
    return state


def rotated(state: np.ndarray, turn: Sequence[float]) -> np.ndarray:
    """The state with its attitude turned by small angles about the axes of the path, rad."""
    angle = float(np.linalg.norm(turn))
    axis = [math.sin(angle / 2) * component / angle for component in turn]
    state = state.copy()
    state[QUATERNION] = product(state[QUATERNION].tolist(), [math.cos(angle / 2), *axis])
    return state


def test_price_grows_as_the_time_to_go_does_and_knows_no_sign_of_the_quaternion() -> None:
    rng = np.random.default_rng(3)
    state, costate = random_state(rng), rng.normal(size=len(NAMES))
    price = GatePrice.from_costate(STATES, state, costate)
    step = 1e-4

    def difference(after: np.ndarray, before: np.ndarray) -> float:
        return float(price.weights @ (price.features.at(after) - price.features.at(before)))

    for row, name in enumerate(NAMES):
        if row not in QUATERNION:
            moved = state.copy()
            moved[row] += step
            assert difference(moved, state) == pytest.approx(costate[row] * step, rel=1e-6, abs=1e-12), name
    for axis in np.eye(3) * step:
        after, before = rotated(state, axis), rotated(state, -axis)
        assert difference(after, before) == pytest.approx(costate @ (after - before), rel=1e-5)
    negative = state.copy()
    negative[QUATERNION] *= -1.0
    assert difference(negative, state) == 0.0


def test_prices_cancel_in_a_flight_of_the_whole_race() -> None:
    rng = np.random.default_rng(4)
    flight = planned_coarse_solution(SLALOM)
    features, guess = features_of(STATES), RaceGuess.of(flight)
    prices = [None, *(GatePrice(features, rng.normal(size=features.values.size1_out(0))) for _ in range(2)), None]
    total = 0.0
    for first in range(3):
        window = PricedWindow((first, first + 1), prices[first], prices[first + 1])
        part = guess.within(window.window)
        total += window.time_of(window.flight(part, part.iterate, float(part.iterate.durations.sum())))
    assert total == pytest.approx(float(flight.iterate.durations.sum()), abs=1e-9)


def test_no_start_is_below_the_bound() -> None:
    starts = planned_starts(prepared(SLALOM), SLALOM.course, QUICK)
    with price_search(SLALOM, others=starts) as (search, pool):
        bounds = list(search.rounds(0.01))
        flights = pool.work(starts, solve_coarse)
    *stopped, bound = bounds
    assert stopped
    assert [earlier.stopped for earlier in bounds] == [*[True] * len(stopped), False]
    assert sorted(bounds, key=lambda bound: -bound.race_time) == bounds
    for earlier in bounds:
        assert earlier.seconds <= min(earlier.race_time, search.best.race_time)
        assert earlier.windows
    assert search.best.race_time < planned_coarse_solution(SLALOM).race_time - 5.0  # it rounded its pylon backwards
    assert bound.race_time == search.best.race_time
    assert bound.gap < 0.01
    assert bound.seconds <= min(flight.race_time for flight in flights if flight is not None)
    assert sum(window.slack for window in bound.windows) == pytest.approx(bound.race_time - bound.seconds, abs=1e-6)


@pytest.mark.slow
def test_best_route_is_found_from_the_worst_by_prices_alone() -> None:
    race = load_inputs("air_race_x_2024").race
    with open_session(OFF) as session, session.pool() as pool:
        flights = pool.work(planned_starts(prepared(race), race.course, QUICK), solve_coarse)
    times = {flight.race_time: flight for flight in flights if flight is not None}
    with price_search(race, times[max(times)]) as (search, _):
        *_, bound = search.rounds(0.01)
    assert search.best.race_time <= min(times) + SAVED_MIN
    assert bound.gap < 0.01


@pytest.mark.slow
def test_mirrored_course_has_the_mirrored_bound() -> None:
    bounds: list[LowerBound] = []
    for race in (SLALOM, mirrored(SLALOM)):
        with price_search(race) as (search, _):
            bounds += list(search.rounds(0.01))[-1:]
    first, second = bounds
    assert first.race_time == pytest.approx(second.race_time, abs=1e-3)
    assert first.seconds == pytest.approx(second.seconds, abs=0.01 * first.race_time)


def test_window_without_a_flight_is_taken_only_where_there_is_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    solve = PricedWindow.solve

    def solve_single_legs(self: PricedWindow, service: SolverService, guess: WindowGuess) -> WindowFlight | None:
        return solve(self, service, guess) if self.window[1] - self.window[0] == 1 else None

    monkeypatch.setattr(PricedWindow, "solve", solve_single_legs)
    with price_search(SLALOM) as (search, _):
        *_, bound = search.rounds(1.0)
    assert [window.legs for window in bound.windows] == [1, 1, 1]


def test_starts_that_all_fail_are_tried_at_other_prices(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[WindowGuess] = []

    def fail_on_the_first_leg(self: PricedWindow, _: SolverService, guess: WindowGuess) -> WindowFlight | None:
        if self.window == (0, 1):
            tried.append(guess)
            return None
        return self.flight(guess, guess.iterate, 1.0)

    monkeypatch.setattr(PricedWindow, "solve", fail_on_the_first_leg)
    monkeypatch.setattr(lower_bound, "LEGS_MAX", 1)
    with price_search(SLALOM) as (search, _):
        list(search.rounds(0.0))
    plan = next(guess for guess in tried if guess.barrier is InitialBarrier.COLD)
    assert sum(guess is plan for guess in tried) > 1


def test_prices_stay_where_the_linear_program_has_no_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lower_bound, "propose_weights", lambda *_: None)
    with price_search(SLALOM) as (search, _):
        *_, bound = search.rounds(1.0)
    assert 0.0 < bound.seconds <= bound.race_time == search.best.race_time
    joined = len(bound.windows) + 1
    assert bound.solves <= 6 + ROUNDS_MAX * (len(bound.windows) * bound.starts + joined)  # of 6 windows some are taken


NO_MOVES = replace(QUICK, iterations=0)


def test_windows_are_solved_on_the_mesh_of_the_comparison_from_every_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a coarser one their flights would take longer than they need to, and the bound would be too high."""
    jobs: list[tuple[PricedWindow, WindowGuess]] = []

    def record(_: SolverService, job: tuple[PricedWindow, WindowGuess]) -> None:
        jobs.append(job)

    monkeypatch.setattr(lower_bound, "_solve_window", record)
    with open_session(OFF) as session:
        fine = solve_finer(session.service, planned_coarse_solution(SLALOM), OFF.mesh)
    with price_search(SLALOM, fine, planned_starts(prepared(SLALOM), SLALOM.course, QUICK)) as (search, _):
        *_, bound = search.rounds(0.01)
    assert bound.unsolved == bound.solves == len(jobs)
    assert bound.starts > 10
    for priced, guess in jobs:
        mesh = guess.race.mesh[slice(*priced.window)]
        for fractions, seconds in zip(mesh, guess.iterate.durations.tolist(), strict=True):
            assert max(fractions) * seconds <= COMPARED_SECONDS


def test_windows_start_from_moves_that_change_a_gate_at_their_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """A gate that is crossed otherwise changes the window behind it, too."""
    best = planned_coarse_solution(SLALOM)
    other = replace(best, iterate=replace(best.iterate, state=best.iterate.state + 1e-6))
    moved = replace(RaceGuess.of(other), barrier=InitialBarrier.OTHER_PROBLEM)
    same = RaceGuess.of(best)
    monkeypatch.setattr(lower_bound, "moved_guesses", lambda *_: [(0, 1, moved), (0, 1, same)])
    monkeypatch.setattr(lower_bound, "LEGS_MAX", 1)
    started: set[tuple[int, int]] = set()
    tried = 0

    def record(_: SolverService, job: tuple[PricedWindow, WindowGuess]) -> None:
        nonlocal tried
        priced, guess = job
        if guess.barrier is moved.barrier:
            started.add(priced.window)
        if priced.window == (0, 1) and np.array_equal(guess.iterate.state, same.within((0, 1)).iterate.state):
            tried += 1

    monkeypatch.setattr(lower_bound, "_solve_window", record)
    with price_search(SLALOM) as (search, _):
        list(search.rounds(0.01))
    assert started == {(0, 1), (1, 2)}
    assert tried == 3  # where the windows are chosen, with a small and a large barrier, not as a move alike


def test_routes_through_windows_are_priced_by_all_that_is_known_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each window has its fastest flight in another round, and yet the best of each stand for the same race."""
    begun: list[None] = []
    solve_from_all = PriceSearch._solve_from_all

    def count_rounds(search: PriceSearch) -> dict[tuple[int, int], int]:
        begun.append(None)
        return solve_from_all(search)

    def solve_a_second_faster_in_its_round(self: PricedWindow, _: SolverService, guess: WindowGuess) -> WindowFlight:
        saved = 1.0 if self.window[0] == len(begun) - 1 else 0.0
        return self.flight(guess, guess.iterate, float(guess.iterate.durations.sum()) - saved)

    monkeypatch.setattr(PriceSearch, "_solve_from_all", count_rounds)
    monkeypatch.setattr(PricedWindow, "solve", solve_a_second_faster_in_its_round)
    monkeypatch.setattr(lower_bound, "LEGS_MAX", 1)
    monkeypatch.setattr(lower_bound, "propose_weights", lambda *_: None)  # the prices stay
    monkeypatch.setattr(lower_bound, "solve_coarse", lambda *_: None)
    with price_search(SLALOM) as (search, _):
        *_, bound = search.rounds(0.0)
    assert len(begun) > 1
    least: dict[tuple[int, int], float] = {}
    for evaluated in search.evaluated():
        least[evaluated.window] = min(evaluated.race_time, least.get(evaluated.window, math.inf))
    assert [least[0, 1], least[1, 2]] == pytest.approx([bound.seconds] * 2)


def test_flight_whose_errors_are_unknown_has_no_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = planned_coarse_solution(SLALOM)
    unknown = replace(flight, errors=np.full_like(flight.errors, np.inf))
    monkeypatch.setattr(multistart, "solve_finer", lambda _, coarse, **__: coarse)
    with open_session(OFF) as session:
        routes = multistart.search_routes(
            prepared(SLALOM), SLALOM.course, session, NO_MOVES, starts=[], solved=[unknown], gap=0.01
        )
    assert len(routes.starts) == 1
    assert routes.search_report(0).bound is None


def test_no_window_is_solved_before_prices_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = planned_coarse_solution(SLALOM)
    monkeypatch.setattr(multistart, "PriceSearch", Unused)
    with open_session(OFF) as session:
        routes = multistart.search_routes(
            prepared(SLALOM), SLALOM.course, session, NO_MOVES, starts=[], solved=[flight], gap=0.01
        )
    bound = routes.search_report(0).bound
    assert bound is not None
    assert (bound.stopped, bound.seconds, bound.windows) == (True, 0.0, ())
    assert bound_text(bound).startswith("the search by prices was stopped before it had a bound")


class Unused:
    """What is never made."""

    def __init__(self, *_: object) -> None:
        raise AssertionError


@dataclass
class Joining:
    """A price search that joins one flight in each of its rounds."""

    best: CoarseSolution
    flights: Sequence[CoarseSolution]

    def evaluated(self) -> list[object]:
        return []

    def rounds(self, _: float) -> Iterator[LowerBound]:
        for flight in self.flights:
            self.best = flight
            yield LowerBound(1.0, flight.race_time, 1, 1, 1, 0, (BoundedWindow("a -> b", 1, 0.0, 1),), stopped=True)


def test_joined_flight_is_a_further_start_only_on_another_route_or_where_it_is_much_faster(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    base = planned_coarse_solution(SLALOM)
    roll = next(move for move in rerolls(base.problem, base.iterate) if move.kind.startswith("roll"))

    def faster(seconds: float, iterate: Iterate = base.iterate) -> CoarseSolution:
        share = 1.0 - seconds / float(iterate.durations.sum())
        return replace(base, iterate=replace(iterate, durations=share * iterate.durations))

    joined = [faster(0.03), faster(0.04), faster(0.05, roll.flight), faster(0.06), faster(0.07)]
    monkeypatch.setattr(multistart, "PriceSearch", lambda best, *_: Joining(best, joined))
    monkeypatch.setattr(multistart, "solve_finer", lambda _, coarse, **__: coarse)
    reports: list[list[float]] = []
    further: list[bool] = []
    joint: set[float] = set()
    with open_session(OFF) as session:
        routes = multistart.search_routes(
            prepared(SLALOM), SLALOM.course, session, NO_MOVES, starts=[], solved=[base], gap=0.01
        )
        for priced in routes.by_prices:
            further.append(priced.further_start is not None)
            searches = [priced.search_report(number) for number in range(1 + sum(further))]
            reports.append([search.routes[0].race_time for search in searches])
            bounds = [search.bound for search in searches if search.bound is not None]
            # each is that of the flight that is compared
            assert [bound.race_time for bound in bounds] == reports[-1]
            joint = {route.race_time for search in searches for route in search.routes if route.evaluated_by == "joint"}
    assert further == [False, False, True, True, False]  # the last one is hardly faster than the one refined before it
    assert reports[1] == [joined[1].race_time]  # compared with the fastest on its route
    assert reports[3] == [flight.race_time for flight in joined[1:4]]
    assert reports[4] == [joined[1].race_time, joined[2].race_time, joined[4].race_time]
    assert {joined[2].race_time, joined[4].race_time} <= joint  # joined flights are among the routes


def test_plan_without_ties_is_one_start() -> None:
    assert len(own_plans(prepared(ONE_LEG))) == 1


def test_race_of_one_leg_is_one_window_whose_bound_is_its_optimum() -> None:
    with price_search(ONE_LEG) as (search, _):
        *_, bound = search.rounds(0.01)
    assert [window.text for window in bound.windows] == ["first -> last"]
    assert bound.seconds == pytest.approx(planned_coarse_solution(ONE_LEG).race_time, abs=1e-3)


def test_flight_that_is_hardly_lower_lowers_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    def solve_to_half_a_millisecond_less(self: PricedWindow, _: SolverService, guess: WindowGuess) -> WindowFlight:
        return self.flight(guess, guess.iterate, best.race_time - 5e-4)

    best = planned_coarse_solution(ONE_LEG)
    monkeypatch.setattr(PricedWindow, "solve", solve_to_half_a_millisecond_less)
    with price_search(ONE_LEG) as (search, _):
        assert list(search.rounds(0.01))[-1].seconds == pytest.approx(best.race_time - 5e-4, abs=1e-9)


def test_sentence_tells_the_gap_its_caveat_and_the_widest_window() -> None:
    windows = (BoundedWindow("a -> b", 3, 0.2, 9), BoundedWindow("b -> c", 2, 0.8, 0))
    text = bound_text(LowerBound(49.0, 50.0, 3, 12, 400, 30, windows))
    assert text == (
        "no flight is more than 2.00 % (1.00 s) faster, as far as windows of up to 3 legs were solved globally by "
        "at least 12 starts each; 0.80 s of it on b -> c; no start led to a flight at the final prices on b -> c"
    )
    stopped = bound_text(LowerBound(49.0, 50.0, 3, 12, 400, 30, windows, stopped=True))
    assert stopped == f"{text}; the search by prices was stopped before its end"
