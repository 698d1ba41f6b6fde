"""The track language `airrace/track/1`: which keys a course file knows, and in which ranges.

Every key carries its unit. What a key means for the race is said in `course.py`, `kinds/`, `order.py`,
`surroundings.py` and `weather.py`. A further part of a course is one more field of `TrackEntry`.
"""

from functools import lru_cache
from typing import Annotated, ClassVar, Literal, Union

from annotated_types import Ge, Gt, Le
from pydantic import Field, create_model

from airrace.inputs.kinds.all_kinds import kinds
from airrace.inputs.kinds.defaults import GateDefaultsEntry
from airrace.inputs.kinds.entry import KindEntry
from airrace.inputs.place_schema import Azimuth, Corners, CrowdEntry, OriginEntry, PlacedEntry, SafetyLineEntry
from airrace.inputs.rules_schema import RulesEntry
from airrace.inputs.schema import Annotation, Schema

TRACK_SCHEMA = "airrace/track/1"

DirectionName = Literal["forward", "reverse", "planned"]
EndStateName = Literal["settled", "free"]
CROWDS_MAX = 20
"""The largest number of crowds of a course."""
THERMALS_MAX = 100
"""The largest number of thermals of a course."""
LINES_MAX = 100
"""The largest number of safety lines of a course."""
GATES_MAX = 10_000
"""The largest number of elements of a course."""
PASSAGES_MAX = 10_000
"""The largest number of passings of a whole race."""


class WindEntry(Schema):
    """A static wind, with exactly one of `speed_kt` and `speed_m_s`."""

    what: ClassVar[str] = "a wind"
    from_deg: Azimuth = Field(description="the direction it blows from")
    speed_kt: Annotated[float, Ge(0), Le(100)] | None = Field(
        default=None, description="its speed at the reference height; or give `speed_m_s`"
    )
    speed_m_s: Annotated[float, Ge(0), Le(51)] | None = Field(
        default=None, description="its speed at the reference height; or give `speed_kt`"
    )
    profile: Literal["constant", "power", "log"] = Field(default="constant", description="how it changes with height")
    reference_height_m: Annotated[float, Gt(0), Le(1000)] | None = Field(
        default=None, description="the height above the ground at which it was measured"
    )
    exponent: Annotated[float, Ge(0), Le(1)] | None = Field(
        default=None, description="of the power law, with `profile: power`"
    )
    roughness_m: Annotated[float, Gt(0), Le(5)] | None = Field(
        default=None, description="roughness length of the ground, with `profile: log`"
    )


class ThermalEntry(PlacedEntry):
    what: ClassVar[str] = "a thermal"
    w_star_m_s: Annotated[float, Gt(0), Le(10)] = Field(description="the convective velocity scale")
    mixing_height_m: Annotated[float, Ge(100), Le(5000)] = Field(description="the depth of the mixing layer")


class EnvironmentEntry(Schema):
    what: ClassVar[str] = "the environment"
    temperature_offset_K: Annotated[float, Ge(-60), Le(60)] = Field(
        default=0.0, description="how much warmer the day is than the standard atmosphere"
    )
    pressure_offset_hPa: Annotated[float, Ge(-100), Le(100)] = Field(
        default=0.0, description="how much the pressure at sea level is above that of the standard atmosphere"
    )
    wind: WindEntry | None = Field(default=None, description="the wind of the day; without it the air is still")
    thermals: Annotated[list[ThermalEntry], Field(max_length=THERMALS_MAX)] = Field(
        default_factory=list[ThermalEntry], description="columns of rising air"
    )


class FlownEntry(Schema):
    """A passing: the name of an element, or a mapping that says more about it."""

    what: ClassVar[str] = "a passing"
    form: ClassVar[str] = "the name of a gate or {gate: NAME, direction: reverse}"
    shorthand: ClassVar[str | None] = "gate"
    gate: str = Field(description="the name of an element of `gates`")
    direction: DirectionName | None = Field(
        default=None, description="which way a two-pylon gate is flown; `planned`: whichever makes the shorter race"
    )
    safety_lines: Annotated[list[str], Field(max_length=LINES_MAX)] = Field(
        default_factory=list[str], description="names of `safety_lines` not to be crossed on the leg that leads here"
    )


