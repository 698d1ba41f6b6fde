"""Commands around flights: `import`, `brief`, `compare`, `plot`, `report`, `film`, `card` and `export`."""

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from airrace.api import flights
from airrace.api.flights import WrittenFlights
from airrace.cli.command import Command, command
from airrace.cli.printed_result import PAGE, PrintedResult, takes_unicode
from airrace.options import Option
from airrace.runtime.standard_streams import name_of

if TYPE_CHECKING:
    from airrace.files.export.formats import Format
    from airrace.flights.results import Verification
    from airrace.flights.results.comparison import Comparison
    from airrace.runs.log_view import LogView
    from airrace.runs.stage_data import Brief


def _choose_output(command_result: PrintedResult, function: "partial[Any]", source: str | Path, suffix: str) -> None:
    """Settle the file that is written where the user names none, for stdout has room for one result."""
    from airrace.runs.output import output_path

    function.keywords["output"] = output_path(function.keywords["output"], source, suffix)
    command_result.ensure_room(function.keywords["output"])


@command(flights.import_log)
def import_log(command_result: PrintedResult, function: "partial[LogView]") -> None:
    from airrace.cli.flight_tables import log_texts

    log = function.keywords["log"]
    command_result.fields = {"flown": True, "log": name_of(log)}
    _choose_output(command_result, function, log, "h5")
    view = function()
    command_result.fields.update(view.as_object())
    if command_result.shows:
        command_result.add(*log_texts(view))
    command_result.add_files(function.keywords["output"])


@command(flights.brief)
def brief(
    command_result: PrintedResult,
    function: "partial[Brief]",
    *,
    units: flights.Units = "kt-m",
    csv: Annotated[bool, Option("Print comma-separated values, one row per cue.")] = False,
) -> None:
    from airrace.errors import UsageError
    from airrace.pages.views.tables import units_named

    if command_result.as_json and csv:
        raise UsageError("--json and --csv exclude each other")
    import_result = function()
    command_result.fields.update(import_result.as_object())
    if csv:
        command_result.add(import_result.to_csv())
    elif command_result.shows:
        command_result.add(import_result.table(units_named(units), unicode=takes_unicode()), columns=PAGE)


@command(flights.compare)
def compare(
    command_result: PrintedResult,
    function: "partial[list[Comparison]]",
    *,
    all_: Annotated[bool, Option("List the legs that are ties as well.")] = False,
) -> None:
    from airrace.cli.run_tables import comparison_texts
    from airrace.runs.json_objects import comparison_object

    comparisons = function()
    reference = comparisons[0].reference
    sources = {comparison.flight.label: comparison.flight.source for comparison in comparisons}
    sources = {reference.label: reference.source} | sources
    command_result.fail_if_refuted({label: source.verification for label, source in sources.items()})
    command_result.fields.update(comparison_object(reference, comparisons))
    if command_result.shows:
        command_result.add(*comparison_texts(comparisons, every=all_))


@command(flights.follow, without=["as_json"])
def follow(command_result: PrintedResult, function: "partial[Iterator[dict[str, object]]]") -> None:
    for answer in function():
        print(json.dumps(answer), flush=True)  # a line at once: who reads it flies


@command(flights.plot)
def plot(command_result: PrintedResult, function: "partial[WrittenFlights]") -> None:
    name = function.keywords["flight"]
    _choose_output(command_result, function, name, "kneeboard.pdf" if function.keywords["kneeboard"] else "png")
    path = function().path
    command_result.add_files(path, format=path.suffix[1:].lower() or "png", flights=[name])


@command(flights.report)
def report(command_result: PrintedResult, function: "partial[WrittenFlights]") -> None:
    run, *more_flights = function.args
    _choose_output(command_result, function, run, "html")
    result = function()
    verifications = _verifications(command_result, result)
    command_result.fields["verified"] = [
        verification and verification.verified for verification in verifications.values()
    ]
    command_result.fields["verification"] = [
        verification and verification.words for verification in verifications.values()
    ]
    command_result.add_files(
        result.path, remark="; any browser opens it", format="html", flights=[str(run), *more_flights]
    )
    for label, verification in verifications.items():
        if verification is not None:
            command_result.add(f"{label}: {verification.remark}")


@command(flights.film)
def film(command_result: PrintedResult, function: "partial[WrittenFlights]") -> None:
    _draw(command_result, function, "mp4", "filming")


@command(flights.card)
def card(command_result: PrintedResult, function: "partial[WrittenFlights]") -> None:
    _draw(command_result, function, "card.png", "drawing")


def _draw(command_result: PrintedResult, function: "partial[WrittenFlights]", suffix: str, doing: str) -> None:
    """Draw a film or a card, and show on stderr how far it is."""
    from airrace.pages.views.count_view import counting

    names = [*function.args, *function.keywords["flight"]]
    if names:
        _choose_output(command_result, function, names[0], suffix)
    with counting(shown=not command_result.quiet) as count:

        def watch(done: int, total: int) -> None:
            if done <= 1:
                count.begin(doing)  # once more with the first picture: what draws it starts slowly
            count.tell(f"picture {done} of {total}", done, total)

        if function.keywords["verify"]:
            count.show("verifying")
        result = function(watch=watch)
    _verifications(command_result, result)
    command_result.add_files(result.path, format=result.path.suffix[1:].lower(), flights=names)


def _verifications(command_result: PrintedResult, result: WrittenFlights) -> "dict[str, Verification | None]":
    """Return the outcome of measuring the flights again; one that is refuted fails the command."""
    verifications = {flight.label: flight.source.verification for flight in result.flights}
    command_result.fail_if_refuted(verifications)
    return verifications


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
def csv_table(command_result: PrintedResult, function: "partial[Sequence[Path]]") -> None:
    command_result.add_files(*function(), format="csv", flights=[function.keywords["flight"]])


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
    def write(command_result: PrintedResult, function: "partial[Path]") -> None:
        _, *names = function.args
        _choose_output(command_result, function, names[0], form.suffix or form.name)
        command_result.add_files(function(), format=form.name, flights=names)

    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(form.name, cls=Command)(write)
    return typer.main.get_command(alone)
