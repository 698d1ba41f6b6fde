"""Sensitivities of the race time to the inputs' numbers, by the Lagrangian of a stored optimum.

At an optimum w with multipliers lam (of the constraints) and nu (of the simple bounds), positive at upper ends,

    dV = lam . (dg/dp dp - d limit) - nu . d bound

is the change of the optimal objective V with parameters p and limits. The objective itself does not contain them. So
every multiplier is gathered once where its limit comes from, and a problem with other numbers is evaluated by a sum.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from airrace.errors import CheckpointError, InputError, NotCertified
from airrace.flights.sensitivity import Activity, Sensitivity
from airrace.model.parameters import Parameter
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import Kernels, build_kernels
from airrace.optimal_control.layout import Layout, narrow_range
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.trajectory import Array
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.result import StageResult, Status
from airrace.procedure.settings import Settings
from airrace.procedure.stage_problem import OtherStructureError, PerturbedProblem
from airrace.race import Race

DIFFERENCE_STEP = 1e-5
"""The step of the constraints' central differences, as a share of a parameter, or of its scale."""
WEAK_RATIO = 1e2
"""The ratio of multiplier and slack (scaled) within which, to either side, a limit is weakly active. An interior point
method leaves their product equal everywhere, 1e-8, so that weak multipliers lie between 1e-5 and 1e-3."""
CHANGE_SHARE = 1e-3
"""The share of a usual step by which a number is changed."""
FREE_COST = 1e-6
"""The cost of a usual step below which a number is free, s."""
SAME_SIDES = 0.02
"""The share of the larger of both sides' sensitivities by which they may differ and still count as one."""
DEPTH, HEIGHT = "z", "height"
"""The name of a state, and of what a crossing observes of it: a limit of the one is a limit of the other."""

Place = tuple[int, int]
"""The phases before and after a node, by their indices; within a phase both are the same."""
Owner = tuple[str, Place]
"""The owner of an observation: ("boundary", (its number, 0)) or ("path constraint", (phase, its number there))."""


@dataclass(frozen=True)
class Value:
    """The part of a problem's value that its numbers decide, s: by surely active limits, and by weakly active ones."""

    strong: float
    weak: float


@dataclass(frozen=True)
class _LimitSource:
    """The place in a problem where the limits of some constraints are stated.

    Attributes:
        kind: `path`, `state` or `control` for a quantity of the system; `boundary` or `path constraint` for an
            observed one.
        place: of the quantity, or of its owner.
        component: of the quantity in the system.
        name: of an observed quantity.
    """

    kind: str
    place: Place
    component: int = 0
    name: str = ""

    def limits(self, problem: Problem) -> Interval:
        """Return the limits that a problem states."""
        first, second = self.place
        system = problem.system
        match self.kind:
            case "boundary":
                return problem.boundaries[first].bounds.get(self.name, Interval())
            case "path constraint":
                return problem.phases[first].path_constraints[second].bounds.get(self.name, Interval())
            case "control":
                return narrow_range(system.controls[self.component], problem.phases[first].bounds)
            case "path":
                return self._along(problem, system.path[self.component])
            case _:
                state = system.states[self.component]
                limits = self._along(problem, state)
                if first == second:
                    return limits
                bounds = problem.boundaries[second].bounds
                if state.name == DEPTH and HEIGHT in bounds:
                    limits = limits.intersect(Interval(-bounds[HEIGHT].upper, -bounds[HEIGHT].lower))
                return limits.intersect(bounds.get(state.name, Interval()))

    def _along(self, problem: Problem, quantity: Quantity) -> Interval:
        """Return the limits of a quantity that all phases state that meet at the place."""
        limits = Interval()
        for phase in self.place:
            if 0 <= phase < len(problem.phases):
                limits = limits.intersect(narrow_range(quantity, problem.phases[phase].bounds))
        return limits


