"""The legs around a phase as a problem of their own: whether they are feasible, and without which limit.

The window begins in any way that the gate before it allows, and nothing follows it. If it is infeasible, so is the
whole race.
"""

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from airrace.optimal_control.problem import Iterate, PathConstraint, Phase, Problem
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.replay import replay
from airrace.optimal_control.solvers.interface import Ending, SolverOptions
from airrace.procedure.formulation import without_pilot, without_trim
from airrace.procedure.guess import concatenate, phase_piece
from airrace.procedure.solver_session import SolverSession

OPTIONS = SolverOptions(tolerance=1e-3, iterations_max=200, barrier=0.1, curvature=False)
"""A feasible flight is enough."""
FAILING_ITERATIONS = 120
"""The largest number of iterations of the primary solver."""
INFEASIBLE_ITERATIONS_MAX = 300
"""The largest number of iterations of a solve that is to report infeasibility: IPOPT took 90 to 260."""
REACH = 2
"""The number of legs before and after the infeasible one in a window."""
WINDOWS_MAX = 4
"""The largest number of windows that are solved: where limits contradict each other on one leg, a solver may leave
the largest gap on another. On a generated course it was four legs away."""
POSITION = ("along", "right", "height", "x", "y", "z")
"""The names of the conditions on the position."""
LIMITS = (
    ("z", "height between floor and ceiling", "m", -1.0),
    ("n_z", "load factor", "g", 1.0),
    ("C_L", "lift coefficient", "", 1.0),
    ("p_Kbar", "roll rate", "deg/s", 180.0 / math.pi),
    ("V_K", "speed", "m/s", 1.0),
)
"""The limits along the path in the order in which they are left out: name, text, unit, factor from SI."""


@dataclasses.dataclass(frozen=True)
class LocalInfeasibility:
    """A phase around which no guess leads to a flight; `worst` is the condition that was violated most."""

    problem: Problem
    guess: Iterate
    phase: int
    worst: str


def find_local_infeasibility(
    session: SolverSession,
    problem: Problem,
    phase: int,
    guesses: Sequence[Iterate],
    race_is_in_conflict: Callable[[], bool] | None = None,
) -> LocalInfeasibility | None:
    """Return the infeasibility of the window around a phase; None unless it is confirmed.

    The primary solver has to fail from every guess. Then limits have to give way along every plan of the race, or else
    the fallback solver, if there is one, has to report local infeasibility from every guess. A solve that runs out of
    budget has not failed.

    Args:
        session: solves.
        problem: of the race.
        phase: that could not be added.
        guesses: of the race.
        race_is_in_conflict: returns whether limits have to give way along every plan; None if that is not computed.
    """
    primary, *fallbacks = session.solvers
    if race_is_in_conflict is None and not fallbacks:
        return None

    options = {solver: dataclasses.replace(OPTIONS, iterations_max=INFEASIBLE_ITERATIONS_MAX) for solver in fallbacks}
    options[primary] = dataclasses.replace(OPTIONS, iterations_max=FAILING_ITERATIONS)
    worst = ""
    for solver in session.solvers:
        for guess in guesses:
            window, start, _ = _window(problem, phase, guess)
            solution = session.attempt(window, start, "the legs around it alone", solver, options[solver])
            if solution is None or solution.success or solution.ending is Ending.BUDGET_EXHAUSTED:
                return None
            if solver != primary and not solution.infeasible:
                return None
            worst = solution.worst
        if solver == primary:
            if race_is_in_conflict is not None and race_is_in_conflict():
                break
            if not fallbacks:
                return None
    return LocalInfeasibility(problem, guesses[0], phase, worst)


def diagnose_window(session: SolverSession, problem: Problem, end: Iterate, guess: Iterate, worst: str) -> str | None:
    """Return the binding limit and its place as a sentence; None if all windows that are solved are feasible.

    Args:
        session: solves.
        problem: without a solution.
        end: where the solver gave up.
        guess: where it started.
        worst: the condition that is violated most there; reported where no limit is found, for a solver spreads a
            conflict over what gives way most easily.
    """
    defects = np.nan_to_num(np.abs(replay(problem, end).defect).max(axis=0), nan=-1.0)
    largest = np.maximum.reduceat(defects, problem.first_node[:-1])
    centres: list[int] = []
    for phase in np.argsort(-largest, kind="stable").tolist():
        if len(centres) < WINDOWS_MAX and all(abs(phase - centre) > REACH for centre in centres):
            centres.append(phase)
            window, start, _ = _window(problem, phase, guess)
            if not _is_feasible(session, window, start, "the legs around it alone"):
                return binding_limit(session, LocalInfeasibility(problem, guess, phase, worst))
    return None


