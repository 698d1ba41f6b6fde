"""Margins from the limits of a course, and the reserve that is asked of a flight: parts of a track file."""

import math
from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le, Lt
from pydantic import Field

from airrace.inputs.nodes import Reporter
from airrace.inputs.schema import Schema, optional
from airrace.planning.parameters import course_limits, with_margins
from airrace.planning.plan import Race
from airrace.track.course import ClearanceRule, Course
from airrace.track.gates import Tolerant

Margin = Annotated[float, Ge(0), Le(5000)]


class MarginsEntry(Schema):
    """By how much limits of the course are tighter, each in the unit of its key."""

    what: ClassVar[str] = "margins"
    rules: dict[str, Margin] = Field(default={}, description="from limits of the rules, e.g. `floor_m: 2`")
    gates: dict[str, dict[str, Margin]] = Field(
        default={}, description="from tolerances of gates, by name, e.g. `g3: {clearance_m: 0.5}`"
    )
    crowd: dict[str, dict[str, Margin]] = Field(default={}, description="from distances of crowds, by name")
    safety_lines: dict[str, dict[str, Margin]] = Field(default={}, description="from safety lines, by name")
    obstacles: dict[str, dict[str, Margin]] = Field(default={}, description="from clearances of obstacles, by name")

    def by_key(self) -> dict[str, float]:
        """Return the margins by the keys of the limits, e.g. `gates.g3.clearance_m`."""
        return {".".join(path): margin for path, margin in self._paths()}

    def _paths(self) -> Iterator[tuple[tuple[str, ...], float]]:
        for key, margin in self.rules.items():
            yield ("rules", key), margin
        for part in ("gates", "crowd", "safety_lines", "obstacles"):
            for name, margins in getattr(self, part).items():
                for key, margin in margins.items():
                    yield (part, name, key), margin


def tightened(race: Race, entry: MarginsEntry, reporter: Reporter) -> Race:
    """Return a race with the margins of its track; it is only of use if nothing was reported."""
    margins = entry.by_key()
    known = {one.key for one in course_limits(race) if math.isfinite(one.value)}
    for key in margins:
        if key not in known:
            limits = ", ".join(f"`{one}`" for one in sorted(known) if one.rpartition(".")[0] == key.rpartition(".")[0])
            meant = f"known there are {limits}" if limits else "the course has no limits there"
            reporter.value(("margins", *key.split(".")), f"is no limit that a flight could keep a margin from; {meant}")
            return race
    found = with_margins(race, margins)
    if margins:
        for path in _without_room(found.course):
            reporter.value(("margins", *path), "the margins leave no room between the limits")
    return found


def _without_room(course: Course) -> Iterator[tuple[str, ...]]:
    """Yield the paths of margins that are too large."""
    rules = course.rules
    if rules.height.empty or rules.n_z.upper <= 1.0 or rules.n_z.lower >= 1.0 or rules.C_L.upper <= 0.0:
        yield ("rules",)
    for element in {one.element.name: one.element for one in course.passages}.values():
        bounds = element.conditions(element.axis or 0.0).values()
        angles = (element.tolerances.bank, element.tolerances.crossing) if isinstance(element, Tolerant) else ()
        if any(one.empty for one in bounds) or any(one <= 0.0 for one in angles):
            yield "gates", element.base_name


class FoundEntry(Schema):
    """What the search for a reserve has found, as it is stored with the flight."""

    what: ClassVar[str] = "what was found"
    measured: Annotated[float, Ge(0), Le(1)] = Field(description="share of closed-loop flights that break no limit")
    lower: Annotated[float, Ge(0), Le(1)] = Field(description="lower end of its interval of confidence 95 %")
    reached: bool = Field(description="whether that is what was asked for")


class ReserveEntry(Schema):
    """How probable it is to be that a flight in disturbances breaks no limit of the course."""

    what: ClassVar[str] = "a reserve"
    probability: Annotated[float, Gt(0), Lt(1)] = Field(
        description="that a race has no touch, no missed gate and no other breach but of the load factor"
    )
    load_factor: Annotated[float, Ge(0), Lt(1)] = Field(
        default=0.0, description="probability that a race keeps the load factor, too; 0 leaves it where it is"
    )
    gusts: Literal["none", "light", "moderate", "severe"] = Field(
        default="light", description="turbulence of MIL-F-8785C"
    )
    wind_error_kt: Annotated[float, Ge(0), Le(30)] = Field(
        default=0.0, description="standard deviation of the wind to the north and to the east"
    )
    mass_error_percent: Annotated[float, Ge(0), Le(20)] = Field(default=0.0, description="that of the mass")
    power_error_percent: Annotated[float, Ge(0), Le(20)] = Field(default=0.0, description="that of the power")
    density_error_percent: Annotated[float, Ge(0), Le(20)] = Field(default=0.0, description="that of the air's density")
    roll_timing_s: Annotated[float, Ge(0), Le(0.2)] = Field(
        default=0.0, description="that of the time by which rolls are late or early"
    )
    delay_s: Annotated[float, Ge(0), Le(1)] = Field(default=0.1, description="from what the pilot sees to the stick")
    found: FoundEntry | None = optional("what the search has found; written with its flight")

    def texts(self) -> list[str]:
        """Return what sets this reserve, as `key=value`."""
        plain = self.model_dump(exclude_none=True)
        found = plain.pop("found", {})
        values = {**plain, **{f"found.{key}": value for key, value in found.items()}}
        words = {key: str(value).lower() if isinstance(value, bool) else value for key, value in values.items()}
        return ["rules.reserve=null", *(f"rules.reserve.{key}={value}" for key, value in words.items())]


def check_reserve(reserve: ReserveEntry | None, margins: MarginsEntry, race: Race, reporter: Reporter) -> None:
    """Report a reserve that cannot be searched for."""
    if reserve is None or reserve.found is not None:
        return
    if margins.by_key():
        reporter.value(("margins",), "a reserve finds its own margins; leave out either these or `rules.reserve`")
    if race.course.rules.clearance is ClearanceRule.CROSSING:
        message = "needs `clearance: flight`: by `crossing` a wing may touch pylons right before and after its gates"
        reporter.value(("rules", "reserve"), message)
