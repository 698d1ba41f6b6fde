"""A report of flights by their names: the page about them, with what their run knows besides."""

from collections.abc import Sequence

from airrace.errors import NotCertified
from airrace.procedure.result import Stage
from airrace.report.flight_page import flight_page
from airrace.report.sections import (
    certificate_section,
    inputs_section,
    recording_section,
    search_section,
    sensitivities_section,
    violations_section,
)
from airrace.runs.flight_sources import opened_file, opened_flights
from airrace.runs.log_view import LogView
from airrace.runs.run import Run
from airrace.runs.sources import Named
from airrace.runs.stage_view import StageView


def opened_report(names: Sequence[str], *, stage: str | None = None, priced: bool = False) -> str:
    """Return the page as text.

    Args:
        names: `RUN.h5`, `RUN.h5:STAGE` or a flown log each; the report is about the first of them, the others fly
            beside it.
        stage: for those that name none; None for the last one of the run.
        priced: whether the prices of the inputs' numbers are computed and told, which takes some seconds.

    Raises:
        CheckpointError: a file is no whole, undamaged checkpoint.
        InputError: this version of airrace no longer accepts its inputs.
        UsageError: a run has no such stage, or that found no flight, or a flight is of a course with other passings.
        NotCertified: prices were asked for, and the stage is no certified optimum, or the first flight is a log.
    """
    first = Named.of(names[0])
    kept = opened_file(first.path)
    flights = opened_flights(names, stage=stage)
    if isinstance(kept, LogView):
        if priced:
            raise NotCertified(f"{first.path} is a flown log: it has no sensitivities")
        return flight_page(flights, log_sections(kept), f"airrace {flights[0].source.version}").as_html()
    flown = kept.stage(first.stage or stage)
    sections = stage_sections(flown, explored_stage(kept, flown), priced=priced)
    return flight_page(flights, sections, footer_of(flown)).as_html()


def log_sections(flown: LogView) -> list[str]:
    """Return what a flown log knows besides its flight: passings that break rules, remarks, inputs."""
    log = flown.recorded.log
    told = [("log", log.path), ("format", log.format), ("begins", log.begins or "at an unknown date")]
    return [
        violations_section(flown.breaches, flown.penalty),
        recording_section([*told, ("start", f"{log.offset:.3f} s after the first sample")], flown.remarks),
        inputs_section(flown.inputs, [], flown.recorded.versions),
    ]


def report_page(run: Run, stage: str | Stage | None = None, others: Sequence[str] = (), *, priced: bool = False) -> str:
    """Return the report about a stage of a run that is at hand, with flights by their names beside it; arguments and
    errors are those of `opened_report`.
    """
    flown = run.stage(stage)
    flights = [flown.flight(), *opened_flights(others)]
    sections = stage_sections(flown, explored_stage(run, flown), priced=priced)
    return flight_page(flights, sections, footer_of(flown)).as_html()


def explored_stage(run: Run, flown: StageView) -> StageView:
    """Return the stage that tried the routes from which a stage was climbed: itself, or the last one before it
    that tried any; itself where none did.
    """
    names = [one.name for one in run]
    before = run.stages[: names.index(flown.name) + 1]
    return next((one for one in reversed(before) if one.result.search.ways), flown)


def stage_sections(flown: StageView, explored: StageView | None = None, *, priced: bool = False) -> list[str]:
    """Return what a run knows of a stage: routes that were tried, prices, certificate, inputs; each is HTML, and empty
    where there is nothing to tell.

    Args:
        flown: the stage.
        explored: the stage before it that tried routes; None for itself.
        priced: whether prices are computed and told.

    Raises:
        NotCertified: prices were asked for, and the stage is no certified optimum.
    """
    result = flown.result
    solved = f"{result.stage.value}, {result.iterations} iterations, {result.timings.wall:.1f} s of wall time"
    return [
        search_section((explored or flown).result),
        sensitivities_section(flown.sensitivities() if priced else None),
        certificate_section(flown.certificate),
        inputs_section(flown.inputs, [("stage", solved)], flown.versions),
    ]


def footer_of(flown: StageView) -> str:
    """Return a line that says which airrace has computed a stage, and what users should know of it."""
    return "; ".join(text for text in (f"airrace {flown.versions['airrace']}", flown.message, flown.stale) if text)