def binding_limit(session: SolverSession, infeasibility: LocalInfeasibility) -> str:
    """Return the sentence of `diagnose_window` for a window that is known to be infeasible."""
    window, start, first = _window(infeasibility.problem, infeasibility.phase, infeasibility.guess)
    where = f"the limits contradict each other at {infeasibility.problem.phases[infeasibility.phase].name}"
    for what, problem in without_one_limit(window, infeasibility.phase - first):
        session.progress.activity(f"no flight found; trying without the limit of {what}", 0, 0)
        if _is_feasible(session, problem, start, f"without {what}"):
            return f"{where}; without the limit of {what} there is a flight"
    return f"{where}; no single limit is to blame" + (
        f"; most violated: {infeasibility.worst}" if infeasibility.worst else ""
    )


def _window(problem: Problem, phase: int, guess: Iterate) -> tuple[Problem, Iterate, int]:
    """Return the problem of the legs around a phase, a guess's part of it, and the index of its first leg."""
    first, last = max(0, phase - REACH), min(len(problem.phases), phase + REACH + 1)
    start = problem.start
    if first > 0:
        before = problem.phases[first - 1].end
        start = dataclasses.replace(before, bounds={**before.bounds, "attitude_norm": Interval.exactly(1.0)})
    window = dataclasses.replace(problem, start=start, phases=problem.phases[first:last])
    return window, concatenate([phase_piece(guess, problem, index) for index in range(first, last)]), first


def _is_feasible(session: SolverSession, problem: Problem, guess: Iterate, purpose: str) -> bool:
    solution = session.attempt(problem, guess, purpose, session.settings.solver.primary, OPTIONS, beyond_budget=True)
    return solution is not None and solution.success


def without_one_limit(problem: Problem, phase: int) -> Iterator[tuple[str, Problem]]:
    """Yield a limit in words and the problem without it: lines and crowd, path, ends, gates around a phase."""

    def with_phase(index: int, changed: Phase) -> Problem:
        phases = (*problem.phases[:index], changed, *problem.phases[index + 1 :])
        return dataclasses.replace(problem, phases=phases)

    system, last = problem.system, len(problem.phases) - 1
    for name in dict.fromkeys(_name(constraint) for leg in problem.phases for constraint in leg.path_constraints):
        phases = (
            dataclasses.replace(
                leg,
                path_constraints=tuple(constraint for constraint in leg.path_constraints if _name(constraint) != name),
            )
            for leg in problem.phases
        )
        yield name, dataclasses.replace(problem, phases=tuple(phases))
    for name, text, unit, factor in LIMITS:
        for quantity in (*system.states, *system.path):
            if quantity.name == name:
                lower, upper = sorted((factor * quantity.lower, factor * quantity.upper))
                allowed = f"{lower:.4g} to {upper:.4g}" if math.isfinite(upper) else f"at least {lower:.4g}"
                states, path = _without_limit(system.states, name), _without_limit(system.path, name)
                free = dataclasses.replace(system, states=states, path=path)
                yield f"{text} ({f'{allowed} {unit}'.rstrip()})", dataclasses.replace(problem, system=free)
    begin, *ends = (without_pilot(boundary) for boundary in problem.boundaries)
    if [boundary.bounds for boundary in (begin, *ends)] != [boundary.bounds for boundary in problem.boundaries]:
        phases = (dataclasses.replace(leg, end=end) for leg, end in zip(problem.phases, ends, strict=True))
        free = dataclasses.replace(problem, start=begin, phases=tuple(phases))
        yield "the pilot's limits at gates", free
    start, finish = without_trim(problem.start), without_trim(problem.phases[last].end)
    if start.bounds != problem.start.bounds:
        yield "a settled start", dataclasses.replace(problem, start=start)
    if finish.bounds != problem.phases[last].end.bounds:
        yield "a settled finish", with_phase(last, dataclasses.replace(problem.phases[last], end=finish))
    for index in (phase, phase - 1):
        if index >= 0:
            leg = problem.phases[index]
            position = {name: bounds for name, bounds in leg.end.bounds.items() if name in POSITION}
            end = dataclasses.replace(leg.end, bounds=position)
            yield (
                f"attitude and course at gate {leg.end.name}",
                with_phase(index, dataclasses.replace(leg, end=end)),
            )


def _name(constraint: PathConstraint) -> str:
    """Return the name of a path constraint; those at single nodes all keep clear of pylons."""
    return constraint.name if constraint.at is None else "the clearance from pylons in flight"


def _without_limit(quantities: Sequence[Quantity], name: str) -> tuple[Quantity, ...]:
    """Return quantities with one of them free along the path; speeds stay positive, which the equations need."""
    freed: list[Quantity] = []
    for quantity in quantities:
        if quantity.name == name:
            lower = 0.3 * quantity.lower if quantity.unit == "m/s" else -math.inf
            quantity = dataclasses.replace(quantity, lower=lower, upper=math.inf)
        freed.append(quantity)
    return tuple(freed)
