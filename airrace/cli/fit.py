"""The command `airrace fit`: drag, power and roll rate of an aircraft from flight logs."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answer_with_files, answering, ensure_room
from airrace.cli.options import (
    AsJson,
    Force,
    Overrides,
    Quiet,
    Verbose,
    complete_aircraft,
    file_option,
    output_option,
    track_option,
)
from airrace.standard_streams import STANDARD


def fit(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG...", readable=False, help="Logs of one aircraft: CSV, GPX, IGC or ACMI."),
    ],
    course: Annotated[Path, track_option("The course that they pass, with the wind as far as it is known.")],
    aircraft: Annotated[
        Path,
        file_option("FILE", "Start from this aircraft: a file or a name.", "--aircraft", complete=complete_aircraft),
    ],
    output: Annotated[Path, output_option("FILE.yaml", "Write the fitted aircraft here.")],
    mapping: Annotated[Path | None, file_option("FILE.yaml", "What the columns of CSV files mean.")] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=HEADER", help="One column, e.g. 'altitude=GPS alt [ft]'; as often as you like."),
    ] = None,
    overrides: Overrides = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Fit drag polar, power and roll rate of an aircraft to logs of races at full power; each log has its own wind.

    The roll rate is found where the roll is recorded. What logs do not show stays as in the aircraft of --aircraft, and
    is marked so in the file. Bias and scatter are measured on the optimum of the fitted aircraft: a minute or two.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.cli.tables import render
        from airrace.procedure.stage import STAGES
        from airrace.runs.fit import fit as fit_aircraft
        from airrace.standard_streams import stem_of
        from airrace.views.progress_view import watching

        ensure_room(output, as_json=as_json)
        with watching(stem_of(course), STAGES, quiet=quiet) as progress:
            fitted = fit_aircraft(
                logs,
                course,
                aircraft=aircraft,
                output=output,
                force=force,
                set=overrides or (),
                mapping=mapping,
                columns=column or (),
                progress=progress,
            )
        answer.fields.update(
            name=fitted.aircraft.name,
            fitted=fitted.table.objects(),
            correlations=fitted.correlations.tolist(),
            winds_m_s=fitted.estimate.winds.tolist(),
            bias=fitted.bias.tolist(),
        )
        answer_with_files(answer, [output], quiet=quiet)
        if output != STANDARD and not quiet:
            answer.texts.append(render(fitted.table))
