"""A relaxable parameter: a number of a race that may be relaxed, in its user's unit."""

import math
from collections.abc import Callable

from airrace.planning.race import Race
from airrace.records import record


@record
class RelaxableParameter:
    """A number that may be relaxed.

    Attributes:
        key: that `--set` takes.
        text: what it is, for people.
        at: the gate that it belongs to, by its key; empty where it holds all along.
        unit: of its value; empty for a number.
        value: as it is.
        step: a usual change to the milder side, with its sign.
        digit: the unit of the last digit that is told of it.
        furthest: the last value that makes sense.
        changed: makes the race with another value.
        curve: what of the value enters the equations in proportion.
        inverse: the value from that.
        settable_from: the least value that the inputs allow.
    """

    key: str
    text: str
    at: str
    unit: str
    value: float
    step: float
    digit: float
    furthest: float
    changed: Callable[[Race, float], Race]
    curve: Callable[[float], float] = float
    inverse: Callable[[float], float] = float
    settable_from: float = -math.inf

    @property
    def told(self) -> str:
        """The words for what it is, and at which gate."""
        return f"{self.text} at {self.at}" if self.at else self.text

    @property
    def local(self) -> bool:
        """Whether it holds at one place alone."""
        return self.key.startswith(("gates.", "crowd.", "safety_lines."))

    @property
    def of_aircraft(self) -> bool:
        """Whether it is the aircraft's number, which no race director can change."""
        return self.key.startswith("aircraft.")

    @property
    def milder(self) -> float:
        """The value after a usual step, or half of what is left where that is less."""
        room = self.furthest - self.value
        return self.value + (self.step if abs(room) > abs(self.step) else 0.5 * room)

    @property
    def steps_max(self) -> float:
        """The number of steps, in proportion, to the last value that makes sense."""
        return self._steps(self.furthest)

    def at_steps(self, steps: float) -> float:
        """Return the value after so many steps, taken in proportion to what enters the equations."""
        now, milder = self.curve(self.value), self.curve(self.milder)
        return self.inverse(now + steps * (milder - now))

    def _steps(self, value: float) -> float:
        now, milder = self.curve(self.value), self.curve(self.milder)
        return (self.curve(value) - now) / (milder - now)

    def usual_steps(self, value: float) -> float:
        """Return how many usual steps a value is away."""
        return (value - self.value) / self.step

    def settable(self, value: float) -> bool:
        """Return whether the inputs allow a value."""
        return value >= self.settable_from

    def rounded(self, value: float) -> float:
        """Return a value rounded to the milder side in the last digit that is told, within what makes sense."""
        whole = math.ceil if self.step > 0.0 else math.floor
        digits = max(0, -math.floor(math.log10(self.digit)))
        told = round(whole(round(value / self.digit, 6)) * self.digit, digits)
        return min(told, self.furthest) if self.step > 0.0 else max(told, self.furthest)
