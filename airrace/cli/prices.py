"""`airrace prices`: what every number of the inputs costs."""

from enum import StrEnum
from typing import Annotated

import typer

from airrace.cli.answer import answering
from airrace.cli.options import AsJson, RunFile


class GroupName(StrEnum):
    """Whose numbers are priced; the same names as `airrace.prices.Group`, which is too heavy to import here."""

    TRACK = "track"
    AIRCRAFT = "aircraft"
    RULES = "rules"
    ENVIRONMENT = "environment"


def prices(
    run_file: RunFile,
    stage: Annotated[str | None, typer.Option(metavar="STAGE", help="Which stage; by default the last one.")] = None,
    by: Annotated[GroupName | None, typer.Option(help="Only the numbers of these.")] = None,
    as_json: AsJson = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print comma-separated values, free numbers included.")] = False,
) -> None:
    """Tell what every number costs.

    Seconds per unit, by the multipliers of a certified stage; nothing is solved again.
    """
    with answering(as_json=as_json) as answer:
        from airrace.checkpoint import inputs_hash, read_checkpoint, stale_stages
        from airrace.cli.price_tables import price_object, prices_csv, prices_text
        from airrace.errors import NotCertified, UsageError
        from airrace.prices import Group
        from airrace.prices import prices as priced
        from airrace.runs.run import stored_run
        from airrace.runs.stage_names import stored_result

        if as_json and as_csv:
            raise UsageError("--json and --csv exclude each other")
        run = stored_run(read_checkpoint(run_file), run_file)
        result = stored_result(run.checkpoint, stage)
        stale = dict(stale_stages(run.checkpoint, inputs_hash(run.checkpoint.inputs.resolved)))
        if result.stage in stale:
            raise NotCertified(f"{result.stage.value} has no prices: {stale[result.stage]}")
        groups = frozenset(Group) if by is None else frozenset([Group(by.value)])
        answer.fields.update(track=run.name, stage=result.stage.value, race_time_s=None, prices={})
        found = list(priced(run.inputs, result, groups=groups).values())
        answer.fields["race_time_s"] = result.trajectory.race_time
        answer.fields["prices"] = {price.key: price_object(price) for price in found}
        answer.texts.append(prices_csv(found) if as_csv else prices_text(result, found))
