"""Declarations of scalars, each with its unit, scale, bounds and meaning, and typed vectors of such scalars.

A vector is a frozen dataclass, generic in its scalar type, so that the same class holds symbols (casadi `SX`),
numbers or whole histories (one numpy row per quantity):

    @vector
    class Position(Vector[T]):
        x: T = quantity("m", scale=100.0, text="north of the origin")
        y: T = quantity("m", scale=100.0, text="east of the origin")

    Position.split(ca.SX.sym("r", 2)).x
    Position(x=1.0, y=2.0).join()
"""

import dataclasses
import math
from collections.abc import Sequence
from decimal import Decimal
from typing import Any, Generic, Self, TypeVar, dataclass_transform

T = TypeVar("T")
# Any: one formula serves casadi SX, MX, floats and numpy rows; no common type says so.
Scalar = Any

KNOT = 1852.0 / 3600.0
"""One knot in m/s."""
DEGREE = math.pi / 180.0
"""One degree in rad."""
FOOT = 0.3048
"""One foot in m."""


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A declared scalar: its name, unit, scale, bounds and meaning.

    Attributes:
        name: the symbol it has in equations and tables.
        unit: the SI unit.
        scale: its typical size.
        lower, upper: its bounds, which may be infinite.
        text: what it is, for people.
        rate_of: the name of the state whose time derivative this state or control is; empty where it is none.
    """

    name: str
    unit: str
    scale: float = 1.0
    lower: float = -math.inf
    upper: float = math.inf
    text: str = ""
    rate_of: str = dataclasses.field(default="", metadata={"counts": "where set"})


@dataclasses.dataclass(frozen=True)
class Interval:
    """A closed range of a quantity; `Interval.exactly(v)` has no width."""

    lower: float = -math.inf
    upper: float = math.inf

    @classmethod
    def exactly(cls, value: float) -> "Interval":
        return cls(value, value)

    @classmethod
    def between(cls, lower: float | None, upper: float | None) -> "Interval":
        """Return a range whose absent ends are unbounded."""
        return cls(-math.inf if lower is None else lower, math.inf if upper is None else upper)

    @classmethod
    def degrees(cls, lower: float | None, upper: float | None) -> "Interval":
        """Return a range in radians from ends in degrees; absent ends are unbounded."""
        ends = cls.between(lower, upper)
        return cls(math.radians(ends.lower), math.radians(ends.upper))

    def intersect(self, interval: "Interval") -> "Interval":
        return Interval(max(self.lower, interval.lower), min(self.upper, interval.upper))

    @property
    def constrained(self) -> bool:
        """Whether at least one end is finite."""
        return math.isfinite(self.lower) or math.isfinite(self.upper)

    @property
    def empty(self) -> bool:
        return self.lower > self.upper


def plain_number(value: float, digits: int = 3) -> str:
    """Return a number to so many significant digits, never with an exponent.

    Examples:
        >>> plain_number(187.3, 2), plain_number(0.00002512), plain_number(9.0)
        ('190', '0.0000251', '9')
    """
    return format(Decimal(f"{value:.{digits}g}"), "f")


def quantity(
    unit: str,
    *,
    scale: float = 1.0,
    lower: float = -math.inf,
    upper: float = math.inf,
    text: str = "",
    rate_of: str = "",
) -> Any:  # Any: a dataclass field stands in for a value of the field's own type
    """Declare one component of a `Vector`."""
    declared = Quantity("", unit, scale, lower, upper, text, rate_of)
    return dataclasses.field(metadata={"quantity": declared})


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(quantity,))
def vector(cls: type[T]) -> type[T]:
    """Make a subclass of `Vector` a frozen, keyword-only dataclass (a class decorator)."""
    return dataclasses.dataclass(frozen=True, kw_only=True)(cls)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Vector(Generic[T]):
    """The base of all typed vectors; the order of the fields is the order of the components."""

    @classmethod
    def quantities(cls) -> tuple[Quantity, ...]:
        """Return the declarations of the components, each with its field's name."""
        return tuple(
            dataclasses.replace(field.metadata["quantity"], name=field.name) for field in dataclasses.fields(cls)
        )

    @classmethod
    def names(cls) -> tuple[str, ...]:
        return tuple(field.name for field in dataclasses.fields(cls))

    @classmethod
    def size(cls) -> int:
        return len(dataclasses.fields(cls))

    @classmethod
    def split(cls, column: Any) -> Self:  # Any: SX, MX, ndarray alike
        """Return a vector of the components of a column, or of the rows of a history."""
        return cls(**{name: column[index] for index, name in enumerate(cls.names())})

    def join(self) -> Sequence[T]:
        """Return the components in order, as a list (`ca.vertcat(*v.join())`, `np.array(v.join())`)."""
        return [getattr(self, name) for name in self.names()]
