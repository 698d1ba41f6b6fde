"""The command `airrace sensitivity`: how the race time depends on every number of the inputs."""

from enum import StrEnum
from typing import Annotated

import typer

from airrace.cli.answer import answering
from airrace.cli.options import AsJson, RunFile, StageOfRun, Verbose


class GroupName(StrEnum):
    """A group of numbers whose sensitivities are wanted.

    The names are those of `airrace.sensitivity.ParameterGroup`, which is too heavy to import here.
    """

    TRACK = "track"
    AIRCRAFT = "aircraft"
    RULES = "rules"
    ENVIRONMENT = "environment"


def sensitivity(
    run_file: RunFile,
    stage: StageOfRun = None,
    by: Annotated[GroupName | None, typer.Option(help="Only the numbers of these.")] = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print comma-separated values, free numbers included.")] = False,
) -> None:
    """Tell how the race time depends on every number.

    These are shadow prices in seconds per unit, from the multipliers of an optimum; nothing is solved again.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.cli.price_tables import prices_csv, prices_text
        from airrace.cli.tables import terminal_columns
        from airrace.errors import UsageError
        from airrace.runs.run import opened_run

        if as_json and as_csv:
            raise UsageError("--json and --csv exclude each other")
        run = opened_run(run_file)
        priced = run.stage(stage)
        answer.fields.update(track=run.name, stage=priced.name, race_time_s=None, sensitivities={})
        found = list(priced.sensitivities(None if by is None else by.value).values())
        answer.fields["race_time_s"] = priced.race_time
        answer.fields["sensitivities"] = {price.key: price.as_object() for price in found}
        answer.texts.append(prices_csv(found) if as_csv else prices_text(priced.result, found, terminal_columns()))
