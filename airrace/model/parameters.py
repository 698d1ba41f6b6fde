"""The numbers of a race that users set: key, value, unit, usual step, bounds, and how a model gets another value.

`--set`, sensitivities and the analysis of infeasible courses share this class. A model (an element of a course, a race)
names its own parameters; `lift` makes those of a part the parameters of the whole.
"""

import dataclasses
import math
from collections.abc import Callable
from enum import Enum
from typing import Any, Generic, TypeVar, cast

from airrace.optimal_control.quantities import DEGREE, KNOT, Interval

Model = TypeVar("Model")
Whole = TypeVar("Whole")

FACTORS = {"deg": DEGREE, "deg/s": DEGREE, "kt": KNOT, "kW": 1000.0}
"""The SI value of the units that are not SI."""
OWN_STEPS = {
    "latitude_deg": 1e-5,
    "longitude_deg": 1e-5,  # about a metre
    "roughness_m": 0.0,
    "wing_span_m": 0.0,
    "mean_chord_m": 0.0,
    "static_thrust_N": 0.0,
}
"""The usual steps of keys whose unit would mislead; 0 stands for one per cent of the value."""
LOAD_FACTORS = ("n_z_max", "n_z_min", "n_y_max", "n_z_min_low", "n_z_min_ends")
"""The keys in g, which carry no unit."""
UNITS = {
    "kg_m2": ("kg m2", 0.0),
    "rad_s2": ("rad/s2", 0.0),
    "deg_s": ("deg/s", 1.0),
    "rad_s": ("rad/s", 0.0),
    "per_s": ("1/s", 0.0),
    "g_s": ("g/s", 1.0),
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
    "g": ("g", 0.1),
}
"""The name and the usual step of the unit that a key ends with, longer endings first; 0 means one per cent."""


class ParameterGroup(Enum):
    """The part of the inputs that a parameter belongs to."""

    TRACK = "track"
    AIRCRAFT = "aircraft"
    RULES = "rules"
    ENVIRONMENT = "environment"


@dataclasses.dataclass(frozen=True)
class Scale:
    """The function of a value in proportion to which the equations change, and its inverse."""

    forward: Callable[[float], float] = float
    inverse: Callable[[float], float] = float


LINEAR = Scale()
TANGENT = Scale(lambda value: math.tan(math.radians(value)), lambda tangent: math.degrees(math.atan(tangent)))
"""Of an angle in degrees."""
SINE = Scale(
    lambda value: math.sin(math.radians(value)), lambda sine: math.degrees(math.asin(max(-1.0, min(1.0, sine))))
)
"""Of an angle in degrees."""


