"""Commands around flights: `import`, `brief`, `compare`, `plot`, `report`, `film`, `card` and `export`."""

import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from airrace.api import flights
from airrace.api.flights import WrittenFlights
from airrace.cli.answer import PAGE, Answer, takes_unicode
from airrace.cli.command import Command, command
from airrace.options import Option
from airrace.runtime.standard_streams import name_of

if TYPE_CHECKING:
    from airrace.files.export.formats import Format
    from airrace.flights.results import Confirmation
    from airrace.flights.results.comparison import Comparison
    from airrace.runs.log_view import LogView
    from airrace.runs.stage_data import Brief


def _choose_output(answer: Answer, call: "partial[Any]", source: str | Path, suffix: str) -> None:
    """Settle the file that is written where the user names none, for stdout has room for one result."""
    from airrace.runs.output import output_path

    call.keywords["output"] = output_path(call.keywords["output"], source, suffix)
    answer.ensure_room(call.keywords["output"])


@command(flights.import_log)
def import_log(answer: Answer, call: "partial[LogView]") -> None:
    from airrace.cli.flight_tables import log_texts

    log = call.keywords["log"]
    answer.fields = {"flown": True, "log": name_of(log)}
    _choose_output(answer, call, log, "h5")
    view = call()
    answer.fields.update(view.as_object())
    if answer.shows:
        answer.add(*log_texts(view))
    answer.add_files(call.keywords["output"])


@command(flights.brief)
def brief(
    answer: Answer,
    call: "partial[Brief]",
    *,
    units: flights.Units = "kt-m",
    csv: Annotated[bool, Option("Print comma-separated values, one row per cue.")] = False,
) -> None:
    from airrace.errors import UsageError
    from airrace.pages.views.tables import units_named

    if answer.as_json and csv:
        raise UsageError("--json and --csv exclude each other")
    import_result = call()
    answer.fields.update(import_result.as_object())
    if csv:
        answer.add(import_result.to_csv())
    elif answer.shows:
        answer.add(import_result.table(units_named(units), unicode=takes_unicode()), columns=PAGE)


@command(flights.compare)
def compare(
    answer: Answer,
    call: "partial[list[Comparison]]",
    *,
    all_: Annotated[bool, Option("List the legs that are ties as well.")] = False,
) -> None:
    from airrace.cli.run_tables import comparison_texts
    from airrace.runs.json_objects import comparison_object

    comparisons = call()
    reference = comparisons[0].reference
    sources = {comparison.other.label: comparison.other.source for comparison in comparisons}
    sources = {reference.label: reference.source} | sources
    answer.fail_if_refuted({label: source.confirmation for label, source in sources.items()})
    answer.fields.update(comparison_object(reference, comparisons))
    if answer.shows:
        answer.add(*comparison_texts(comparisons, every=all_))


@command(flights.plot)
def plot(answer: Answer, call: "partial[WrittenFlights]") -> None:
    name = call.keywords["flight"]
    _choose_output(answer, call, name, "kneeboard.pdf" if call.keywords["kneeboard"] else "png")
    path = call().path
    answer.add_files(path, format=path.suffix[1:].lower() or "png", flights=[name])


@command(flights.report)
def report(answer: Answer, call: "partial[WrittenFlights]") -> None:
    run, *more_flights = call.args
    _choose_output(answer, call, run, "html")
    result = call()
    confirmations = _confirmations(answer, result)
    answer.fields["verified"] = [confirmation and confirmation.verified for confirmation in confirmations.values()]
    answer.fields["verification"] = [confirmation and confirmation.words for confirmation in confirmations.values()]
    answer.add_files(result.path, remark="; any browser opens it", format="html", flights=[str(run), *more_flights])
    for label, confirmation in confirmations.items():
        if confirmation is not None:
            answer.add(f"{label}: {confirmation.remark}")


@command(flights.film)
def film(answer: Answer, call: "partial[WrittenFlights]") -> None:
    from airrace.pages.views.plain_text import SafeStream

    names = call.args
    _choose_output(answer, call, names[0], "mp4")
    terminal = SafeStream(sys.stderr, commanded=True)

    def watch(share: float) -> None:
        print(f"\rfilming: {share:4.0%}", end="\n" if share == 1.0 else "", file=terminal, flush=True)

    result = call(watch=watch) if not answer.quiet and sys.stderr.isatty() else call()
    _confirmations(answer, result)
    answer.add_files(result.path, format=result.path.suffix[1:].lower(), flights=list(names))


@command(flights.card)
def card(answer: Answer, call: "partial[WrittenFlights]") -> None:
    name = call.keywords["flight"]
    _choose_output(answer, call, name, "card.png")
    result = call()
    _confirmations(answer, result)
    answer.add_files(result.path, format="png", flights=[name])


def _confirmations(answer: Answer, result: WrittenFlights) -> "dict[str, Confirmation | None]":
    """Return the outcome of measuring the flights again; one that is refuted fails the command."""
    confirmations = {flight.label: flight.source.confirmation for flight in result.flights}
    answer.fail_if_refuted(confirmations)
    return confirmations


class _Formats(TyperGroup):
    """The subcommands: `csv`, and one for every registered format, made when the first of them is looked up."""

    # Any: contexts and commands belong to click, whose place depends on typer's version.
    def list_commands(self, ctx: Any) -> list[str]:
        return [*super().list_commands(ctx), *(name for name in _formats() if name not in self.commands)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        subcommand = super().get_command(ctx, cmd_name)
        form = None if subcommand else _formats().get(cmd_name)
        return subcommand if form is None else _subcommand(form)


export = typer.Typer(name="export", help="Write a flight for other programs.", no_args_is_help=True, cls=_Formats)


@export.callback()
def _common() -> None:
    """Write a flight for other programs."""


@export.command("csv", cls=Command)
@command(flights.export_csv)
def csv_table(answer: Answer, call: "partial[Sequence[Path]]") -> None:
    answer.add_files(*call(), format="csv", flights=[call.keywords["flight"]])


def _formats() -> Mapping[str, "Format"]:
    from airrace.errors import UsageError
    from airrace.files.export.formats import formats

    try:
        return formats()
    except UsageError as error:
        raise typer.BadParameter(str(error)) from error


def _subcommand(form: "Format") -> Any:  # Any: as above
    """Return the subcommand of a format."""

    @command(partial(flights.export, form.name), without=[] if form.has_models else ["model"], help=form.help)
    def write(answer: Answer, call: "partial[Path]") -> None:
        _, *names = call.args
        _choose_output(answer, call, names[0], form.suffix or form.name)
        answer.add_files(call(), format=form.name, flights=names)

    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(form.name, cls=Command)(write)
    return typer.main.get_command(alone)
