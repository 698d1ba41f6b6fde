"""A small course for the tests of sensitivities, as documents, and its optimum, flown once."""

import functools
import re

from disk_cache import cached_across_workers
from short_course import AIRCRAFT, FROM_PLAN, short_course

from airrace.files.inputs import Document, Inputs, inputs_from_documents
from airrace.flights.sensitivity import Sensitivity
from airrace.procedure.procedure import optimize
from airrace.procedure.result import Silent, StageResult
from airrace.procedure.stage import Stage
from airrace.runs.stage_data import stage_sensitivities

COURSE = short_course("n_z_max: 10, clearance: crossing", wind_m_s=6)
CROWDED = COURSE.replace(
    "course:",
    """crowd:
  stand: {line: [{north_m: 480, east_m: 20}, {north_m: 520, east_m: -20}], distance_m: 122}
airspace:
  - {north_m: -200, east_m: -500}
  - {north_m: 620, east_m: -520}
  - {north_m: 620, east_m: 70}
  - {north_m: -200, east_m: 70}
course:""",
)
"""With people and a border that the flight has to make way for."""


def mirrored_text() -> str:
    """The course seen in a mirror that exchanges east and west."""
    text = re.sub(r"east_m: (-?\d+)", lambda found: f"east_m: {-int(found[1])}", COURSE)
    return re.sub(r"(heading_deg|side_deg|from_deg): (\d+)", lambda found: f"{found[1]}: {360 - int(found[2])}", text)


@functools.cache
def inputs(text: str = COURSE, *overrides: str) -> Inputs:
    """The inputs of a run with that course."""
    return inputs_from_documents(Document("course.yaml", text), AIRCRAFT, FROM_PLAN, overrides)


@cached_across_workers
def optimum(text: str = COURSE, *overrides: str) -> StageResult:
    """The certified point mass."""
    given = inputs(text, *overrides)
    *_, result = optimize(given.race, given.settings, until=Stage.POINT_MASS, threads=1, progress=Silent())
    assert result.certified
    return result


@functools.cache
def sensitivities_of(text: str = COURSE, *overrides: str) -> dict[str, Sensitivity]:
    """The sensitivities of that optimum."""
    return stage_sensitivities(inputs(text, *overrides), optimum(text, *overrides))
