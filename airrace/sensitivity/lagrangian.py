"""Shadow prices of the inputs' numbers, by the Lagrangian of a stored optimum.

At an optimum w with multipliers lam (of the constraints) and nu (of the simple bounds), positive at upper ends,

    dV = lam . (dg/dp dp - d limit) - nu . d bound

is the change of the optimal objective V with parameters p and limits. The objective itself does not contain them. So
every multiplier is gathered once where its limit comes from, and a problem with other numbers is valued by a sum.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from airrace.errors import CheckpointError, InputError, NotCertified
from airrace.inputs.inputs import Inputs
from airrace.inputs.variation import Variation
from airrace.optimal_control.assembly import Assembly
from airrace.optimal_control.evaluation import Evaluation
from airrace.optimal_control.kernels import Kernels, build_kernels
from airrace.optimal_control.layout import Layout, narrow_range
from airrace.optimal_control.problem import Boundary, Iterate, Problem
from airrace.parameters import Parameter, ParameterGroup
from airrace.planning.race import Race
from airrace.procedure.models import iterate_of
from airrace.procedure.perturbed import PerturbedProblem
from airrace.procedure.result import StageResult, Status
from airrace.quantities import Interval, Quantity
from airrace.records import record
from airrace.sensitivity.sensitivity import Activity, Price
from airrace.trajectory import Array

SHARE = 1e-5
"""The step of the constraints' central differences, as a share of a parameter, or of its scale."""
WEAK = 1e2
"""The ratio of multiplier and slack (scaled) within which, to either side, a limit is weakly active.

An interior point method leaves their product equal everywhere, 1e-8, so that weak multipliers lie between 1e-5 and
1e-3.
"""

DEPTH, HEIGHT = "z", "height"
"""The name of a state, and of what a crossing observes of it: a limit of the one is a limit of the other."""

Place = tuple[int, int]
"""The phases before and after a node, by their indices; within a phase both are the same."""


class OtherStructureError(Exception):
    """An error of a problem that differs from the one that was solved in more than numbers."""


@record
class Value:
    """The part of a problem's value that its numbers decide, s: by surely active limits, and by weakly active ones."""

    strong: float
    weak: float


@dataclass
class _Multipliers:
    """The multipliers of both limits of one quantity at one place, summed, lower end first, s per unit."""

    strong: Array = field(default_factory=lambda: np.zeros(2))
    weak: Array = field(default_factory=lambda: np.zeros(2))

    def add(self, multiplier: float, *, weak: bool) -> None:
        (self.weak if weak else self.strong)[1 if multiplier > 0.0 else 0] += multiplier


@record
class _Ends:
    """The pulls on one quantity at one place, and how its limits there are read from a problem."""

    limits: Callable[[Problem], Interval]
    pull: _Multipliers = field(default_factory=_Multipliers)


