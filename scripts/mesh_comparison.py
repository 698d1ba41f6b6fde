"""One course flown on the procedure's own meshes and on uniform ones, and what is measured of every optimum."""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from airrace.errors import AirraceError
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.refinement import Mesh, divide
from airrace.optimal_control.replay import SAMPLES
from airrace.optimal_control.solvers.process.service import SolverService
from airrace.optimal_control.solvers.solver import Solution
from airrace.planning.race import Race
from airrace.procedure.certification import Evidence, examine
from airrace.procedure.fidelity_continuation import FidelityContinuation, wanted_stages
from airrace.procedure.progress import Silent
from airrace.procedure.result import Stage, StageResult
from airrace.procedure.settings import GuessKind, SearchEffort, Settings
from airrace.procedure.solve_and_refine import REFINED_BARRIER
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import Flight

COARSER = (0.17 * math.sqrt(2.0), 0.34)  # s, intervals of uniform meshes
FINER = tuple(0.17 / math.sqrt(2.0) ** step for step in range(8))
BISECTIONS = 2  # of a step, where a uniform mesh is the first to be as accurate
HALVINGS = 2  # of the refined mesh, for the race time to compare with


class NotComparable(AirraceError):
    """There is no certified flight, or there are two different ones."""


@dataclass(frozen=True)
class Measured:
    """An optimum on one mesh.

    Attributes:
        spacing: s, of the equal intervals of a uniform mesh; 0 on others.
        seconds: in the solver, on this mesh; `cumulated` with those before it.
    """

    problem: Problem
    iterate: Iterate
    evidence: Evidence
    spacing: float
    seconds: float
    cumulated: float

    @property
    def nodes(self) -> int:
        return self.problem.intervals + 1

    @property
    def race_time(self) -> float:
        """s."""
        return float(self.iterate.durations.sum())

    @property
    def drift(self) -> float:
        """Largest distance of the Hamiltonian from -1."""
        return float(self.evidence.drift.max())

    @property
    def defect(self) -> float:
        """Largest deviation of the replay from a node, scaled."""
        return float(self.evidence.check.defect.max())


@dataclass(frozen=True)
class Comparison:
    """Of one course.

    Attributes:
        result: what the procedure found.
        refined: the meshes that it solved on; the last one is its answer.
        halved: that one with all intervals halved, once and more.
        uniform: from coarse to fine.
        reference: the race time to compare with, s.
    """

    name: str
    result: StageResult
    refined: tuple[Measured, ...]
    halved: tuple[Measured, ...]
    uniform: tuple[Measured, ...]
    reference: float

    @property
    def answer(self) -> Measured:
        return self.refined[-1]

    @property
    def uncertainty(self) -> float:
        """How far the last halving moved the race time, s."""
        return abs(self.halved[-1].race_time - self.halved[-2].race_time)

    def error(self, one: Measured) -> float:
        """Of the race time, s."""
        return abs(one.race_time - self.reference)

    def as_accurate(self, measure: str) -> Measured | None:
        """The smallest uniform mesh that is as accurate as the answer; None if not even the finest is."""
        return next((one for one in self.uniform if MEASURES[measure](self, one)), None)

    def share(self, measure: str) -> float:
        """Nodes of the answer per node of that mesh; of the finest one, where none is as accurate: an upper bound."""
        return self.answer.nodes / (self.as_accurate(measure) or self.uniform[-1]).nodes


MEASURES: Mapping[str, Callable[[Comparison, Measured], bool]] = {
    "race time": lambda course, one: course.error(one) <= course.error(course.answer),
    "Hamiltonian": lambda course, one: one.drift <= course.answer.drift,
    "both": lambda course, one: all(MEASURES[name](course, one) for name in ("race time", "Hamiltonian")),
    "replay": lambda course, one: one.defect <= course.answer.defect,
}
"""Whether a mesh is as accurate as the answer."""


@dataclass(frozen=True)
class Solve:
    """One call of the solvers."""

    problem: Problem
    solution: Solution | None
    seconds: float


@dataclass
class RecordingBench(SolverSession):
    """Keeps what is solved on it."""

    solves: list[Solve] = field(default_factory=list[Solve])

    def solve(
        self, problem: Problem, guess: Iterate, purpose: str, *, barrier: float, **others: Any
    ) -> Solution | None:  # Any: as the solver session has them
        before = len(self.attempts)
        solution = super().solve(problem, guess, purpose, barrier=barrier, **others)
        seconds = sum(attempt.seconds for attempt in self.attempts[before:])
        self.solves.append(Solve(problem, solution, seconds))
        return solution


