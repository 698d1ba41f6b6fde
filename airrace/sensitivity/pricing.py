"""The pricing of every number in the inputs of an optimum that holds."""

import math
from collections.abc import Callable

from airrace.errors import CheckpointError, InputError, NotCertified
from airrace.inputs.inputs import Inputs
from airrace.inputs.variation import Variation
from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.procedure.models import iterate_of
from airrace.procedure.perturbed import PerturbedProblem
from airrace.procedure.result import Outcome, StageResult
from airrace.records import record
from airrace.sensitivity.price import Activity, Group, Price, group_of, unit_of, usual_step
from airrace.sensitivity.worth import OtherStructureError, Value, Worth

STEP = 1e-3
"""The share of a usual step by which a number is changed."""
FREE = 1e-6
"""The cost of a usual step below which a number is free, s."""
SAME = 0.02
"""The share of the larger price by which the prices to both sides may differ and still count as one."""


def prices(inputs: Inputs, result: StageResult, *, groups: frozenset[Group] = frozenset(Group)) -> dict[str, Price]:
    """Return the price of every number that `--set` reaches, from the stored multipliers, with nothing solved again.

    A price is the derivative of the stage's objective (race time and regularisation, whose weights are kept) on the
    stored mesh, along the stored way round. Prices are sorted by what a usual step costs, the dearest first. A number
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
    variation = Variation(inputs)
    varied = PerturbedProblem.of_result(inputs.race, inputs.settings, result)
    worth = _worth(varied, inputs, result)

    def value(key: str, number: float) -> Value | None:
        try:
            return worth.value(varied.problem(variation.race(key, number)))
        except (InputError, OtherStructureError):
            return None

    pricer = _Pricer(worth.value(varied.problem(inputs.race)), value)
    chosen = {key: number for key, number in variation.numbers.items() if group_of(key) in groups}
    priced = [price for key, number in chosen.items() if (price := pricer.price(key, number)) is not None]
    return {price.key: price for price in sorted(priced, key=lambda one: (-one.weight, one.key))}


def _uncertified(result: StageResult) -> str:
    if result.certificate is None:
        return f"{result.stage.value} is a guess and no optimum: only a certified or solved stage has prices"
    ended = "" if result.outcome in (Outcome.SOLVED, Outcome.NOT_CERTIFIED) else f", it ended {result.outcome.value}"
    return f"{result.stage.value} is not certified{ended}: only a certified or solved stage has prices"


def _worth(varied: PerturbedProblem, inputs: Inputs, result: StageResult) -> Worth:
    problem, iterate = varied.problem(inputs.race), iterate_of(result.trajectory)
    layout, stage = Layout(problem), result.stage.value
    fits = result.constraint_multipliers.shape == (layout.constraints,)
    if not fits or result.bound_multipliers.shape != (layout.unknowns,):
        raise CheckpointError(
            f"{stage}: {result.constraint_multipliers.size} multipliers are stored, "
            f"but the race has {layout.constraints} constraints on this mesh"
        )
    kernels = build_kernels(problem.system, problem.scheme)
    return Worth(problem, iterate, result.constraint_multipliers, result.bound_multipliers, kernels)


@record
class _Slopes:
    """The derivatives of the value to one side, s per unit: by surely active limits, and by weakly active ones."""

    strong: float
    weak: float

    @property
    def whole(self) -> float:
        return self.strong + self.weak


@record
class _Pricer:
    """A pricer of numbers, one by one; `now` is the value of the race as flown, `value` that with a number changed."""

    now: Value
    value: Callable[[str, float], Value | None]

    def price(self, key: str, number: float) -> Price | None:
        """Return the price of a number; None if it can be changed to neither side."""
        step = usual_step(key, number)
        up, down = self._slopes(key, number, STEP * step), self._slopes(key, number, -STEP * step)
        if up is None and down is None:
            return None
        upward, downward, activity, note = _judged(up, down, step)
        return Price(
            key=key,
            group=group_of(key),
            unit=unit_of(key),
            value=number,
            upward=upward,
            downward=downward,
            usual_step=step,
            activity=activity,
            note=note,
        )

    def _slopes(self, key: str, number: float, change: float) -> _Slopes | None:
        after = self.value(key, number + change)
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
