"""The validity of a problem: names that exist, meshes and durations that are possible.

A bound or a weight under a misspelt name would silently be dropped, and a mesh whose fractions add up to 0.9 would fly
another problem than the one that was stated. Such problems are refused before anything is built from them. Limits that
contradict one another are no mistake of this kind: the solver answers that the problem is infeasible.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from airrace.optimal_control.problem import Boundary, PathConstraint, Phase, Problem
from airrace.quantities import Quantity
from airrace.system import Observation

WHOLE = 1e-6
"""The largest deviation from 1 of the sum of a phase's fractions (1).

The fractions that `1 / n` repeated n times, halving and merging leave of thousands of intervals miss it by less than
1e-12; a mesh that was mistyped misses it by a whole interval.
"""


def require_valid(problem: Problem) -> None:
    """Refuse a problem that would silently mean something else than it says.

    Raises:
        ValueError: a name is misspelt or means two things, numbers are missing or too many, the fractions of a phase
            are no shares of it, a duration may be negative, a weight or a jump is no number, or a jump leads nowhere.
    """
    if not problem.phases:
        raise ValueError("the problem has no phases")
    _check_system(problem)
    _check_objective(problem)
    for phase in problem.phases:
        _check_phase(problem, phase)
    if problem.phases[-1].jump:
        raise ValueError(f"no phase follows the jump at the end of phase {problem.phases[-1].name!r}")
    _check_boundary(problem, problem.start)


def _check_system(problem: Problem) -> None:
    system = problem.system
    declared = Counter(one.name for one in (*system.states, *system.controls, *system.path))
    if twice := [name for name, count in declared.items() if count > 1]:
        raise ValueError(f"system {system.name!r} declares twice: {', '.join(sorted(twice))}")
    _require_count(f"system {system.name!r}", system.parameters, problem.parameters)


def _check_objective(problem: Problem) -> None:
    system, objective = problem.system, problem.objective
    seen = _seen(objective.observation)
    _require_known("the objective weighs unknown states", objective.terminal, (*system.states, *seen))
    if both := {one.name for one in system.states} & {one.name for one in seen}:
        raise ValueError(f"the objective may mean a state or what is observed: {', '.join(sorted(both))}")
    parameters = objective.observation.parameters if objective.observation is not None else ()
    _require_count("the objective", parameters, objective.values)
    _require_known("the objective regularises unknown controls", objective.regularisation, system.controls)
    for name, weight in {"time": objective.time, **objective.terminal, **objective.regularisation}.items():
        if not math.isfinite(weight):
            raise ValueError(f"the objective weighs {name} by {weight}")
    for name, weight in objective.regularisation.items():
        if weight < 0.0:
            raise ValueError(f"the objective regularises {name} by {weight}, which must not be negative")


def _check_phase(problem: Problem, phase: Phase) -> None:
    system = problem.system
    # Comparisons with NaN are false, so everything is asked the way in which NaN fails.
    if not all(fraction > 0.0 for fraction in phase.fractions) or not abs(sum(phase.fractions) - 1.0) <= WHOLE:
        raise ValueError(f"the fractions of phase {phase.name!r} are not positive, or do not add up to 1")
    if not phase.duration.lower >= 0.0:
        raise ValueError(f"phase {phase.name!r} may not last {phase.duration.lower} s")
    along = (*system.states, *system.controls, *system.path)
    _require_known(f"phase {phase.name!r} bounds unknown quantities", phase.bounds, along)
    _require_known(f"the jump at the end of phase {phase.name!r} changes unknown states", phase.jump, system.states)
    for name, change in phase.jump.items():
        if not math.isfinite(change):
            raise ValueError(f"the jump at the end of phase {phase.name!r} changes {name} by {change}")
    for watch in phase.watches:
        _check_watch(watch)
    _check_boundary(problem, phase.end)


def _check_watch(watch: PathConstraint) -> None:
    seen = watch.observation.quantities
    _require_known(f"watch {watch.name!r} bounds unknown quantities", watch.bounds, seen)
    _require_count(f"watch {watch.name!r}", watch.observation.parameters, watch.values)


def _check_boundary(problem: Problem, boundary: Boundary) -> None:
    seen = _seen(boundary.observation)
    declared = (*problem.system.states, *seen)
    _require_known(f"boundary {boundary.name!r} bounds unknown quantities", boundary.bounds, declared)
    parameters = boundary.observation.parameters if boundary.observation is not None else ()
    _require_count(f"boundary {boundary.name!r}", parameters, boundary.values)


def _seen(observation: Observation | None) -> tuple[Quantity, ...]:
    return observation.quantities if observation is not None else ()


def _require_known(complaint: str, names: Mapping[str, Any], declared: Iterable[Quantity]) -> None:  # Any: values
    """Refuse names that nothing was declared under."""
    if unknown := names.keys() - {quantity.name for quantity in declared}:
        raise ValueError(f"{complaint}: {', '.join(sorted(unknown))}")


def _require_count(whose: str, declared: tuple[Quantity, ...], values: tuple[float, ...]) -> None:
    if len(values) != len(declared):
        raise ValueError(f"{whose} declares {len(declared)} parameters, and {len(values)} values are given")
