"""The certificate of a result: measured items, each with its limit.

A result is certified only if every item holds and one of them compares it with the optimum on a coarser mesh.
"""

import math
from dataclasses import dataclass
from enum import Enum, IntEnum

RACE_TIME_CHANGE = "race_time_change"
"""The item that compares a race time with that on a coarser mesh: without it nothing is known of what the mesh does."""
OBJECTIVE_CHANGE = "objective_change"
"""The same item of a problem whose objective is no race time."""
HAMILTONIAN_DRIFT = "hamiltonian_drift"
"""The item of the Hamiltonian's distance from -1, which only a good mesh keeps: a rough optimum goes without."""


class RefinementReason(IntEnum):
    """The reason for an interval's length: what its mesh was last made coarser or finer for."""

    FIRST = 0
    CALM = 1
    INTEGRATION = 2
    LIMITS = 3
    HAMILTONIAN = 4
    RACE_TIME = 5


class Curvature(Enum):
    """The kind of a stationary point, by the least curvature along directions that keep the limits.

    `SINGULAR` is neither above the threshold nor below that of a saddle, or hangs on limits that are weakly active: as
    far as can be seen, there are directions that cost next to nothing, or gain it.
    """

    POSITIVE = "positive"
    SINGULAR = "singular"
    INDEFINITE = "indefinite"


SADDLE = 100.0
"""The ratio of the negative curvature of a saddle to the positive one of a minimum (1).

With 1e-2 s a change of one scale in the mean square gains the 5 ms to which race times are certified. Solvers leave
alone what is less: the interior point method adds 1e-6 to the diagonal, where a stage may stand for 1e-4 of a race.
"""


@dataclass(frozen=True)
class SecondOrder:
    """The verdict of the conditions of second order, see `second_order.py`.

    Attributes:
        curvature: the kind of point.
        threshold: the curvature that counts as zero, in the objective's unit.
        least: the curvature along a direction of little curvature, not always the very least; NaN where all is above
            the threshold.
        phase, quantity: the phase in which that direction begins, and what changes most, for people; empty without one.
        active: number of limits that are active, as equalities, for their multipliers exceed their slacks.
        weakly_active: number of limits of which multiplier and slack are within a factor of 100, active or not.
    """

    curvature: Curvature
    threshold: float
    least: float
    phase: str
    quantity: str
    active: int
    weakly_active: int

    @property
    def where(self) -> str:
        """The place of the direction, for people."""
        return f"{self.phase}, {self.quantity}" if self.phase else ""

    @property
    def hangs_on_weak_limits(self) -> bool:
        """Whether it is only singular because of the weakly active limits, which may not hold."""
        return self.curvature is Curvature.SINGULAR and self.least <= -self.saddle

    @property
    def saddle(self) -> float:
        """The negative curvature beyond which an optimum is a saddle, in the objective's unit, without its sign."""
        return SADDLE * self.threshold

    def __str__(self) -> str:
        """Return the verdict in a clause."""
        weak = f"; {self.active} active limits, {self.weakly_active} weakly active" if self.weakly_active else ""
        if self.curvature is Curvature.POSITIVE:
            return f"positive, above {self.threshold:.1e} s{weak}"
        kinds = f"a minimum from {self.threshold:.1e} s on, a saddle below {-self.saddle:.1e} s"
        within = f"{self.least:.1e} s along {self.quantity} in {self.phase} ({kinds})"
        return f"{self.curvature.value}, {within}{weak}"


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class Certificate:
    """All measured items of one result, the solver's status, and the curvature where it is known."""

    solver_status: str
    items: tuple[Item, ...]
    second_order: SecondOrder | None = None

    @property
    def holds(self) -> bool:
        """Whether all that was measured holds."""
        return bool(self.items) and all(item.holds for item in self.items)

    @property
    def compares_meshes(self) -> bool:
        """Whether the race time, or the objective, was compared with that on a coarser mesh."""
        return any(item.name in (RACE_TIME_CHANGE, OBJECTIVE_CHANGE) for item in self.items)

    @property
    def is_rough(self) -> bool:
        """Whether the optimum only starts another problem, and neither its curvature nor its mesh was measured."""
        return not any(item.name == HAMILTONIAN_DRIFT for item in self.items)

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