Lap = Annotated[list[FlownEntry], Field(min_length=1, max_length=PASSAGES_MAX)]


class CourseEntry(Schema):
    """The order of a race: either `lap`, flown `laps` times, or `each_lap`."""

    what: ClassVar[str] = "a course"
    start: str = Field(description="the element that starts the clock")
    start_direction: DirectionName | None = Field(default=None, description="which way the start is flown")
    start_state: EndStateName = Field(
        default="settled",
        description="how the aircraft flies when the clock starts: `settled`, as in a steady flight with the load "
        "factor and the roll rate of that instant, or `free`, in any way within the limits",
    )
    lap: Lap | None = Field(default=None, description="the elements in the order flown")
    laps: Annotated[int, Ge(1), Le(100)] | None = Field(
        default=None, description="how often the lap is flown; once by default"
    )
    each_lap: Annotated[list[Lap], Field(min_length=1, max_length=100)] | None = Field(
        default=None, description="instead of `lap` and `laps`: an order of its own for every lap"
    )
    finish: FlownEntry | None = Field(
        default=None, description="the element that stops the clock, if it is not the last of the last lap"
    )
    finish_state: EndStateName = Field(
        default="free", description="how the aircraft flies when the clock stops, likewise"
    )


class TrackEntry(Schema):
    """A whole course file."""

    # Files are validated as `track_language()`, which knows the kinds of elements.

    what: ClassVar[str] = "a track"
    schema_: Literal["airrace/track/1"] = Field(alias="schema", description="the language of this file")
    name: Annotated[str, Field(min_length=1)] = Field(description="what the race is called")
    source: str = Field(default="", description="where the numbers come from")
    notes: str = Field(default="", description="anything worth knowing; without effect")
    aircraft: str | None = Field(default=None, description="path of the aircraft file, relative to this file")
    origin: OriginEntry = Field(default=OriginEntry(), description="where the track's frame lies on the earth")
    environment: EnvironmentEntry = Field(default=EnvironmentEntry(), description="air and wind of the day")
    rules: RulesEntry = Field(description="the limits of the race")
    gate_defaults: GateDefaultsEntry = Field(
        default=GateDefaultsEntry(), description="what gates have that do not say otherwise"
    )
    gates: Annotated[dict[str, KindEntry], Field(max_length=GATES_MAX)] = Field(
        description="what stands on the course, by name"
    )
    safety_lines: Annotated[dict[str, SafetyLineEntry], Field(max_length=LINES_MAX)] = Field(
        default_factory=dict[str, SafetyLineEntry],
        description="lines not to be crossed on the legs whose passings name them, by name",
    )
    crowd: Annotated[dict[str, CrowdEntry], Field(max_length=CROWDS_MAX)] = Field(
        default_factory=dict[str, CrowdEntry], description="where people are, by name; kept away from all along"
    )
    airspace: Corners | None = Field(
        default=None, description="corners of the convex area within which the race is flown, in order"
    )
    course: CourseEntry = Field(description="the order in which it is flown")


def track_language() -> type[TrackEntry]:
    """Return the schema of a course file with all kinds of elements, those of extensions included."""
    return _track_language(kinds())


@lru_cache(maxsize=4)
def _track_language(known: tuple[type[KindEntry], ...]) -> type[TrackEntry]:
    gates = TrackEntry.model_fields["gates"]
    element: Annotation = Annotated[Union[known], Field(discriminator="type")]  # noqa: UP007  # made at run time
    entries: Annotation = Annotated[dict[str, element], Field(max_length=GATES_MAX)]
    return create_model(
        TrackEntry.__name__,
        __base__=TrackEntry,
        __doc__=TrackEntry.__doc__,
        gates=(entries, Field(description=gates.description)),
    )