class Comparer:
    """Measures meshes of one course at one stage."""

    def __init__(self, flight: Flight, session: RecordingBench) -> None:
        self._flight = flight
        self._session = session

    def measured(self, solve: Solve, spacing: float, before: float) -> Measured | None:
        """What a solve has found; None if it has not. `before` are the seconds of those before it."""
        solution = solve.solution
        if solution is None or not solution.success:
            return None
        limits = self._session.settings.certificate
        evidence = examine(solve.problem, solution.iterate, solution.multipliers.constraints, limits)
        return Measured(solve.problem, solution.iterate, evidence, spacing, solve.seconds, before + solve.seconds)

    def chain(self) -> list[Measured]:
        """All optima that the bench has seen so far; seconds of solves that failed count, too."""
        found: list[Measured] = []
        before = 0.0
        for solve in self._session.solves:
            one = self.measured(solve, 0.0, before)
            before += solve.seconds
            found += [one] if one is not None else []
        return found

    def halved(self, one: Measured) -> Measured:
        """All intervals cut in two."""
        parts = np.full(one.problem.intervals, 2)
        mesh, guess = divide(one.problem.mesh, one.iterate, one.evidence.flown, parts)
        finer = self._solved(mesh, guess, 0.0, one.cumulated)
        if finer is None:
            raise NotComparable("the solver gave up on the refined mesh with all intervals halved")
        return finer

    def uniform(self, start: Measured, spacings: Sequence[float]) -> list[Measured]:
        """Equal intervals of about so many seconds, each solved from the one before; what fails is left out."""
        found: list[Measured] = []
        for spacing in spacings:
            source = found[-1] if found else start
            mesh = [uniform(max(2, round(T / spacing))) for T in source.iterate.durations]
            one = self._solved(mesh, carried(source, mesh), spacing, source.cumulated)
            found += [one] if one is not None else []
        return found

    def _solved(self, mesh: Mesh, guess: Iterate, spacing: float, before: float) -> Measured | None:
        problem = self._flight.problem(mesh)
        self._session.solve(problem, guess, f"{problem.intervals} intervals", barrier=REFINED_BARRIER)
        return self.measured(self._session.solves[-1], spacing, before)


def uniform(count: int) -> tuple[float, ...]:
    """So many equal fractions."""
    return (1.0 / count,) * count


def carried(source: Measured, mesh: Mesh) -> Iterate:
    """An optimum on another mesh: the states of its replay, and the mean of what its controls do in each interval."""
    states, controls = [], []
    flown, iterate = source.evidence.flown.state, source.iterate
    for phase, fractions, (first, last) in zip(
        source.problem.phases, mesh, itertools.pairwise(source.problem.first_node), strict=True
    ):
        new, lengths = np.concatenate([[0.0], np.cumsum(fractions)]), np.asarray(phase.fractions)
        old = np.concatenate([[0.0], np.cumsum(lengths)])
        samples = np.append((old[:-1, None] + lengths[:, None] * np.arange(SAMPLES) / SAMPLES).ravel(), old[-1])
        history = np.hstack([flown[:, first:last, :-1].reshape(len(flown), -1), iterate.state[:, last : last + 1]])
        states.append(np.stack([np.interp(new[:-1], samples, row) for row in history]))
        integrals = np.cumsum(np.pad(iterate.control[:, first:last] * lengths, ((0, 0), (1, 0))), axis=1)
        controls.append(np.diff(np.stack([np.interp(new, old, row) for row in integrals]), axis=1) / np.diff(new))
    return Iterate(iterate.durations, np.hstack([*states, iterate.state[:, -1:]]), np.hstack(controls))


def compared(name: str, race: Race, settings: Settings, stage: Stage) -> Comparison:
    """Fly a course on all meshes.

    Raises:
        NotComparable: no certified flight, or the uniform meshes lead to another one.
    """
    settings = dataclasses.replace(settings, guess=GuessKind.PLAN, search=SearchEffort.OFF)
    with SolverService(threads=1) as service:
        ladder, session = FidelityContinuation(race, settings, ()), RecordingBench(service, settings, Silent())
        for one in wanted_stages(settings, stage):
            session.begin()
            session.solves.clear()
            result = ladder.climb(one, session)
            if not result.certified:
                raise NotComparable(f"no certified flight: {one.value}: {result.message}")
        return followed_up(name, result, Comparer(ladder.flight(stage), session), settings)


def followed_up(name: str, result: StageResult, comparer: Comparer, settings: Settings) -> Comparison:
    """The other meshes of a course that the procedure has flown, as the comparer's bench has seen it."""
    refined = comparer.chain()
    halved = [refined[-1]]
    for _ in range(HALVINGS):
        halved.append(comparer.halved(halved[-1]))
    meshes = comparer.uniform(refined[0], FINER)
    meshes += comparer.uniform(meshes[0] if meshes else refined[0], COARSER)
    course = Comparison(name, result, tuple(refined), tuple(halved[1:]), in_order(meshes), halved[-1].race_time)
    difference = course.error(course.uniform[-1]) if course.uniform else math.inf
    if difference > settings.certificate.race_time:
        raise NotComparable(f"the finest uniform mesh leads to another flight: {1e3 * difference:.1f} ms beside it")
    for measure in MEASURES:
        for _ in range(BISECTIONS):
            course = bisected(course, measure, comparer)
    return course


def bisected(course: Comparison, measure: str, comparer: Comparer) -> Comparison:
    """With a mesh between the first uniform one that is as accurate and the one before it, if there are both."""
    first = course.as_accurate(measure)
    place = course.uniform.index(first) if first is not None else 0
    if first is None or place == 0:  # the coarsest mesh is one of the steps
        return course
    spacing = math.sqrt(course.uniform[place - 1].spacing * first.spacing)
    steps = [one for one in course.uniform[:place] if one.spacing in (*COARSER, *FINER)]
    between = comparer.uniform(steps[-1], [spacing])  # not from another one between: nobody would pay for that
    return dataclasses.replace(course, uniform=in_order([*course.uniform, *between]))


def in_order(meshes: Iterable[Measured]) -> tuple[Measured, ...]:
    """From coarse to fine; of several with as many nodes the first."""
    by_nodes: dict[int, Measured] = {}
    for one in meshes:
        by_nodes.setdefault(one.nodes, one)
    return tuple(by_nodes[nodes] for nodes in sorted(by_nodes))
