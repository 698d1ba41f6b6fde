"""Commands around an aircraft: `aircraft`, from the figures of its flight manual, and `fit`, from flight logs."""

from functools import partial
from typing import TYPE_CHECKING

from airrace.api import aircraft as functions
from airrace.cli.command import command
from airrace.cli.printed_result import PrintedResult
from airrace.pages.views.plain_text import plain
from airrace.runtime.standard_streams import stem_of

if TYPE_CHECKING:
    from airrace.runs.aircraft_file import ComparedAircraft
    from airrace.runs.fit import FittedAircraft


@command(functions.estimate_aircraft)
def aircraft(command_result: PrintedResult, function: "partial[ComparedAircraft]") -> None:
    comparison = function()
    command_result.fields.update(name=comparison.aircraft.name, compared=comparison.table.objects())
    if comparison.remarks:
        command_result.fields["not_taken_over"] = list(comparison.remarks)
    if comparison.path is not None:
        remark = f"; fly it with `airrace optimize rovinj_2014 --aircraft {comparison.path}`"
        command_result.add_files(comparison.path, remark=remark)
    command_result.add(comparison.table)
    if comparison.remarks:
        command_result.add("\n".join(["not taken over:", *(f"- {plain(remark)}" for remark in comparison.remarks)]))


@command(functions.fit)
def fit(command_result: PrintedResult, function: "partial[FittedAircraft]") -> None:
    from airrace.pages.views.progress_view import watching
    from airrace.procedure.stage import STAGES

    with watching(stem_of(function.keywords["track"]), STAGES, quiet=command_result.quiet) as progress:
        fit_result = function(progress=progress)
    command_result.fields.update(
        name=fit_result.aircraft.name,
        fitted=fit_result.table.objects(),
        correlations=fit_result.correlations.tolist(),
        winds_m_s=fit_result.estimate.winds.tolist(),
        bias=fit_result.bias.tolist(),
    )
    command_result.add_files(function.keywords["output"])
    command_result.add(fit_result.table)