Owner = tuple[str, int, int]
"""The owner of an observation: a boundary ("boundary", its number, 0) or a watch ("watch", phase, its number there)."""


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
        self._problem = problem
        self._layout = layout = Layout(problem)
        # A watch of all legs is one object in all phases of any such problem; it counts as its last phase's.
        self._owners = {id(bounds): owner for owner, bounds, _ in _observed(problem)}
        self._ends: dict[object, _Ends] = {}
        functions = Evaluation(Assembly(layout, kernels))
        w, p = layout.pack(iterate), layout.parameter_values()
        functions.at(w, p)
        g = functions.g.copy()
        lam, weak = _active(lam, g, *layout.constraint_bounds())
        nu, barely = _active(nu, w, *layout.unknown_bounds())
        self._gather_rows(lam, weak)
        self._gather_bounds(nu / layout.scale, barely)
        self._ends = {key: ends for key, ends in self._ends.items() if ends.pull.strong.any() or ends.pull.weak.any()}
        self._of_system = _by_system_parameters(functions, layout, w, p, lam)
        self._of_owners = _by_observed_parameters(functions, layout, w, p, lam)

    def value(self, problem: Problem) -> Value:
        """Return what the numbers of a problem of the same structure are worth; only differences have a meaning.

        Raises:
            OtherStructureError: the problem differs in more than numbers.
        """
        if not _alike(problem, self._problem):
            raise OtherStructureError
        strong, weak = float(self._of_system @ np.asarray(problem.parameters)), 0.0
        for owner, _, values in _observed(problem):
            strong += float(self._of_owners[owner] @ np.asarray(values)) if values else 0.0
        for ends in self._ends.values():
            limits = ends.limits(problem)
            for end, limit in enumerate((limits.lower, limits.upper)):
                for pull in (ends.pull.strong[end], ends.pull.weak[end]):
                    if pull and not math.isfinite(limit):
                        raise OtherStructureError
                if math.isfinite(limit):
                    strong -= float(ends.pull.strong[end]) * limit
                    weak -= float(ends.pull.weak[end]) * limit
        return Value(strong, weak)

    def _at(self, key: object, limits: Callable[[Problem], Interval]) -> _Multipliers:
        return self._ends.setdefault(key, _Ends(limits)).pull

    def _gather_rows(self, lam: Array, weak: Array) -> None:
        layout = self._layout
        places, depth = _places(layout), _depth(layout.problem)
        for row, place in zip(layout.flat_rows, layout.row_index.tolist(), strict=True):
            if lam[place] == 0.0:
                continue
            if row.source < 0:
                key, limits = ("path", row.component, places[row.node]), _path_limits(row.component, places[row.node])
            else:
                owner, name = self._owners[id(layout.output_samples[row.source].bounds)], row.quantity.name
                key, limits = (owner, name), _observed_limits(owner, name)
                if owner[0] == "boundary" and name == HEIGHT:
                    # Floor and least height of a gate bound the same height; the tighter one has the whole multiplier.
                    at = (owner[1] - 1, owner[1])
                    key, limits = ("state", depth, at), _state_limits(depth, at)
                    self._at(key, limits).add(-float(lam[place]) / row.quantity.scale, weak=bool(weak[place]))
                    continue
            self._at(key, limits).add(float(lam[place]) / row.quantity.scale, weak=bool(weak[place]))

    def _gather_bounds(self, nu: Array, weak: Array) -> None:
        """Gather the multipliers of the bounds of states and controls.

        Those of the durations come from the plan, which is kept.
        """
        layout = self._layout
        places = _places(layout)
        for node, component in np.argwhere(nu[layout.state_index] != 0.0).tolist():
            at = int(layout.state_index[node, component])
            pull = self._at(("state", component, places[node]), _state_limits(component, places[node]))
            pull.add(float(nu[at]), weak=bool(weak[at]))
        for interval, component in np.argwhere(nu[layout.control_index] != 0.0).tolist():
            at, phase = int(layout.control_index[interval, component]), int(layout.phase_of_interval[interval])
            pull = self._at(("control", component, phase), _control_limits(component, phase))
            pull.add(float(nu[at]), weak=bool(weak[at]))


