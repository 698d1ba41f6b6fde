"""The efforts of exploring: how much is tried before a route is taken."""

import math
from collections.abc import Mapping
from dataclasses import replace

from airrace.environment.atmosphere import g0
from airrace.planning.planning_model import PlanningModel
from airrace.procedure.settings import SearchEffort
from airrace.records import record


@record
class Radius:
    """A factor on the planned turning radius; reached by a higher load factor, or by flying slower."""

    factor: float
    slower: bool = False


@record
class SearchBudget:
    """The amount of exploring.

    Attributes:
        radii: of the plans that are flown as a whole, besides the race's own plan.
        twins: of how many of these plans the twin is flown, too, that decides ties the other way, if there are any.
        thinking: radius at which other ways through a stretch are planned.
        dearest: s, by which the plan of a way through a stretch may take longer than that of the flight.
        rounds: how often the best flight is improved, at most.
        alternatives: how many wins that overlap greater ones are flown jointly as well, each for itself.
        finalists: how many flights are compared on the mesh on which the winner is then proved.
        homotopy: whether the homotopy is one of the starts, although the user begins with the plan.
    """

    radii: tuple[Radius, ...]
    twins: int
    thinking: Radius
    max_plan_penalty: float
    rounds: int
    alternatives: int
    finalists: int
    homotopy: bool

    def with_finalists(self, least: int) -> "SearchBudget":
        """Return the same effort with at least so many finalists."""
        return replace(self, finalists=max(self.finalists, least))


QUICK = SearchBudget(
    radii=(Radius(0.7), Radius(0.6, slower=True), Radius(0.4)),
    twins=0,
    thinking=Radius(0.5),
    max_plan_penalty=2.0,
    rounds=3,
    alternatives=1,
    finalists=2,
    homotopy=False,
)
"""The effort of `settings.search: quick`."""
THOROUGH = SearchBudget(
    radii=(
        Radius(1.0),
        *QUICK.radii,
        *(Radius(factor) for factor in (0.85, 0.55, 0.3)),
        *(Radius(factor, slower=True) for factor in (0.85, 0.7, 0.5, 0.4)),
    ),
    twins=12,
    thinking=Radius(0.5),
    max_plan_penalty=6.0,
    rounds=8,
    alternatives=3,
    finalists=4,
    homotopy=True,
)
"""The effort of `settings.search: thorough`."""
EFFORTS: Mapping[SearchEffort, SearchBudget] = {SearchEffort.QUICK: QUICK, SearchEffort.THOROUGH: THOROUGH}


def scaled(pace: PlanningModel, radius: Radius) -> PlanningModel:
    """Return a pace with turns of another radius."""
    if radius.slower:
        return replace(pace, V=pace.V * math.sqrt(radius.factor))
    return replace(pace, n=math.hypot(1.0, pace.V**2 / (g0 * radius.factor * pace.radius)))
