"""A report of flights by their names: the page about them, with what their run knows besides."""

from collections.abc import Sequence

from airrace.report.flight_page import flight_page
from airrace.report.stage_sections import certificate_section, inputs_section, prices_section, ways_section
from airrace.runs.flight_sources import Named, opened_flights
from airrace.runs.flown_stage import FlownStage
from airrace.runs.stored import opened_run


def opened_report(names: Sequence[str], *, stage: str | None = None, priced: bool = False) -> str:
    """Return the page as text.

    Args:
        names: `RUN.h5` or `RUN.h5:STAGE` each; the report is about the first of them, the others fly beside it.
        stage: for those that name none; None for the last one of the run.
        priced: whether the prices of the inputs' numbers are computed and told, which takes some seconds.

    Raises:
        CheckpointError: a file is no whole, undamaged checkpoint.
        InputError: this version of airrace no longer accepts its inputs.
        UsageError: a run has no such stage, or that found no flight, or a flight is of a course with other passings.
        NotCertified: prices were asked for, and the stage is no certified optimum.
    """
    first = Named.of(names[0])
    flown = opened_run(first.path).stage(first.stage or stage)
    flights = opened_flights(names, stage=stage)
    return flight_page(flights, stage_sections(flown, priced=priced), footer_of(flown)).as_html()


def report_page(flown: FlownStage, others: Sequence[str] = (), *, priced: bool = False) -> str:
    """Return the report about a stage that is at hand, with flights by their names beside it; arguments and errors are
    those of `opened_report`.
    """
    flights = [flown.flight(), *opened_flights(others)]
    return flight_page(flights, stage_sections(flown, priced=priced), footer_of(flown)).as_html()


def stage_sections(flown: FlownStage, *, priced: bool = False) -> list[str]:
    """Return what a run knows of a stage: ways that were tried, prices, certificate, inputs; each is HTML, and empty
    where there is nothing to tell.

    Raises:
        NotCertified: prices were asked for, and the stage is no certified optimum.
    """
    return [
        ways_section(flown.result.explored),
        prices_section(flown.prices() if priced else None),
        certificate_section(flown.certificate),
        inputs_section(flown.inputs, flown.result, flown.versions),
    ]


def footer_of(flown: FlownStage) -> str:
    """Return a line that says which airrace has computed a stage, and what users should know of it."""
    return "; ".join(text for text in (f"airrace {flown.versions['airrace']}", flown.message, flown.stale) if text)
