"""The certificate of a result: measured items, each with its limit.

A result is certified only if every item holds and one of them compares it with the optimum on a coarser mesh.
"""

import math

from airrace.records import record

RACE_TIME_CHANGE = "race_time_change"
"""The item that compares a race time with that on a coarser mesh: without it nothing is known of what the mesh does."""


@record
class Item:
    """A measured value with the largest one that still holds.

    Attributes:
        name: stable identifier, e.g. `kkt_error`.
        value: what was measured, in `unit`.
        limit: largest value that still holds; infinite for what is only measured.
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


@record
class Certificate:
    """All measured items of one result, and the solver's own words."""

    solver_status: str
    items: tuple[Item, ...]

    @property
    def holds(self) -> bool:
        """Whether all that was measured holds."""
        return bool(self.items) and all(item.holds for item in self.items)

    @property
    def compares_meshes(self) -> bool:
        """Whether the race time was compared with that on a coarser mesh."""
        return any(item.name == RACE_TIME_CHANGE for item in self.items)

    @property
    def certified(self) -> bool:
        """Whether all that was measured holds, and nothing was left out."""
        return self.holds and self.compares_meshes

    @property
    def undecided(self) -> tuple[Item, ...]:
        """The items that are only measured, and are not zero."""
        return tuple(item for item in self.items if math.isinf(item.limit) and item.value > 0.0)

    @property
    def failed(self) -> tuple[Item, ...]:
        """The items that do not hold."""
        return tuple(item for item in self.items if not item.holds)
