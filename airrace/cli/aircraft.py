"""Commands around an aircraft: `aircraft`, from the figures of its flight manual, and `fit`, from flight logs."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from airrace import options
from airrace.api.aircraft import estimate_aircraft
from airrace.cli.command import command
from airrace.cli.printed_result import PrintedResult
from airrace.options import Option
from airrace.runtime.standard_streams import stem_of

if TYPE_CHECKING:
    from airrace.procedure.result import Progress
    from airrace.runs.aircraft import ComparedAircraft
    from airrace.runs.fit import FittedAircraft


@command(estimate_aircraft)
def aircraft(command_result: PrintedResult, function: "partial[ComparedAircraft]") -> None:
    comparison = function()
    command_result.fields.update(name=comparison.aircraft.name, compared=comparison.table.objects())
    if comparison.path is not None:
        remark = f"; fly it with `airrace optimize rovinj_2014 --aircraft {comparison.path}`"
        command_result.add_files(comparison.path, remark=remark)
    command_result.add(comparison.table)


def _fit(
    logs: Annotated[Sequence[Path], Option("Logs of one aircraft: CSV, GPX, IGC or ACMI.", "LOG...")],
    *,
    course: Annotated[
        Path, Option("The course that they pass, with the wind as far as it is known.", "TRACK", completion="tracks")
    ],
    aircraft: Annotated[Path, Option("Start from this aircraft: a file or a name.", "FILE", completion="configs")],
    output: Annotated[Path, options.output("FILE.yaml", "Write the fitted aircraft here.")],
    mapping: Annotated[Path | None, Option("What the columns of CSV files mean.", "FILE.yaml")] = None,
    columns: options.Columns = (),
    set: options.Set = (),
    force: options.Force = False,
    progress: "Progress | None" = None,
) -> "FittedAircraft":
    """Fit drag polar, power and roll rate of an aircraft to logs of races at full power; each log has its own wind.

    The roll rate is found where the roll is recorded. What logs do not show stays as in the aircraft of --aircraft, and
    is marked so in the file. Bias and scatter are measured on the optimum of the fitted aircraft: a minute or two.
    """
    from airrace.runs.fit import fit

    return fit(
        logs,
        course,
        aircraft=aircraft,
        output=output,
        force=force,
        set=set,
        mapping=mapping,
        columns=columns,
        progress=progress,
    )


@command(_fit)
def fit(command_result: PrintedResult, function: "partial[FittedAircraft]") -> None:
    from airrace.pages.views.progress_view import watching
    from airrace.procedure.stage import STAGES

    with watching(stem_of(function.keywords["course"]), STAGES, quiet=command_result.quiet) as progress:
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
