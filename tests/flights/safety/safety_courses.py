"""A short course in wind, and a half Cuban eight, optimised once with six degrees of freedom; a pilot."""

import functools

from disk_cache import cached_across_workers
from short_course import AIRCRAFT, FROM_PLAN, short_course

from airrace.files.inputs import Document, Inputs, inputs_from_documents, load_inputs
from airrace.flights.safety.closed_loop import ClosedLoop
from airrace.flights.safety.monte_carlo import closed_loop_of
from airrace.flights.safety.pilot import PilotModel
from airrace.procedure.procedure import optimize
from airrace.procedure.result import Silent, StageResult
from airrace.procedure.stage import Stage

COURSE = short_course("n_z_max: 8", wind_m_s=4)


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
