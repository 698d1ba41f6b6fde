"""Commands about risks: `safety`, how far real flights stray and what they touch; `footprint`, what falls where."""

import textwrap
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from airrace.api import safety as risks
from airrace.cli.command import command
from airrace.cli.printed_result import PAGE, PrintedResult, render

if TYPE_CHECKING:
    from airrace.flights.results import Flight
    from airrace.flights.safety.footprint import Footprint
    from airrace.runs.safety_case import SafetyCase
    from airrace.runs.safety_rose import SafetyRose, SafetyRuns


@command(risks.safety)
def safety(command_result: PrintedResult, function: "partial[SafetyCase | SafetyRose | SafetyRuns]") -> None:
    from airrace.runs.command_result import ExitCode
    from airrace.runs.safety_case import SafetyCase
    from airrace.runs.safety_rose import is_cut

    case = function(progress=not command_result.quiet)
    if isinstance(case, SafetyCase):
        tables, failures = case.tables(), [case.uncertified]
    else:
        tables, failures = [case.table()], list(case.messages)
    command_result.fields.update(case.as_object())
    command_result.add(*tables)
    if is_cut(case):
        seconds = function.keywords["timeout"]
        command_result.fail(ExitCode.TIMEOUT, f"stopped after {seconds:g} s (--timeout); this was flown by then")
    if function.keywords["output"] is not None:
        command_result.add_files(function.keywords["output"])
    if any(failures) and not is_cut(case):
        command_result.fail(ExitCode.NOT_CERTIFIED, next(filter(None, failures)))


@command(risks.footprint)
def footprint(command_result: PrintedResult, function: "partial[tuple[Footprint, Flight]]") -> None:
    footprint, flight = function()
    command_result.fields.update(footprint.as_object())
    if command_result.shows:
        command_result.add(*_texts(footprint, flight))
    command_result.add_files(function.keywords["output"])


def _texts(footprint: "Footprint", flight: "Flight") -> Iterator[str]:
    """Yield tables of falls, glides and people, and what they are not; at most 80 columns wide."""
    from airrace.pages.views.safety_views import borders_table, falls_table, footprint_facts, people_table

    yield render(falls_table(footprint, flight), columns=PAGE)
    people = people_table(footprint, flight)
    if people.rows:
        yield render(replace(people, notes=()), columns=PAGE)
    yield from (textwrap.fill(note, PAGE) for note in people.notes)
    borders = borders_table(footprint, flight)
    if borders.rows:
        yield render(replace(borders, notes=()), columns=PAGE)
        yield from (textwrap.fill(note, PAGE) for note in borders.notes)
    yield "\n".join(textwrap.fill(fact, PAGE, subsequent_indent="  ") for fact in footprint_facts(footprint, flight))
