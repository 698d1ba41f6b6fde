"""A course before it is flown: read, reviewed, ready to be shown."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from airrace.inputs import Document, Inputs, load_inputs
from airrace.inputs.unused import unused_gates
from airrace.planning.lint import Kind, Remark, in_order, review
from airrace.planning.race import Race
from airrace.results import Flight
from airrace.results.clearance import Clearance
from airrace.results.plan_review import plan_clearances, remarks_on_line
from airrace.results.planned import planned_flight
from airrace.runs.leg_object import planned_object
from airrace.views.course_figure import draw_course
from airrace.views.course_page import course_page
from airrace.views.course_rows import course_object
from airrace.views.drawing import ensure_drawable
from airrace.views.map_model import MapModel, map_model


@dataclass(frozen=True, eq=False, repr=False)
class Checked:
    """A course that is valid, and what a race director would ask about it.

    Attributes:
        inputs: what a run would be given.
        planned: the flight as which the race is planned, before anything is optimised; what is drawn and measured.
        warnings: remarks of the review; the course is valid with them.
    """

    inputs: Inputs
    planned: Flight
    warnings: tuple[Remark, ...]

    @property
    def race(self) -> Race:
        """The race: course, aircraft and air."""
        return self.inputs.race

    @cached_property
    def map_model(self) -> MapModel:
        """The course from above, with the line of the planned flight."""
        return map_model(self.race, self.planned)

    @cached_property
    def clearances(self) -> tuple[Clearance, ...]:
        """The least distances of the planned flight from everything that the course names."""
        return plan_clearances(self.planned)

    def draw(self, path: str | Path) -> Path:
        """Draw the course from above into a file.

        Args:
            path: its name ends in `.png`, `.svg` or `.pdf`; a file that exists is replaced.

        Returns:
            The path.

        Raises:
            UsageError: the name says no known format, or matplotlib is not installed.
            StorageError: the system refused.
        """
        ensure_drawable(Path(path))
        draw_course(self.race, self.map_model, Path(path))
        return Path(path)

    def as_object(self) -> dict[str, object]:
        """Return what `airrace check --json` prints of the course."""
        return {**course_object(self.race, self.warnings), "planned": planned_object(self.planned, self.clearances)}

    def __repr__(self) -> str:
        course, count = self.race.course, len(self.warnings)
        passages = f"{len(course.passages)} passages"
        return f"<Checked {course.name}: {passages}, {count} warning{'' if count == 1 else 's'}>"

    def _repr_html_(self) -> str:
        return course_page(self.race, self.map_model, [remark.text for remark in self.warnings])


def checked(
    track: str | Path | Document,
    *,
    aircraft: str | Path | Document | None = None,
    settings: str | Path | None = None,
    overrides: Sequence[str] = (),
) -> Checked:
    """Read a course and review it.

    Args:
        track, aircraft, settings, overrides: see `load_inputs`.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
    """
    inputs = load_inputs(track, aircraft=aircraft, settings=settings, overrides=overrides)
    unused = (
        Remark("", Kind.ELEMENT, f"no lap passes the gate `{name}`: is its name missing in `course`?")
        for name in unused_gates(inputs)
    )
    planned = planned_flight(inputs.race)
    remarks = in_order([*review(inputs.race), *remarks_on_line(planned)], inputs.race.course)
    return Checked(inputs, planned, (*unused, *remarks))
