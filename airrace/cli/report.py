"""`airrace report`: flights as one page that opens in any browser, without a network."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli import completion
from airrace.cli.answer import answering
from airrace.cli.options import RunFile


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
        Path | None, typer.Option(metavar="FILE.html", help="The page; by default beside the run, as RUN.html.")
    ] = None,
    stage: Annotated[
        str | None,
        typer.Option(metavar="STAGE", autocompletion=completion.stages, help="Which stage; by default the last one."),
    ] = None,
    prices: Annotated[
        bool, typer.Option("--prices", help="Compute what every number costs, and tell it; takes some seconds.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
) -> None:
    """Write a page that shows a flight: in space, over time, leg by leg. It opens in any browser, without a network."""
    with answering(as_json=False) as answer:
        from airrace.runs.output import beside, ensure_free, write_text
        from airrace.runs.reported import opened_report

        path = output or beside(run_file, "html")
        names = [str(run_file), *(flights or [])]
        ensure_free(path, force=force, sources=names)
        write_text(path, opened_report(names, stage=stage, priced=prices))
        answer.texts.append(f"{path} is written; any browser opens it")
