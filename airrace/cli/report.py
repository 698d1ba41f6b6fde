"""`airrace report`: flights as one page that opens in any browser, without a network."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answer_written, answering, ensure_room
from airrace.cli.options import AsJson, Force, Quiet, RunFile, StageOfRun, Verbose, output_option


def report(
    run_file: RunFile,
    flights: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="FLIGHT",
            help="Flights that fly beside it: `RUN.h5`, `RUN.h5:STAGE` or a flown log, as many as you like.",
        ),
    ] = None,
    output: Annotated[
        Path | None, output_option("FILE.html", "The page; by default beside the run, as RUN.html.")
    ] = None,
    stage: StageOfRun = None,
    sensitivities: Annotated[
        bool, typer.Option("--sensitivities", help="Show the sensitivities to all numbers; takes some seconds.")
    ] = False,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write a page that shows a flight: in space, over time, leg by leg. It opens in any browser, without a network."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.flight_sources import opened_report
        from airrace.runs.output import beside, ensure_free, write_text

        path = output or beside(run_file, "html")
        names = [str(run_file), *(flights or [])]
        ensure_room(path, as_json=as_json)
        ensure_free(path, force=force, sources=names)
        write_text(path, opened_report(names, stage=stage, priced=sensitivities))
        answer_written(answer, [path], quiet=quiet, remark="; any browser opens it", format="html", flights=names)
