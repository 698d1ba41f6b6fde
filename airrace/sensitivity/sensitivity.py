"""What a number of the inputs costs in race time: its shadow price, its unit and its usual step."""

import math
from enum import Enum

from airrace.records import record

ONE_PER_CENT = 0.01
"""The usual step of numbers whose unit has no step of its own, as a share of the value."""
OWN_STEPS = {
    "latitude_deg": 1e-5,
    "longitude_deg": 1e-5,  # about a metre
    "roughness_m": 0.0,
    "wing_span_m": 0.0,
    "mean_chord_m": 0.0,
    "static_thrust_N": 0.0,
}
"""The usual steps of keys whose unit would mislead; 0 stands for one per cent of the value."""
LOAD_FACTORS = {"n_z_max": 0.1, "n_z_min": 0.1, "n_y_max": 0.1}
"""The usual steps in g of the keys that carry no unit because a load factor has none."""
UNITS = {
    "kg_m2": ("kg m2", 0.0),
    "rad_s2": ("rad/s2", 0.0),
    "deg_s": ("deg/s", 1.0),
    "rad_s": ("rad/s", 0.0),
    "per_s": ("1/s", 0.0),
    "m_s": ("m/s", 1.0),
    "deg": ("deg", 1.0),
    "hPa": ("hPa", 1.0),
    "kW": ("kW", 0.0),
    "kt": ("kt", 1.0),
    "kg": ("kg", 1.0),
    "m2": ("m2", 0.0),
    "K": ("K", 1.0),
    "N": ("N", 0.0),
    "m": ("m", 1.0),
    "s": ("s", 0.0),
}
"""The name and the usual step of the unit that a key ends with, longer endings first.

A step of 0 means one per cent of the value.
"""


class ParameterGroup(Enum):
    """A group of numbers, by the part of the inputs to which they belong."""

    TRACK = "track"
    AIRCRAFT = "aircraft"
    RULES = "rules"
    ENVIRONMENT = "environment"


class Activity(Enum):
    """The sides of a number's value on which the number matters."""

    BOTH = "both"
    ONE_SIDED = "one-sided"
    FREE = "free"


@record
class Price:
    """The derivative of the objective by one number of the inputs.

    Attributes:
        key: the key that `--set` takes.
        group: whose number it is.
        unit: the unit of the number, "1" without one.
        value: the number now, in its unit.
        upward: the price for larger values, s per unit; NaN if the inputs allow none.
        downward: the price for smaller values, s per unit (positive if those make the race faster); NaN likewise.
        usual_step: what is usually argued about: 1 m, 1 deg, 1 kt, 0.1 g, 1 %, ...; in the unit.
        activity: to which sides the number matters.
        note: why the price is one-sided, a clause; empty otherwise.
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
    def price(self) -> float:
        """The price in seconds per unit: the mean of both sides, or the only one there is."""
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
        """The larger of both costs by size, s: what prices are sorted by."""
        return max(abs(cost) for cost in (self.cost_up, self.cost_down) if math.isfinite(cost))

    def as_object(self) -> dict[str, object]:
        """Return plain values for scripts; null where the inputs allow no value to that side."""
        return {
            "group": self.group.value,
            "unit": self.unit,
            "value": self.value,
            "s_per_unit": self.price,
            "s_per_unit_up": _number(self.upward),
            "s_per_unit_down": _number(self.downward),
            "usual_step": self.usual_step,
            "step_up_s": _number(self.cost_up),
            "step_down_s": _number(self.cost_down),
            "activity": self.activity.value,
            "note": self.note,
        }


def group_of(key: str) -> ParameterGroup:
    """Return the group of the number that a key names."""
    first = key.partition(".")[0]
    if first in (ParameterGroup.AIRCRAFT.value, ParameterGroup.RULES.value, ParameterGroup.ENVIRONMENT.value):
        return ParameterGroup(first)
    return ParameterGroup.ENVIRONMENT if key == "origin.elevation_m" else ParameterGroup.TRACK


def unit_of(key: str) -> str:
    """Return the unit that a key names; "g" for load factors, "1" for numbers without one."""
    name = key.rpartition(".")[2]
    return "g" if name in LOAD_FACTORS else _ending(name)[0]


def usual_step(key: str, value: float) -> float:
    """Return the step of a number that is usually argued about, in its unit.

    It is one per cent of the value where the unit has no step of its own, and a hundredth of the unit where that value
    is zero.
    """
    name = key.rpartition(".")[2]
    step = LOAD_FACTORS.get(name, OWN_STEPS.get(name, _ending(name)[1]))
    return step or ONE_PER_CENT * (abs(value) or 1.0)


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _ending(name: str) -> tuple[str, float]:
    for ending, meant in UNITS.items():
        if name.endswith(f"_{ending}"):
            return meant
    return "1", 0.0