class LagrangianSensitivity:
    """The values of problems that differ from a solved one in numbers alone."""

    def __init__(self, problem: Problem, iterate: Iterate, lam: Array, nu: Array, kernels: Kernels) -> None:
        """Gather the multipliers.

        Args:
            problem: the problem that was solved.
            iterate: its optimum.
            lam: multipliers of the constraints, shape (n_g,).
            nu: multipliers of the simple bounds, shape (n_w,).
            kernels: the kernels of the problem's system.
        """
        self._structure = _structure(problem)
        # The multipliers by their limits' source, s per unit, shape (2, 2): surely, weakly active; lower, upper end.
        self._multipliers: dict[_LimitSource, Array] = defaultdict(lambda: np.zeros((2, 2)))
        layout = Layout(problem)
        functions = Evaluation(Assembly(layout, kernels))
        w, p = layout.pack(iterate), layout.parameter_values()
        functions.at(w, p)
        g = functions.g.copy()
        lam, weak_rows = _active(lam, g, *layout.constraint_bounds())
        nu, weak_bounds = _active(nu, w, *layout.unknown_bounds())
        phase_of = layout.phase_of_interval.tolist()
        places = list(zip([-1, *phase_of], [*phase_of, len(problem.phases)], strict=True))
        self._gather_rows(layout, places, lam, weak_rows)
        self._gather_bounds(layout, places, nu / layout.scale, weak_bounds)
        self._of_system = _by_system_parameters(functions, layout, w, p, lam)
        self._of_owners = _by_observed_parameters(functions, layout, w, p, lam)

    def value(self, problem: Problem) -> Value:
        """Return what the numbers of a problem of the same structure contribute; only differences have a meaning.

        Raises:
            OtherStructureError: the problem differs in more than numbers.
        """
        if _structure(problem) != self._structure:
            raise OtherStructureError
        value = np.array([float(self._of_system @ np.asarray(problem.parameters)), 0.0])
        for owner, _, values in _observers(problem):
            value[0] += float(self._of_owners[owner] @ np.asarray(values)) if values else 0.0
        limits = [owner.limits(problem) for owner in self._multipliers]
        ends = np.array([(limit.lower, limit.upper) for limit in limits])
        multipliers, stated = np.array(list(self._multipliers.values())), np.isfinite(ends)
        if (multipliers.any(axis=1) & ~stated).any():
            raise OtherStructureError
        value -= np.sum(multipliers * np.where(stated, ends, 0.0)[:, None, :], axis=(0, 2))
        return Value(float(value[0]), float(value[1]))

    def _add(self, source: _LimitSource, multiplier: float, *, weak: bool) -> None:
        self._multipliers[source][int(weak), int(multiplier > 0.0)] += multiplier

    def _gather_rows(self, layout: Layout, places: list[Place], lam: Array, weak: Array) -> None:
        # A path constraint of all legs is one object in all phases of any such problem; it counts as its last phase's.
        owners = {id(bounds): owner for owner, bounds, _ in _observers(layout.problem)}
        depth = [state.name for state in layout.problem.system.states].index(DEPTH)
        for row, place in zip(layout.flat_rows, layout.row_index.tolist(), strict=True):
            if lam[place] == 0.0:
                continue
            multiplier = float(lam[place]) / row.quantity.scale
            if row.source < 0:
                source = _LimitSource("path", places[row.node], row.component)
            else:
                kind, at = owners[id(layout.output_samples[row.source].bounds)]
                source = _LimitSource(kind, at, name=row.quantity.name)
                if kind == "boundary" and source.name == HEIGHT:
                    # Floor and least height of a gate bound the same height; the tighter one has the whole multiplier.
                    source, multiplier = _LimitSource("state", (at[0] - 1, at[0]), depth), -multiplier
            self._add(source, multiplier, weak=bool(weak[place]))

    def _gather_bounds(self, layout: Layout, places: list[Place], nu: Array, weak: Array) -> None:
        """Gather the multipliers of the bounds of states and controls.

        Those of the durations come from the plan, which is fixed.
        """
        for node, component in np.argwhere(nu[layout.state_index] != 0.0).tolist():
            at = layout.state_index[node, component]
            self._add(_LimitSource("state", places[node], component), float(nu[at]), weak=bool(weak[at]))
        for interval, component in np.argwhere(nu[layout.control_index] != 0.0).tolist():
            at, phase = layout.control_index[interval, component], int(layout.phase_of_interval[interval])
            self._add(_LimitSource("control", (phase, phase), component), float(nu[at]), weak=bool(weak[at]))