def _active(multiplier: Array, value: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the multipliers without those of limits that are not active, and which of the rest are weak."""
    slack = np.where(multiplier > 0.0, upper - value, value - lower)
    size = np.abs(multiplier)
    fixed = lower == upper
    active = fixed | (np.isfinite(slack) & (size * WEAK > slack))
    weak = active & ~fixed & (size < WEAK * slack)
    return np.where(active, multiplier, 0.0), weak


def _places(layout: Layout) -> list[Place]:
    """Return the place of every node."""
    after = [*layout.phase_of_interval.tolist(), len(layout.problem.phases)]
    before = [-1, *layout.phase_of_interval.tolist()]
    return list(zip(before, after, strict=True))


def _boundary(problem: Problem, number: int) -> Boundary:
    return problem.start if number == 0 else problem.phases[number - 1].end


def _observed(problem: Problem) -> Iterator[tuple[Owner, Mapping[str, Interval], tuple[float, ...]]]:
    """Yield whatever observes: its limits and the parameters of its observation, in the order of the program."""
    for number in range(len(problem.phases) + 1):
        boundary = _boundary(problem, number)
        if boundary.observation is not None:
            yield ("boundary", number, 0), boundary.bounds, boundary.values
    for index, phase in enumerate(problem.phases):
        for number, watch in enumerate(phase.watches):
            yield ("watch", index, number), watch.bounds, watch.values


def _alike(one: Problem, other: Problem) -> bool:
    """Return whether two problems have the same parameters and the same conditions, apart from their numbers."""

    def structure(problem: Problem) -> object:
        system = problem.system
        observed = [
            (owner, len(values), {name: _kind(limits) for name, limits in bounds.items()})
            for owner, bounds, values in _observed(problem)
        ]
        named = [[quantity.name for quantity in part] for part in (system.states, system.controls, system.path)]
        return len(problem.parameters), named, observed

    return structure(one) == structure(other)


def _kind(limits: Interval) -> tuple[bool, bool]:
    return math.isfinite(limits.lower), math.isfinite(limits.upper)


# The limits of a problem, read from where they are stated.


def _path_limits(component: int, place: Place) -> Callable[[Problem], Interval]:
    return lambda problem: _narrowed(problem, problem.system.path[component], place)


def _state_limits(component: int, place: Place) -> Callable[[Problem], Interval]:
    def limits(problem: Problem) -> Interval:
        state = problem.system.states[component]
        along = _narrowed(problem, state, place)
        if place[0] == place[1]:
            return along
        bounds = _boundary(problem, place[1]).bounds
        if state.name == DEPTH and HEIGHT in bounds:
            along = along.intersect(Interval(-bounds[HEIGHT].upper, -bounds[HEIGHT].lower))
        return along.intersect(bounds.get(state.name, Interval()))

    return limits


def _depth(problem: Problem) -> int:
    """Return the index of z among the states."""
    return [state.name for state in problem.system.states].index(DEPTH)


def _control_limits(component: int, phase: int) -> Callable[[Problem], Interval]:
    return lambda problem: narrow_range(problem.system.controls[component], problem.phases[phase].bounds)


def _observed_limits(owner: Owner, name: str) -> Callable[[Problem], Interval]:
    kind, first, second = owner
    if kind == "boundary":
        return lambda problem: _boundary(problem, first).bounds.get(name, Interval())
    return lambda problem: problem.phases[first].watches[second].bounds.get(name, Interval())


def _narrowed(problem: Problem, quantity: Quantity, place: Place) -> Interval:
    """Return the limits of a quantity at a place: those of all phases that meet there."""
    limits = Interval()
    for phase in place:
        if 0 <= phase < len(problem.phases):
            limits = limits.intersect(narrow_range(quantity, problem.phases[phase].bounds))
    return limits


# The derivatives of the constraints by parameters.


def _by_system_parameters(functions: Evaluation, layout: Layout, w: Array, p: Array, lam: Array) -> Array:
    """Return lam . dg/dp of the system's parameters, shape (n_p,)."""
    declared = layout.problem.system.parameters
    worth = np.zeros(len(declared))
    for index, quantity in enumerate(declared):
        step = np.zeros_like(p)
        step[index] = SHARE * max(abs(p[index]), quantity.scale)
        worth[index] = float(_change(functions, w, p, step) @ lam) / (2.0 * step[index])
    return worth


def _by_observed_parameters(
    functions: Evaluation, layout: Layout, w: Array, p: Array, lam: Array
) -> dict[Owner, Array]:
    """Return lam . dg/db of the parameters of every boundary and watch, by its owner.

    A row depends on the parameters of its own observation alone, so those of all observations are moved at once.
    """
    observed = list(_observed(layout.problem))
    sizes = np.array([len(values) for _, _, values in observed], dtype=np.int64)
    first = len(layout.problem.parameters) + layout.intervals + np.concatenate([[0], np.cumsum(sizes)[:-1]])
    numbers = {id(bounds): number for number, (_, bounds, _) in enumerate(observed)}
    rows = [
        (place, numbers[id(layout.output_samples[row.source].bounds)])
        for row, place in zip(layout.flat_rows, layout.row_index.tolist(), strict=True)
        if row.source >= 0
    ]
    places, owner_of = (np.array(column, dtype=np.int64) for column in zip(*rows, strict=True))
    worth = np.zeros((len(observed), int(sizes.max(initial=0))))
    for component in range(worth.shape[1]):
        having = np.flatnonzero(sizes > component)
        step = np.zeros_like(p)
        at = first[having] + component
        step[at] = SHARE * np.maximum(np.abs(p[at]), 1.0)
        change = _change(functions, w, p, step)[places] * lam[places]
        sums = np.bincount(owner_of, change, len(observed))
        worth[having, component] = sums[having] / (2.0 * step[at])
    return {owner: worth[number, : sizes[number]] for number, (owner, _, _) in enumerate(observed)}


def _change(functions: Evaluation, w: Array, p: Array, step: Array) -> Array:
    functions.at(w, p + step)
    upper = functions.g.copy()
    functions.at(w, p - step)
    return upper - functions.g


STEP = 1e-3
"""The share of a usual step by which a number is changed."""
FREE = 1e-6
"""The cost of a usual step below which a number is free, s."""
SAME = 0.02
"""The share of the larger price by which the prices to both sides may differ and still count as one."""


def prices(
    inputs: Inputs, result: StageResult, *, groups: frozenset[ParameterGroup] = frozenset(ParameterGroup)
) -> dict[str, Price]:
    """Return the price of every number that `--set` reaches, from the stored multipliers, with nothing solved again.

    A price is the derivative of the stage's objective (race time and regularisation, whose weights are kept) on the
    stored mesh, along the stored route. Prices are sorted by what a usual step costs, the largest first. A number
    that cannot be changed alone without changing the structure of the problem has no price and is left out.

    Args:
        inputs: what the run was given.
        result: a stage of it that holds. A price is one of the stored mesh, whose conditions of optimality were
            measured, so that it does not matter whether the race time was compared with that on a second mesh.
        groups: whose numbers are priced.

    Returns:
        Prices by key.

    Raises:
        NotCertified: the stage is no optimum, certified or solved.
        CheckpointError: the stored multipliers do not belong to a flight of these inputs.
    """
    if not result.holds:
        raise NotCertified(_uncertified(result))
    parameters = Variation(inputs).parameters.values()
    varied = PerturbedProblem.of_result(inputs.race, inputs.settings, result)
    worth = _lagrangian_sensitivity(varied, inputs, result)

    def value(parameter: Parameter[Race], number: float) -> Value | None:
        try:
            return worth.value(varied.problem(parameter.set(inputs.race, number)))
        except (InputError, OtherStructureError):
            return None

    pricer = _ParameterSensitivity(worth.value(varied.problem(inputs.race)), value)
    found = [pricer.price(parameter) for parameter in parameters if parameter.group in groups]
    priced = [price for price in found if price is not None]
    return {price.key: price for price in sorted(priced, key=lambda one: (-one.weight, one.key))}


def _uncertified(result: StageResult) -> str:
    if result.certificate is None:
        return f"{result.stage.value} is a guess and no optimum: only a certified or solved stage has sensitivities"
    ended = "" if result.outcome in (Status.SOLVED, Status.NOT_CERTIFIED) else f", it ended {result.outcome.value}"
    return f"{result.stage.value} is not certified{ended}: only a certified or solved stage has sensitivities"


def _lagrangian_sensitivity(varied: PerturbedProblem, inputs: Inputs, result: StageResult) -> LagrangianSensitivity:
    problem, iterate = varied.problem(inputs.race), iterate_of(result.trajectory)
    layout, stage = Layout(problem), result.stage.value
    fits = result.constraint_multipliers.shape == (layout.constraints,)
    if not fits or result.bound_multipliers.shape != (layout.unknowns,):
        raise CheckpointError(
            f"{stage}: {result.constraint_multipliers.size} multipliers are stored, "
            f"but the race has {layout.constraints} constraints on this mesh"
        )
    kernels = build_kernels(problem.system, problem.scheme)
    return LagrangianSensitivity(problem, iterate, result.constraint_multipliers, result.bound_multipliers, kernels)


@record
class _Slopes:
    """The derivatives of the value to one side, s per unit: by surely active limits, and by weakly active ones."""

    strong: float
    weak: float

    @property
    def whole(self) -> float:
        return self.strong + self.weak


@record
class _ParameterSensitivity:
    """A pricer of numbers, one by one; `now` is the value of the race as flown, `value` that with a number changed."""

    now: Value
    value: Callable[[Parameter[Race], float], Value | None]

    def price(self, parameter: Parameter[Race]) -> Price | None:
        """Return the price of a number; None if it can be changed to neither side."""
        step = parameter.usual_step
        up, down = self._slopes(parameter, STEP * step), self._slopes(parameter, -STEP * step)
        if up is None and down is None:
            return None
        upward, downward, activity, note = _judged(up, down, step)
        return Price(
            key=parameter.key,
            group=parameter.group,
            unit=parameter.unit,
            value=parameter.value,
            upward=upward,
            downward=downward,
            usual_step=step,
            activity=activity,
            note=note,
        )

    def _slopes(self, parameter: Parameter[Race], change: float) -> _Slopes | None:
        after = self.value(parameter, parameter.value + change)
        if after is None:
            return None
        return _Slopes((after.strong - self.now.strong) / change, (after.weak - self.now.weak) / change)


def _judged(up: _Slopes | None, down: _Slopes | None, step: float) -> tuple[float, float, Activity, str]:
    """Return the prices to both sides, to which sides they matter, and why if that is but one."""
    if up is None or down is None:
        only = (up or down or _Slopes(0.0, 0.0)).whole
        sides = (only if up else math.nan, only if down else math.nan)
        free = abs(only) * step < FREE
        refused = "larger" if up is None else "smaller"
        activity = Activity.FREE if free else Activity.ONE_SIDED
        return *sides, activity, "" if free else f"the inputs allow no {refused} value"
    if abs(up.strong) * step < FREE and abs(down.strong) * step < FREE and (up.weak or down.weak):
        # The limit is touched, but its multiplier vanishes: tightening it costs time, relaxing it gains none.
        return max(up.weak, 0.0), min(down.weak, 0.0), Activity.ONE_SIDED, "at its edge: touched, but barely"
    upward, downward = up.whole, down.whole
    larger = max(abs(upward), abs(downward))
    if larger * step < FREE:
        return upward, downward, Activity.FREE, ""
    if abs(upward - downward) > SAME * larger:
        return upward, downward, Activity.ONE_SIDED, _taking_over(upward, downward, step)
    return upward, downward, Activity.BOTH, ""


def _taking_over(upward: float, downward: float, step: float) -> str:
    if abs(upward) * step < FREE:
        return "at its edge: more is free, another limit holds"
    if abs(downward) * step < FREE:
        return "at its edge: less is free, another limit holds"
    return "at its edge: the price differs from side to side"
