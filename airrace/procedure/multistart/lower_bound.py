"""A lower bound of the race time, and the faster routes that it points to.

A race is cut into windows at gates that stand; a window has at most three legs from one such gate to the next. With
prices of the state at these gates (`gate_prices`) the least priced times of the windows add up to a lower bound of the
race time. The best prices are found by cutting planes: a linear program proposes prices (`price_program`), the windows
are solved at these, and their flights are new cuts. Where the bound stays below the race time, the multipliers of the
program tell which flights it would combine; they are joined and solved as a whole.

The windows are solved by a local method from several starts. So the bound is as good as these: a flight that none of
them leads to is not in it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from airrace.model.track.course import Course
from airrace.optimal_control.solvers.service import SolverPool, SolverService
from airrace.procedure.guess import concatenate
from airrace.procedure.multistart.coarse_solution import CoarseSolution, InitialGuess, solve_coarse
from airrace.procedure.multistart.price_program import Proposal, propose_weights
from airrace.procedure.multistart.priced_window import (
    LEGS_MAX,
    PricedWindow,
    Prices,
    RaceGuess,
    Window,
    WindowFlight,
    WindowGuess,
    gates_between_windows,
    moved_guesses,
    rolled_guesses,
)
from airrace.procedure.multistart.search import SAVED_MIN
from airrace.procedure.planning.plan import decisions_from_solution, plan
from airrace.procedure.planning.planning_model import PlanningModel
from airrace.procedure.result import BoundedWindow, LowerBound
from airrace.procedure.settings import MeshSettings
from airrace.procedure.warm_start import InitialBarrier

PROPOSALS_MAX = 15
"""The number of proposals of prices before the windows are solved from all starts again."""
ROUNDS_MAX = 8
"""The number of times that the windows are solved from all starts."""
TRUST_RADIUS, TRUST_RADIUS_MIN, TRUST_RADIUS_MAX = 0.05, 0.001, 0.5
"""How far weights may move at a time (s): at first, at least and at most."""
ASCENT_SHARE = 0.1
"""The share of the rise that a proposal promises by which the bound must rise (1)."""
PROPOSAL_RISE_MIN = 1e-6
"""The least rise for which proposed prices are tried, s."""
BOUND_CHANGE_MIN = 0.001
"""The share of the race time by which a round must change the bound for another one (1)."""
PRUNED_LOSS = 1.0
"""The priced time beyond the least at which a start is not tried again, s."""
NEAREST = 2
"""Number of known flights from which a window is solved at proposed prices."""
DISTINCT_TOLERANCE, DUPLICATE_TOLERANCE, LOWERED_MIN = 0.3, 1e-3, 1e-5
"""Features differ by this much between flights of which both are worth a start (1), and by this little in copies (1),
which are kept only where their priced time is lower by so much (s)."""


@dataclass(frozen=True, eq=False)
class EvaluatedWindow:
    """A flight through a window, and a lower bound of the time of any race that goes through it like that, s.

    That is the bound of all races, and by how much the priced time of the flight is above the least in its window, at
    the prices at which the window was solved.
    """

    window: Window
    flight: WindowFlight
    race_time: float

    def as_solution(self, best: CoarseSolution) -> CoarseSolution:
        """Return the window as a flight of its own, with what it does not have from the best flight."""
        race = self.flight.race
        problem = replace(race, phases=race.phases[slice(*self.window)])
        return replace(best, stage_problem=self.flight.stage_problem, problem=problem, iterate=self.flight.iterate)


class PriceSearch:
    """A search for the best prices around a flight, and for faster flights.

    Args:
        best: the flight.
        others: guesses on other routes, from which windows are solved, too.
        course: that they fly.
        cruise: at which the race is planned.
        mesh: the settings of meshes.
        pool: what solves.
        report: takes what is being done, in words.

    Attributes:
        best: the fastest flight so far.
    """

    def __init__(
        self,
        best: CoarseSolution,
        others: Sequence[RaceGuess],
        course: Course,
        cruise: PlanningModel,
        mesh: MeshSettings,
        pool: SolverPool,
        report: Callable[[str], None],
    ) -> None:
        self.best = best
        self._course, self._cruise, self._mesh, self._pool, self._report = course, cruise, mesh, pool, report
        self._gates = gates_between_windows(course)
        self._others = others
        self._flights: dict[Window, list[WindowFlight]] = {}  # the best flight's piece first
        self._starts: dict[Window, list[WindowGuess]] = {}
        self._evaluated: list[tuple[Prices, Window, WindowFlight]] = []
        self._solves, self._unsolved = 0, 0
        self._prices = Prices.of(best, self._gates)
        self._cover: list[Window] = []  # windows that make up the race, once they are chosen
        self._joined: list[list[WindowFlight]] = []
        self._add_pieces(best)

    def rounds(self, gap: float) -> Iterator[LowerBound]:
        """Raise the bound until it is within a gap of the race time (1), or rises no more; yield it after every round.

        A round ends when all windows have been solved from all starts. Whoever asks for no further one has stopped the
        search: all bounds but the last say so. `best` is a faster flight then, if there is any among the flights that
        the windows lead to.
        """
        self._cover = self._choose_cover()
        for window in self._cover:
            self._starts[window] = [race.within(window) for race in self._others]
        self._add_starts()
        starts = min(len(guesses) for guesses in self._starts.values())
        radius, previous = TRUST_RADIUS, -np.inf
        for left in reversed(range(ROUNDS_MAX)):
            radius = self._ascend(radius)
            solved = self._solve_from_all()
            bound = self._bound(self._prices)
            self._report(f"no flight below {bound:.2f} s; {self.best.race_time:.2f} s so far")
            is_faster = self._join(self._combinations())
            is_near = bound >= (1.0 - gap) * self.best.race_time
            is_settled = is_near or bound < previous + BOUND_CHANGE_MIN * self.best.race_time
            is_last = left == 0 or (is_settled and not is_faster)
            yield self._result(solved, starts, stopped=not is_last)
            if is_last:
                return
            radius, previous = max(radius, TRUST_RADIUS), bound
            if is_faster:
                self._add_starts()
                previous = -np.inf  # further starts may lower the bound

    # the flights of the windows

    def _add_pieces(self, flight: CoarseSolution) -> None:
        """Put the pieces of the best flight before the known flights of all windows."""
        race, times = RaceGuess.of(flight), flight.iterate.durations + flight.error_penalty
        for window in self._windows():
            guess, seconds = race.within(window), float(times[window[0] : window[1]].sum())
            own = self._prices.window(window).flight(guess, guess.iterate, seconds)
            self._flights.setdefault(window, []).insert(0, own)

    def _windows(self) -> list[Window]:
        windows: list[Window] = []
        for number, first in enumerate(self._gates):
            windows += [(first, last) for last in self._gates[number + 1 : number + 1 + LEGS_MAX]]
        return windows

    def _add_starts(self) -> None:
        """Let windows start from the best flight, from it rolled, and from the moves around it as well."""
        moved = moved_guesses(self.best, self._course, self._cruise, self._mesh)
        race = RaceGuess.of(self.best)
        for window in self._cover:
            own, starts = race.within(window), self._starts[window]
            starts += [own, replace(own, barrier=InitialBarrier.COLD), *rolled_guesses(own)]
            for first, last, guess in moved:
                if first <= window[1] and window[0] <= last:  # a gate that both share may be crossed otherwise
                    start = guess.within(window)
                    if not np.array_equal(start.iterate.state, own.iterate.state):
                        starts.append(start)

    def _nearest(self, priced: PricedWindow) -> list[WindowGuess]:
        """Return the known flights of least priced time that differ from one another."""
        chosen: list[WindowFlight] = []
        for flight in sorted(self._flights[priced.window], key=priced.time_of):
            if len(chosen) < NEAREST and not any(flight.resembles(other, DISTINCT_TOLERANCE) for other in chosen):
                chosen.append(flight)
        return [flight.guess for flight in chosen]

    def _solve(self, jobs: Sequence[tuple[PricedWindow, WindowGuess]]) -> list[WindowFlight | None]:
        """Solve windows and keep the flights that are new; return what each guess has led to."""
        outcomes = self._pool.work(jobs, _solve_window)
        for (priced, _), flight in zip(jobs, outcomes, strict=True):
            if flight is None:
                continue
            known, highest = self._flights[priced.window], priced.time_of(flight) + LOWERED_MIN
            if not any(
                flight.resembles(other, DUPLICATE_TOLERANCE) and priced.time_of(other) < highest for other in known
            ):
                known.append(flight)
        self._solves += len(jobs)
        self._unsolved += sum(flight is None for flight in outcomes)
        return outcomes

    def _solve_from_nearest(self, prices: Prices) -> bool:
        """Solve windows from the nearest known flights; return whether every window has led to a flight."""
        jobs = [(priced, guess) for priced in map(prices.window, self._cover) for guess in self._nearest(priced)]
        solved = {
            priced.window for (priced, _), flight in zip(jobs, self._solve(jobs), strict=True) if flight is not None
        }
        return len(solved) == len(self._cover)

    def _solve_from_all(self) -> dict[Window, int]:
        """Solve windows from all starts; return how many of each have led to a flight.

        Starts are pruned by their priced times: one that leads to no flight, or to one far from the least, is not
        tried again, unless all of a window's are such.
        """
        jobs = [(self._prices.window(window), guess) for window in self._cover for guess in self._starts[window]]
        outcomes = self._solve(jobs)
        near: dict[Window, list[WindowGuess]] = {window: [] for window in self._cover}
        solved = dict.fromkeys(self._cover, 0)
        for (priced, guess), flight in zip(jobs, outcomes, strict=True):
            if flight is None:
                continue
            solved[priced.window] += 1
            self._evaluated.append((self._prices, priced.window, flight))
            if priced.time_of(flight) <= self._least(priced) + PRUNED_LOSS:
                near[priced.window].append(guess)
        self._starts = {window: near[window] or self._starts[window] for window in self._cover}
        return solved

    def evaluated(self) -> list[EvaluatedWindow]:
        """Return the flights that windows were solved to from all starts, as they are priced by all that is known."""
        bounds: dict[Prices, float] = {}
        evaluated: list[EvaluatedWindow] = []
        for prices, window, flight in self._evaluated:
            if prices not in bounds:
                bounds[prices] = self._bound(prices)
            priced = prices.window(window)
            beyond = priced.time_of(flight) - self._least(priced)
            evaluated.append(EvaluatedWindow(window, flight, bounds[prices] + beyond))
        return evaluated

    def _least(self, priced: PricedWindow) -> float:
        return min(map(priced.time_of, self._flights[priced.window]))

    def _bound(self, prices: Prices) -> float:
        return sum(self._least(prices.window(window)) for window in self._cover)

    # the prices

    def _choose_cover(self) -> list[Window]:
        """Return the windows, end to end, whose least priced times add up to the most.

        Windows that no flight was found through are taken only where there are no others: nothing is known of them but
        what the best flight takes, which is the most that a least priced time can be.
        """
        self._report("windows between gates")
        race, windows = RaceGuess.of(self.best), self._windows()
        outcomes = self._solve([(self._prices.window(window), race.within(window)) for window in windows])
        unsolved = {window for window, flight in zip(windows, outcomes, strict=True) if flight is None}
        best: dict[int, tuple[int, float, list[Window]]] = {0: (0, 0.0, [])}  # minus the unsolved, bound, windows
        for last in self._gates[1:]:
            choices: list[tuple[int, float, list[Window]]] = []
            for window in windows:
                if window[1] == last:
                    minus_unsolved, bound, before = best[window[0]]
                    bound += self._least(self._prices.window(window))
                    choices.append((minus_unsolved - (window in unsolved), bound, [*before, window]))
            best[last] = max(choices, key=lambda choice: choice[:2])
        return best[self._gates[-1]][2]

    def _ascend(self, radius: float) -> float:
        """Raise the bound by better prices; return how far weights may move at a time in the end, s."""
        bound = self._bound(self._prices)
        for _ in range(PROPOSALS_MAX):
            proposal = self._propose(radius)
            if proposal is None or proposal.promised < bound + PROPOSAL_RISE_MIN:
                break
            prices = self._prices.with_weights(proposal.weights)
            complete = self._solve_from_nearest(prices)
            reached, bound = self._bound(prices), self._bound(self._prices)
            if complete and reached > bound + ASCENT_SHARE * (proposal.promised - bound):
                self._prices, bound, radius = prices, reached, min(1.5 * radius, TRUST_RADIUS_MAX)
            elif not complete or reached < bound:
                radius *= 0.6
            if radius < TRUST_RADIUS_MIN or bound >= (1.0 - BOUND_CHANGE_MIN) * self.best.race_time:
                break
        return radius

    def _propose(self, radius: float) -> Proposal | None:
        weights = {gate: price.weights for gate, price in self._prices.at.items()}
        return propose_weights({window: self._flights[window] for window in self._cover}, weights, radius)

    # faster flights

    def _combinations(self) -> list[list[WindowFlight]]:
        """Return the flights that prices would combine, and the least of each window with the best flight around it."""
        own = [self._flights[window][0] for window in self._cover]
        combinations: list[list[WindowFlight]] = []
        proposal = self._propose(TRUST_RADIUS_MAX)  # little held back by the prices of now
        if proposal is not None:
            combinations = [[self._flights[window][int(np.argmax(proposal.shares[window]))] for window in self._cover]]
        for number, window in enumerate(self._cover):
            priced = self._prices.window(window)
            flight = min(self._flights[window], key=priced.time_of)
            if priced.time_of(flight) < priced.time_of(own[number]) - SAVED_MIN:
                combinations.append([*own[:number], flight, *own[number + 1 :]])
        return combinations

    def _join(self, combinations: Sequence[list[WindowFlight]]) -> bool:
        """Solve joined flights of windows as whole races, and what saves time together; return whether any does."""
        own = [self._flights[window][0] for window in self._cover]
        self._joined.append(own)
        faster = self._solve_joined(combinations)
        if len(faster) > 1:
            together = list(own)
            for flights, _ in faster:
                for number, flight in enumerate(flights):
                    if together[number] is own[number]:
                        together[number] = flight
            faster += self._solve_joined([together])
        if not faster:
            return False
        self.best = min((flight for _, flight in faster), key=lambda flight: flight.race_time)
        self._add_pieces(self.best)
        return True

    def _solve_joined(
        self, combinations: Sequence[list[WindowFlight]]
    ) -> list[tuple[list[WindowFlight], CoarseSolution]]:
        """Return those of the combinations that are faster as a whole race, the fastest first; none is solved twice."""
        new: list[list[WindowFlight]] = []
        for flights in combinations:
            if flights not in self._joined:
                new.append(flights)
                self._joined.append(flights)
        outcomes = self._pool.work([list(zip(self._cover, flights, strict=True)) for flights in new], self._solve_race)
        self._solves += len(new)
        self._unsolved += sum(flight is None for flight in outcomes)
        faster: list[tuple[list[WindowFlight], CoarseSolution]] = []
        for flights, flight in zip(new, outcomes, strict=True):
            if flight is not None and flight.race_time < self.best.race_time - SAVED_MIN:
                faster.append((flights, flight))
        return sorted(faster, key=lambda pair: pair[1].race_time)

    def _solve_race(
        self, service: SolverService, flights: Sequence[tuple[Window, WindowFlight]]
    ) -> CoarseSolution | None:
        """Solve the whole race from flights of all windows, end to end."""
        mesh = [fractions for (first, last), flight in flights for fractions in flight.race.mesh[first:last]]
        guess, base = concatenate([flight.iterate for _, flight in flights]), self.best.stage_problem
        nodes = np.cumsum([0, *(len(fractions) for fractions in mesh)]).tolist()
        decisions = decisions_from_solution(self._course, self.best.problem.system.states, guess.state, nodes)
        planned = replace(base, plan=plan(self._course, self._cruise, decisions))
        return solve_coarse(service, InitialGuess(planned, mesh, guess, InitialBarrier.COARSE))

    def _result(self, solved: dict[Window, int], starts: int, *, stopped: bool) -> LowerBound:
        names = [passage.name for passage in self._course.passages]
        windows: list[BoundedWindow] = []
        for first, last in self._cover:
            priced, flights = self._prices.window((first, last)), self._flights[first, last]
            slack = priced.time_of(flights[0]) - self._least(priced)
            legs = self._gates.index(last) - self._gates.index(first)
            windows.append(BoundedWindow(f"{names[first]} -> {names[last]}", legs, slack, solved[first, last]))
        bound = min(max(self._bound(self._prices), 0.0), self.best.race_time)
        counts = LEGS_MAX, starts, self._solves, self._unsolved
        return LowerBound(bound, self.best.race_time, *counts, tuple(windows), stopped)


def _solve_window(service: SolverService, job: tuple[PricedWindow, WindowGuess]) -> WindowFlight | None:
    priced, guess = job
    return priced.solve(service, guess)