def _active(multiplier: Array, value: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the multipliers without those of limits that are not active, and which of the rest are weak."""
    slack = np.where(multiplier > 0.0, upper - value, value - lower)
    size, fixed = np.abs(multiplier), lower == upper
    active = fixed | (np.isfinite(slack) & (size * WEAK_RATIO > slack))
    return np.where(active, multiplier, 0.0), active & ~fixed & (size < WEAK_RATIO * slack)


def _observers(problem: Problem) -> Iterator[tuple[Owner, Mapping[str, Interval], tuple[float, ...]]]:
    """Yield the limits and the parameters of every observation, in the order of the program."""
    for number, boundary in enumerate(problem.boundaries):
        if boundary.observation is not None:
            yield ("boundary", (number, 0)), boundary.bounds, boundary.values
    for index, phase in enumerate(problem.phases):
        for number, constraint in enumerate(phase.path_constraints):
            yield ("path constraint", (index, number)), constraint.bounds, constraint.values


def _structure(problem: Problem) -> object:
    """Return what problems have in common that differ in numbers alone: their parameters and conditions."""
    system = problem.system
    observed: list[object] = []
    for owner, bounds, values in _observers(problem):
        finite = {name: (math.isfinite(bound.lower), math.isfinite(bound.upper)) for name, bound in bounds.items()}
        observed.append((owner, len(values), finite))
    sizes = len(system.states), len(system.controls), len(system.path)
    names = [quantity.name for quantity in (*system.states, *system.controls, *system.path)]
    return len(problem.parameters), sizes, names, observed


def _by_system_parameters(functions: Evaluation, layout: Layout, w: Array, p: Array, lam: Array) -> Array:
    """Return lam . dg/dp of the system's parameters, shape (n_p,)."""
    declared = layout.problem.system.parameters
    slopes = np.zeros(len(declared))
    for index, quantity in enumerate(declared):
        step = np.zeros_like(p)
        step[index] = DIFFERENCE_STEP * max(abs(p[index]), quantity.scale)
        slopes[index] = float(_central_difference(functions, w, p, step) @ lam) / (2.0 * step[index])
    return slopes


def _by_observed_parameters(
    functions: Evaluation, layout: Layout, w: Array, p: Array, lam: Array
) -> dict[Owner, Array]:
    """Return lam . dg/db of the parameters of every boundary and path constraint, by its owner.

    A row depends on the parameters of its own observation alone, so those of all observations are moved at once.
    """
    observed = list(_observers(layout.problem))
    sizes = np.array([len(values) for _, _, values in observed], dtype=np.int64)
    first = len(layout.problem.parameters) + layout.intervals + np.concatenate([[0], np.cumsum(sizes)[:-1]])
    numbers = {id(bounds): number for number, (_, bounds, _) in enumerate(observed)}
    rows = [
        (place, numbers[id(layout.output_samples[row.source].bounds)])
        for row, place in zip(layout.flat_rows, layout.row_index.tolist(), strict=True)
        if row.source >= 0
    ]
    places, owner_of = (np.array(column, dtype=np.int64) for column in zip(*rows, strict=True))
    slopes = np.zeros((len(observed), int(sizes.max(initial=0))))
    for component in range(slopes.shape[1]):
        having = np.flatnonzero(sizes > component)
        step = np.zeros_like(p)
        at = first[having] + component
        step[at] = DIFFERENCE_STEP * np.maximum(np.abs(p[at]), 1.0)
        change = _central_difference(functions, w, p, step)[places] * lam[places]
        slopes[having, component] = np.bincount(owner_of, change, len(observed))[having] / (2.0 * step[at])
    return {owner: slopes[number, : sizes[number]] for number, (owner, _, _) in enumerate(observed)}


def _central_difference(functions: Evaluation, w: Array, p: Array, step: Array) -> Array:
    functions.at(w, p + step)
    upper = functions.g.copy()
    functions.at(w, p - step)
    return upper - functions.g


def sensitivities(
    parameters: Iterable[Parameter[Race]], race: Race, settings: Settings, result: StageResult
) -> Iterator[Sensitivity]:
    """Yield the sensitivity to every one of some numbers of a race, from the stored multipliers.

    Nothing is solved again. It is the derivative of the stage's objective (race time and regularisation, whose weights
    are fixed) on the stored mesh, along the stored route. A number that cannot be changed alone without changing the
    problem's structure is left out.

    Args:
        parameters: the numbers.
        race: the race of the stage.
        settings: with which it was solved.
        result: the stage. A sensitivity is one of the stored mesh, whose conditions of optimality were measured, so
            that it does not matter whether the race time was compared with that on a second mesh.

    Raises:
        NotCertified: the stage is no optimum, certified or solved, or was solved roughly.
        CheckpointError: the stored multipliers do not belong to a flight of this race.
    """
    if not result.holds:
        stage, requirement = result.stage.value, "only a certified or solved stage has sensitivities"
        if result.certificate is None:
            raise NotCertified(f"{stage} is a guess and no optimum: {requirement}")
        plain = result.outcome in (Status.SOLVED, Status.NOT_CERTIFIED)
        raise NotCertified(
            f"{stage} is not certified{'' if plain else f', it ended {result.outcome.value}'}: {requirement}"
        )
    if result.is_rough:
        raise NotCertified(
            f"{result.stage.value} was solved only as closely as the next stage needs, too roughly for sensitivities; "
            "`airrace resume RUN.h5 --mesh-check all` certifies it"
        )
    perturbed = PerturbedProblem.of_result(race, settings, result)
    problem = perturbed.problem(race)
    lagrangian = _lagrangian(problem, result)
    now = lagrangian.value(problem)

    def slope(parameter: Parameter[Race], change: float) -> Value | None:
        """Return the derivatives of the value to one side, s per unit; None if the inputs allow no such value."""
        try:
            after = lagrangian.value(perturbed.problem(parameter.set(race, parameter.value + change)))
        except (InputError, OtherStructureError):
            return None
        return Value((after.strong - now.strong) / change, (after.weak - now.weak) / change)

    for parameter in parameters:
        step = parameter.usual_step
        up, down = slope(parameter, CHANGE_SHARE * step), slope(parameter, -CHANGE_SHARE * step)
        if up is None and down is None:
            continue
        upward, downward, activity, note = _classify(up, down, step)
        yield Sensitivity(
            parameter.key, parameter.group, parameter.unit, parameter.value, upward, downward, step, activity, note
        )


def _lagrangian(problem: Problem, result: StageResult) -> LagrangianSensitivity:
    layout, lam, nu = Layout(problem), result.constraint_multipliers, result.bound_multipliers
    if lam.shape != (layout.constraints,) or nu.shape != (layout.unknowns,):
        raise CheckpointError(
            f"{result.stage.value}: {lam.size} multipliers are stored, "
            f"but the race has {layout.constraints} constraints on this mesh"
        )
    kernels = build_kernels(problem.system, problem.scheme)
    return LagrangianSensitivity(problem, iterate_of(result.trajectory), lam, nu, kernels)


def _classify(up: Value | None, down: Value | None, step: float) -> tuple[float, float, Activity, str]:
    """Return the sensitivities to both sides, to which sides the number matters, and why if that is but one."""
    free = FREE_COST / step
    if up is None or down is None:
        value = up or down
        assert value is not None
        only = value.strong + value.weak
        sides = (only if up else math.nan, only if down else math.nan)
        if abs(only) < free:
            return *sides, Activity.FREE, ""
        return *sides, Activity.ONE_SIDED, f"the inputs allow no {'larger' if up is None else 'smaller'} value"
    if abs(up.strong) < free and abs(down.strong) < free and (up.weak or down.weak):
        # The limit is touched, but its multiplier vanishes: tightening it costs time, relaxing it gains none.
        return max(up.weak, 0.0), min(down.weak, 0.0), Activity.ONE_SIDED, "at its edge: touched, but barely"
    upward, downward = up.strong + up.weak, down.strong + down.weak
    larger = max(abs(upward), abs(downward))
    if larger < free:
        return upward, downward, Activity.FREE, ""
    if abs(upward - downward) <= SAME_SIDES * larger:
        return upward, downward, Activity.BOTH, ""
    if abs(upward) < free:
        note = "more is free, another limit holds"
    elif abs(downward) < free:
        note = "less is free, another limit holds"
    else:
        note = "the sensitivity differs from side to side"
    return upward, downward, Activity.ONE_SIDED, f"at its edge: {note}"