@dataclasses.dataclass(frozen=True)
class Parameter(Generic[Model]):
    """A number of a model, in the unit of its key.

    Attributes:
        key: as `--set` takes it; its last part ends with the unit.
        value: in the model as it is.
        set: returns a model with another value; may raise `InputError`.
        label: what it is, for people.
        at: the element it belongs to; empty where it holds everywhere.
        relaxing_step: a usual step towards a milder limit, with its sign; 0 for a number that is no limit.
        limit: the value up to which relaxing makes sense.
        bounds: the values that the inputs allow.
        digit: what it is rounded to for people; 0 for the usual step.
        scale: what of the value enters the equations in proportion.
    """

    key: str
    value: float
    set: Callable[[Model, float], Model]
    label: str = ""
    at: str = ""
    relaxing_step: float = 0.0
    limit: float = math.nan
    bounds: Interval = Interval()
    digit: float = 0.0
    scale: Scale = LINEAR

    @property
    def group(self) -> ParameterGroup:
        """The part of the inputs that it belongs to."""
        first = self.key.partition(".")[0]
        if first in ("aircraft", "rules", "environment"):
            return ParameterGroup(first)
        return ParameterGroup.ENVIRONMENT if self.key == "origin.elevation_m" else ParameterGroup.TRACK

    @property
    def unit(self) -> str:
        """The unit of the value: "g" for load factors, "1" for plain numbers."""
        return unit_and_step(self.key)[0]

    @property
    def usual_step(self) -> float:
        """The change that is usually argued about: 1 m, 1 deg, 1 kt, 0.1 g, else 1 % of the value (0.01 at zero)."""
        # One per cent where the unit has no step of its own.
        return unit_and_step(self.key)[1] or 0.01 * (abs(self.value) or 1.0)

    # Relaxing it, in steps.

    @property
    def local(self) -> bool:
        """Whether it holds at one place alone."""
        return self.key.startswith(("gates.", "crowd.", "obstacles.", "safety_lines."))

    @property
    def can_relax(self) -> bool:
        """Whether there is room to relax it."""
        return (self.limit - self.value) * self.relaxing_step > 0.0

    @property
    def milder(self) -> float:
        """The value after one relaxing step, or after half of the room that is left where that is less."""
        room = self.limit - self.value
        return self.value + (self.relaxing_step if abs(room) > abs(self.relaxing_step) else 0.5 * room)

    @property
    def steps_max(self) -> float:
        """The number of steps, in proportion, to the limit."""
        now = self.scale.forward(self.value)
        return (self.scale.forward(self.limit) - now) / (self.scale.forward(self.milder) - now)

    def at_steps(self, steps: float) -> float:
        """Return the value after so many steps, in proportion to what enters the equations."""
        now, milder = self.scale.forward(self.value), self.scale.forward(self.milder)
        return self.scale.inverse(now + steps * (milder - now))

    def round_milder(self, value: float) -> float:
        """Return a value rounded to the milder side, up to the limit."""
        nearer = min if self.relaxing_step > 0.0 else max
        return nearer(self._round(value, upwards=self.relaxing_step > 0.0), self.limit)

    def round_stricter(self, value: float) -> float:
        """Return a value rounded to the stricter side, down to the value in the model as it is."""
        nearer = max if self.relaxing_step > 0.0 else min
        return nearer(self._round(value, upwards=self.relaxing_step < 0.0), self.value)

    def _round(self, value: float, *, upwards: bool) -> float:
        digit = self.digit or self.usual_step
        digits = max(0, -math.floor(math.log10(digit)))
        rounding = math.ceil if upwards else math.floor
        return round(rounding(round(value / digit, 6)) * digit, digits)


def unit_and_step(key: str) -> tuple[str, float]:
    """Return the unit that a key names and its usual step; a step of 0 means one per cent of the value."""
    name = key.rpartition(".")[2]
    if name in LOAD_FACTORS:
        return "g", 0.1
    unit, step = next((unit_step for ending, unit_step in UNITS.items() if name.endswith(f"_{ending}")), ("1", 0.0))
    return unit, OWN_STEPS.get(name, step)


def attribute_parameter(model: Model, key: str, path: str, **declared: Any) -> Parameter[Model]:
    """Return the parameter behind an attribute in SI or radians.

    Args:
        model: of records.
        key: whose unit is that of the parameter.
        path: attributes and indices of tuples, joined by dots.
        declared: the other attributes of the parameter.
    """
    unit, names = unit_and_step(key)[0], path.split(".")
    factor, value = FACTORS.get(unit, 1.0), cast(Any, model)
    for name in names:
        value = _member(value, name)
    now = value if factor == 1.0 else round(value / factor, 9)
    return Parameter(key, now, lambda model, new: _replace(model, names, new * factor), **declared)


def lift(
    parameter: Parameter[Model], prefix: str, change: Callable[[Whole, Callable[[Model], Model]], Whole], at: str = ""
) -> Parameter[Whole]:
    """Return a part's parameter as one of the whole.

    Args:
        parameter: of the part.
        prefix: of its key.
        change: returns the whole with a function applied to the part.
        at: the name of the part.
    """

    def change_part(model: Whole, value: float) -> Whole:
        return change(model, lambda part: parameter.set(part, value))

    part: Parameter[Any] = parameter
    return dataclasses.replace(part, key=f"{prefix}{parameter.key}", set=change_part, at=at)


def _member(model: Any, name: str) -> Any:
    return model[int(name)] if name.isdigit() else getattr(model, name)


def _replace(model: Any, names: list[str], value: float) -> Any:
    """Return a model of records and tuples with another value at a path."""
    if not names:
        return value
    changed = _replace(_member(model, names[0]), names[1:], value)
    if names[0].isdigit():
        return (*model[: int(names[0])], changed, *model[int(names[0]) + 1 :])
    return dataclasses.replace(model, **{names[0]: changed})
