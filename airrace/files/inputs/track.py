"""The track language `airrace/track/2`, and the builder of the course of such a file.

In the previous language, `airrace/track/1`, no pilot's limits hold where `rules.pilot` is missing. Every key carries
its unit. A further part of a course is one more field of `TrackEntry`.
"""

import re
from functools import lru_cache
from typing import Annotated, ClassVar, Literal, Union

from pydantic import Field, create_model

from airrace.files.inputs.air import EnvironmentEntry
from airrace.files.inputs.course_order import CourseEntry, build_passages
from airrace.files.inputs.kinds import gates, manoeuvres
from airrace.files.inputs.kinds.kind import CompositeElement, GateDefaultsEntry, KindEntry, kinds
from airrace.files.inputs.nodes import CROWDS_MAX, GATES_MAX, OBSTACLES_MAX, SAFETY_LINES_MAX, Reporter
from airrace.files.inputs.places import OriginEntry, Places
from airrace.files.inputs.rules import (
    MarginsEntry,
    PilotPreset,
    RulesEntry,
    build_rules,
    height_conflict,
    with_preset,
)
from airrace.files.inputs.schema import Annotation, Schema, optional
from airrace.files.inputs.surroundings import (
    Corners,
    CrowdEntry,
    ObstacleEntry,
    SafetyLineEntry,
    build_airspace,
    check_room,
)
from airrace.model.track.course import Course, EndState
from airrace.optimal_control.quantities import Interval

BUILT_IN = (gates, manoeuvres)
"""The modules that register the built-in kinds of elements."""
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


class TrackEntry(Schema):
    """A whole course file."""

    # Files are validated as `track_language()`, which knows the kinds of elements.

    what: ClassVar[str] = "a track"
    schema_: Literal["airrace/track/2", "airrace/track/1"] = Field(
        alias="schema", description="the language of this file"
    )
    name: Annotated[str, Field(min_length=1)] = Field(description="what the race is called")
    source: str = Field(default="", description="where the numbers come from")
    notes: str = Field(default="", description="anything of interest; without effect")
    aircraft: str | None = optional("path of the aircraft file, relative to this file")
    origin: OriginEntry = Field(default=OriginEntry(), description="where the track's frame lies on the earth")
    environment: EnvironmentEntry = Field(default=EnvironmentEntry(), description="air and wind of the day")
    rules: RulesEntry = Field(description="the limits of the race")
    margins: MarginsEntry = Field(
        default=MarginsEntry(), description="by how much the flight stays away from its limits"
    )
    gate_defaults: GateDefaultsEntry = Field(
        default=GateDefaultsEntry(), description="what gates have that do not say otherwise"
    )
    gates: Annotated[dict[str, KindEntry], Field(max_length=GATES_MAX)] = Field(
        description="what stands on the course, by name"
    )
    obstacles: Annotated[dict[str, ObstacleEntry], Field(max_length=OBSTACLES_MAX)] = Field(
        default_factory=dict[str, ObstacleEntry], description="what stands in the way, by name; to be cleared all along"
    )
    safety_lines: Annotated[dict[str, SafetyLineEntry], Field(max_length=SAFETY_LINES_MAX)] = Field(
        default_factory=dict[str, SafetyLineEntry],
        description="lines not to be crossed, by name: on the legs whose passings name them, else on all",
    )
    crowd: Annotated[dict[str, CrowdEntry], Field(max_length=CROWDS_MAX)] = Field(
        default_factory=dict[str, CrowdEntry], description="where people are, by name; avoided all along"
    )
    airspace: Corners | None = optional("corners of the convex area of the race, in order")
    course: CourseEntry = Field(description="the order of its passages")

    @property
    def default_pilot(self) -> PilotPreset:
        """The preset of the pilot's limits where the file names none."""
        return "race" if self.schema_ == "airrace/track/2" else "none"

    @property
    def pilot_preset(self) -> PilotPreset:
        """The preset of the pilot's limits, named or by default."""
        return self.rules.pilot.preset or self.default_pilot

    @property
    def remark(self) -> str:
        """A warning about a file of the previous language; empty for others."""
        if self.default_pilot == "race" or "pilot" in self.rules.model_fields_set:
            return ""
        return (
            f"in {self.schema_} no pilot's limits hold where `rules.pilot` is missing: say `pilot: race` or "
            "`pilot: none`; in airrace/track/2 `race` holds"
        )


def track_language() -> type[TrackEntry]:
    """Return the schema of a course file with all kinds of elements, those of extensions included."""
    return _track_language(kinds())


@lru_cache(maxsize=4)
def _track_language(entries_of_kinds: tuple[type[KindEntry], ...]) -> type[TrackEntry]:
    description = TrackEntry.model_fields["gates"].description
    kind: Annotation = Union[entries_of_kinds]  # noqa: UP007  # made at run time
    element: Annotation = Annotated[kind, Field(discriminator="type")]
    entries: Annotation = Annotated[dict[str, element], Field(max_length=GATES_MAX)]
    return create_model(
        TrackEntry.__name__,
        __base__=TrackEntry,
        __doc__=TrackEntry.__doc__,
        gates=(entries, Field(description=description)),
    )


def build_course(entry: TrackEntry, reporter: Reporter) -> Course:
    """Return the course of a track file; valid only if nothing was reported."""
    limits, gate_defaults = with_preset(entry.rules, entry.gate_defaults, entry.default_pilot, reporter)
    rules = build_rules(limits, entry.rules.preset, reporter)
    places = Places(entry.origin, reporter)
    places.check_origin()
    elements: dict[str, CompositeElement] = {}
    for name, gate in entry.gates.items():
        if not NAME.fullmatch(name):
            message = "a gate's name must begin with a letter and go on with letters, digits, `_` and `-`"
            reporter.key(("gates", name), message)
        elements[name] = gate.build(name, gate_defaults, places)
    for element in elements.values():
        _check_heights(element, rules.height, reporter)
    crowd = tuple(group.build(name, limits.crowd_distance_m, places) for name, group in entry.crowd.items())
    airspace = build_airspace(entry.airspace, places)
    obstacles = tuple(obstacle.build(name, places) for name, obstacle in entry.obstacles.items())
    for name in entry.obstacles:
        if name in entry.gates:
            reporter.key(("obstacles", name), "is the name of a gate, too; an obstacle needs its own")
    check_room(elements.values(), crowd, obstacles, airspace, reporter)
    lines = {name: line.build(name, places) for name, line in entry.safety_lines.items()}
    start_speed = Interval.between(None, limits.arguments().get("start_speed_max_kt"))
    return Course(
        name=entry.name,
        passages=build_passages(entry.course, elements, lines, start_speed, reporter),
        rules=rules,
        origin=places.origin,
        crowd=crowd,
        airspace=airspace,
        obstacles=obstacles,
        start_state=EndState(entry.course.start_state),
        finish_state=EndState(entry.course.finish_state),
    )


def _check_heights(element: CompositeElement, band: Interval, reporter: Reporter) -> None:
    """Report an element that cannot be reached between floor and ceiling."""
    last = element.parts[-1]
    text = height_conflict(last.element, last.roll, band)
    if text:
        outside = last.element.heights.intersect(band).empty
        key = last.element.height_key(too_high=last.element.heights.lower > band.upper) if outside else "height_gain_m"
        reporter.value((*element.path, key), text)
