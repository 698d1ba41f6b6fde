"""Sensitivities of the race time: what every number of the inputs costs, its shadow price, unit and usual step, and
what it costs to be late."""

import math
from dataclasses import dataclass
from enum import Enum

from airrace.model.parameters import ParameterGroup


class Activity(Enum):
    """The sides of a number's value on which the number matters."""

    BOTH = "both"
    ONE_SIDED = "one-sided"
    FREE = "free"


@dataclass(frozen=True)
class Sensitivity:
    """The derivative of the objective by one number of the inputs.

    Attributes:
        key: the key that `--set` takes.
        group: whose number it is.
        unit: the unit of the number, "1" without one.
        value: the number now, in its unit.
        upward: the derivative towards larger values, s per unit; NaN if the inputs allow none.
        downward: that towards smaller values, s per unit (positive if those make the race faster); NaN likewise.
        usual_step: what is usually argued about: 1 m, 1 deg, 1 kt, 0.1 g, 1 %, ...; in the unit.
        activity: to which sides the number matters.
        note: why it is one-sided, a clause; empty otherwise.
    """

    key: str
    group: ParameterGroup
    unit: str
    value: float
    upward: float
    downward: float
    usual_step: float
    activity: Activity
    note: str = ""

    @property
    def per_unit(self) -> float:
        """The derivative, s per unit: the mean of both sides, or the only one there is."""
        sides = [side for side in (self.upward, self.downward) if math.isfinite(side)]
        return sum(sides) / len(sides)

    @property
    def cost_up(self) -> float:
        """The cost of a usual step up, s; negative if it gains time, NaN if the inputs allow none."""
        return self.upward * self.usual_step

    @property
    def cost_down(self) -> float:
        """The cost of a usual step down, s; negative if it gains time, NaN if the inputs allow none."""
        return -self.downward * self.usual_step

    @property
    def weight(self) -> float:
        """The larger of both costs by size, s: what sensitivities are sorted by."""
        return max(abs(cost) for cost in (self.cost_up, self.cost_down) if math.isfinite(cost))

    def as_object(self) -> dict[str, object]:
        """Return plain values for scripts; null where the inputs allow no value to that side."""
        numbers = {
            "value": self.value,
            "s_per_unit": self.per_unit,
            "s_per_unit_up": self.upward,
            "s_per_unit_down": self.downward,
            "usual_step": self.usual_step,
            "step_up_s": self.cost_up,
            "step_down_s": self.cost_down,
        }
        return {
            "group": self.group.value,
            "unit": self.unit,
            **{name: number if math.isfinite(number) else None for name, number in numbers.items()},
            "activity": self.activity.value,
            "note": self.note,
        }


@dataclass(frozen=True)
class LatenessPrice:
    """What an act costs that is not done in time.

    Attributes:
        delay: by which it is late or early, s.
        late, early: the time lost, s; None where no flight was found from there on that meets all gates and limits,
            and of `early` where the act begins with the race.
    """

    delay: float
    late: float | None
    early: float | None
