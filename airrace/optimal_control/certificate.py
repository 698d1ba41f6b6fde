"""The certificate of a result: measured items, each with its limit.

A result is certified only if every item holds.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Item:
    """A measured value with the largest one that still holds.

    Attributes:
        name: stable identifier, e.g. `kkt_error`.
        value: what was measured, in `unit`.
        limit: largest value that still holds.
        unit: unit of both.
        where: where the worst value was found, for people ("phase 3 g4, C_L"); empty if nowhere in particular.
    """

    name: str
    value: float
    limit: float
    unit: str = ""
    where: str = ""

    @property
    def holds(self) -> bool:
        """Whether the value keeps the limit; NaN never does."""
        return self.value <= self.limit


@dataclass(frozen=True)
class Certificate:
    """All measured items of one result, and the solver's own words."""

    solver_status: str
    items: tuple[Item, ...]

    @property
    def certified(self) -> bool:
        """Whether there are items and all of them hold."""
        return bool(self.items) and all(item.holds for item in self.items)

    @property
    def failed(self) -> tuple[Item, ...]:
        """The items that do not hold."""
        return tuple(item for item in self.items if not item.holds)
