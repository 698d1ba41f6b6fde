"""A report of flights: what stands in the page, gathered from flights, their run and its inputs."""

import math
from collections.abc import Sequence

from airrace.documents.units import KNOT
from airrace.flights import Flight
from airrace.report.flight_contents import contents_of
from airrace.report.flight_sections import flights_section, legs_section
from airrace.report.page import Page
from airrace.report.shown import READINGS
from airrace.report.stage_sections import (
    certificate_section,
    inputs_section,
    joined,
    prices_section,
    ways_section,
)
from airrace.runs.flight_sources import Named, opened_flights
from airrace.runs.flown_stage import FlownStage
from airrace.runs.stored import opened_run
from airrace.views.plan_svg import plan_svg
from airrace.views.scenery import scenery


def opened_report(names: Sequence[str], *, stage: str | None = None, priced: bool = False) -> str:
    """The page of a report about flights by their names, as text.

    Args:
        names: `RUN.h5` or `RUN.h5:STAGE` each; the report is about the first of them.
        stage: for those that name none; None for the last one of the run.
        priced: as of `reported`.

    Raises:
        CheckpointError: a file is no whole, undamaged checkpoint.
        InputError: this version of airrace no longer accepts its inputs.
        UsageError: a run has no such stage, or that found no flight, or a flight is of a course with other passings.
        NotCertified: prices were asked for, and the stage is no certified optimum.
    """
    flights = opened_flights(names, stage=stage)
    first = Named.of(names[0])
    return reported(opened_run(first.path).stage(first.stage or stage), flights, priced=priced)


def reported(stage: FlownStage, flights: Sequence[Flight], *, priced: bool = False) -> str:
    """The page of a report, as text.

    Args:
        stage: what the report is about.
        flights: its flight first, then those that fly beside it.
        priced: whether the prices of the inputs' numbers are computed and told, which takes some seconds.

    Raises:
        UsageError: a flight is of a course with other passings.
        NotCertified: prices were asked for, and the stage is no certified optimum.
    """
    first = flights[0]
    race = first.race
    seen = scenery(race)
    page = Page(
        title=race.course.name,
        subtitle=_subtitle(first),
        race_time=first.race_time,
        verdict="certified" if stage.certified else "not certified",
        good=stage.certified,
        readings=READINGS,
        plan=plan_svg(seen, stage.trajectory),
        sections=joined((
            flights_section(flights),
            legs_section(flights),
            ways_section(stage.result.explored),
            prices_section(stage.prices() if priced else None),
            certificate_section(stage.certificate),
            inputs_section(stage.inputs, stage.result, stage.versions),
        )),
        footer=f"airrace {stage.versions.get('airrace', '')}".strip() + _remark(stage),
        contents=contents_of(flights, seen),
    )  # fmt: skip
    return page.as_html()


def _subtitle(flight: Flight) -> str:
    """Who flies, which model, and in which wind."""
    wind = flight.air.wind
    blowing = "calm air"
    if wind is not None and wind.speed > 0.0:
        blowing = f"wind {wind.speed / KNOT:.0f} kt from {_compass(wind.origin)}°"
    return ", ".join(text for text in (flight.aircraft.name, flight.source.stage, blowing) if text)


def _compass(azimuth: float) -> str:
    return f"{round(math.degrees(azimuth)) % 360:03d}"


def _remark(stage: FlownStage) -> str:
    remarks = [text for text in (stage.message, stage.stale) if text]
    return "".join(f"; {text}" for text in remarks)
