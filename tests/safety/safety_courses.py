"""A short course in wind, and a half Cuban eight, optimised once with six degrees of freedom; a pilot."""

import functools
from pathlib import Path

from disk_cache import cached_across_workers

from airrace.inputs import Document, Inputs, inputs_from_documents, load_inputs
from airrace.procedure.progress import Silent
from airrace.procedure.result import Stage, StageResult
from airrace.procedure.run import optimize
from airrace.safety.closed_loop import ClosedLoop
from airrace.safety.pilot import PilotModel
from airrace.safety.safety import closed_loop_of

ROOT = Path(__file__).parents[2]
AIRCRAFT = Document("edge540.yaml", (ROOT / "configs" / "edge540.yaml").read_text(encoding="utf-8"))
FROM_PLAN = Document("settings.yaml", 'schema: airrace/settings/1\nguess: plan\nsearch: "off"\n')
COURSE = """
schema: airrace/track/1
name: three gates and a pylon
rules: {n_z_max: 8, floor_m: 5, start_speed_max_kt: 200}
environment:
  wind: {from_deg: 250, speed_m_s: 4}
gate_defaults: {height_m: 20, height_min_m: 15, height_max_m: 25, climb_min_deg: -10, climb_max_deg: 10}
gates:
  first: {type: level, north_m: 0, east_m: 0, heading_deg: 20}
  side: {type: pylon, north_m: 300, east_m: 60, pass_side_deg: 110}
  last: {type: level, north_m: 420, east_m: -260, heading_deg: 250}
course: {start: first, lap: [side, last]}
"""


@functools.cache
def inputs() -> Inputs:
    """The inputs of a run with that course."""
    return inputs_from_documents(Document("course.yaml", COURSE), AIRCRAFT, FROM_PLAN, ())


@cached_across_workers
def optimum() -> StageResult:
    """The optimum with six degrees of freedom."""
    return _optimum(inputs())


@functools.cache
def eight_inputs() -> Inputs:
    """The inputs of a half Cuban eight, all of whose places are attitudes in a loop and on its lines."""
    return load_inputs("half_cuban_eight", overrides=["settings.guess=plan", "settings.search=off"])


@cached_across_workers
def eight_optimum() -> StageResult:
    """Its optimum with six degrees of freedom."""
    return _optimum(eight_inputs())


def _optimum(given: Inputs) -> StageResult:
    stages = list(optimize(given.race, given.settings, until=Stage.SIX_DOF, threads=1, progress=Silent()))
    assert stages[-1].stage is Stage.SIX_DOF
    return stages[-1]


@functools.cache
def loop() -> ClosedLoop:
    """The pilot of the defaults on that line."""
    return closed_loop_of(inputs().race, optimum(), PilotModel())
