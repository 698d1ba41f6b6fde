"""Commands around flights: `import`, `brief`, `compare`, `plot`, `report`, `film`, `card` and `export`."""

import inspect
import sys
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO, cast

import typer
from typer.core import TyperGroup

from airrace.cli.answer import PAGE, answer_with_files, answering, ensure_room, render, takes_unicode
from airrace.cli.options import (
    AircraftFile,
    AnyFlight,
    AsJson,
    Command,
    CsvColumns,
    FlightNames,
    Force,
    NoVerify,
    Overrides,
    Quiet,
    RunFile,
    StageOfFlights,
    StageOfRun,
    Verbose,
    file_option,
    output_option,
    track_option,
)
from airrace.report.film import FilmView
from airrace.standard_streams import STANDARD, abandon_stdout, name_of

if TYPE_CHECKING:
    from airrace.export.formats import Format


def import_log(
    log: Annotated[Path, typer.Argument(metavar="LOG", readable=False, help="The log: CSV, GPX, IGC or ACMI.")],
    course: Annotated[Path, track_option("The course of the race: a file, or a name that `airrace tracks` lists.")],
    output: Annotated[
        Path | None, output_option("FILE.h5", "The flight; by default beside the log, as LOG.h5.")
    ] = None,
    mapping: Annotated[Path | None, file_option("FILE.yaml", "What the columns of a CSV file mean.")] = None,
    column: CsvColumns = None,
    time_zone: Annotated[
        str | None, typer.Option(metavar="ZONE", help="Of times that name none: +02:00 or Europe/Zagreb; else UTC.")
    ] = None,
    noise: Annotated[
        float | None, typer.Option(metavar="M", help="Standard deviation of the positions; estimated by default.")
    ] = None,
    run: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Which run through the course, where there are several.")
    ] = None,
    name: Annotated[str | None, typer.Option(metavar="NAME", help="Which aircraft of an ACMI recording.")] = None,
    aircraft: AircraftFile = None,
    overrides: Overrides = None,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Import a flight log: find its run through a course, smooth it, and tell which rules it would break.

    show, report, compare, plot and export take the file that is written.
    """
    with answering({"flown": True, "log": name_of(log)}, as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.output import default_output_path, documents_of, ensure_free, ensure_unread

        path = output or default_output_path(log, "h5")
        ensure_room(path, as_json=as_json)
        ensure_free(path, force=force, sources=[log, course, aircraft, mapping])
        from airrace.api import import_log as imported
        from airrace.cli.flight_tables import log_texts

        log_view = imported(
            log,
            course,
            aircraft=aircraft,
            set=overrides or (),
            mapping=mapping,
            columns=column or (),
            time_zone=time_zone,
            noise=noise,
            run=run,
            name=name,
        )
        ensure_unread([path], documents_of(log_view.inputs))
        log_view.save(path)
        answer.fields.update(log_view.as_object())
        if not quiet and path != STANDARD:
            answer.texts.extend(log_texts(log_view))
        answer_with_files(answer, [path], quiet=quiet)


class UnitsName(StrEnum):
    """Units of speed and length for people; those of `airrace.views.tables`."""

    KT_M = "kt-m"
    KT_FT = "kt-ft"
    KMH_M = "kmh-m"


UnitsOption = Annotated[
    UnitsName, typer.Option("--units", help="Units for people: knots or km/h, metres or feet; never of --json, --csv.")
]


def brief(
    name: AnyFlight,
    stage: StageOfFlights = None,
    units: UnitsOption = UnitsName.KT_M,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print comma-separated values, one row per action.")] = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Tell what the pilot does on every leg: when and where to roll, which way, how hard to pull and for how long."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.errors import UsageError
        from airrace.runs.flight_sources import open_flight
        from airrace.runs.stage_data import Brief
        from airrace.views.tables import units_named

        if as_json and as_csv:
            raise UsageError("--json and --csv exclude each other")
        brief = Brief.of(open_flight(name, stage=stage))
        answer.fields.update(brief.as_object())
        if as_csv:
            answer.texts.append(brief.to_csv())
        elif not as_json:
            answer.texts.append(render(brief.table(units_named(units), unicode=takes_unicode()), columns=PAGE))


def compare(
    names: FlightNames,
    stage: StageOfFlights = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png", help="Draw the comparison into this file (needs matplotlib); or .svg, .pdf."),
    ] = None,
    loss_map: Annotated[
        Path | None,
        typer.Option("--map", metavar="FILE.png", help="Draw a map in the colours of the time lost, likewise."),
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="List the legs that are ties as well.")] = False,
    no_verify: NoVerify = False,
    force: Force = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Hold flights against the first one: where time is lost, leg by leg, and how the flights differ there."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.errors import UsageError
        from airrace.runs.output import ensure_free
        from airrace.views.drawing import ensure_drawable, save_figure

        if len(names) < 2:
            raise UsageError("a comparison takes two flights or more, e.g. RUN.h5:point-mass RUN.h5:six-dof")
        drawings = [one for one in (plot, loss_map) if one is not None]
        ensure_room(*drawings, as_json=as_json)
        if plot is not None and plot == loss_map:
            raise UsageError("--plot and --map name the same file")
        for path in drawings:
            ensure_drawable(path)
            ensure_free(path, force=force, sources=names)
        from airrace.cli.run_tables import comparison_texts
        from airrace.results.comparison import compare_flights
        from airrace.runs.flight_sources import open_flights
        from airrace.runs.json_objects import comparison_object

        reference, *others = flights = open_flights(names, stage=stage, verify=not no_verify)
        answer.fail_if_refuted({one.label: one.source.confirmation for one in flights})
        comparisons = [compare_flights(reference, other) for other in others]
        answer.fields.update(comparison_object(reference, comparisons))
        if drawings:
            from airrace.views.flight_figures import comparison_figure, loss_figure

            for path, figure in ((plot, comparison_figure), (loss_map, loss_figure)):
                if path is not None:
                    save_figure(figure(comparisons), path)
        if not as_json and STANDARD not in drawings:
            answer.texts += comparison_texts(comparisons, every=every)


def plot(
    name: Annotated[str, typer.Argument(metavar="FLIGHT", help="RUN.h5 for its last stage, or RUN.h5:STAGE.")],
    output: Annotated[
        Path | None,
        output_option(
            "FILE.png", "The drawing; or .svg, .pdf; by default RUN.png, or RUN.kneeboard.png, beside the run."
        ),
    ] = None,
    kneeboard: Annotated[
        bool, typer.Option("--kneeboard", help="One page to hold in the hand: map, table of the gates, and cues.")
    ] = False,
    units: UnitsOption = UnitsName.KT_M,
    stage: StageOfFlights = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Draw a flight: plan and profile by load factor, and histories with their limits (needs matplotlib)."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.flight_sources import open_flight
        from airrace.runs.output import default_output_path, ensure_free
        from airrace.views.drawing import ensure_drawable, save_figure

        path = output or default_output_path(name, "kneeboard.png" if kneeboard else "png")
        ensure_room(path, as_json=as_json)
        ensure_drawable(path)
        ensure_free(path, force=force, sources=[name])
        flight = open_flight(name, stage=stage)
        from airrace.views.flight_figures import flight_figure
        from airrace.views.kneeboard import kneeboard_figure
        from airrace.views.tables import units_named

        save_figure(kneeboard_figure(flight, units_named(units)) if kneeboard else flight_figure(flight), path)
        answer_with_files(answer, [path], quiet=quiet, format=path.suffix[1:].lower() or "png", flights=[name])


def report(
    run_file: RunFile,
    flights: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="FLIGHT",
            help="Flights that fly beside it: `RUN.h5`, `RUN.h5:STAGE` or a flight log, as many as you like.",
        ),
    ] = None,
    output: Annotated[
        Path | None, output_option("FILE.html", "The page; by default beside the run, as RUN.html.")
    ] = None,
    stage: StageOfRun = None,
    sensitivities: Annotated[
        bool, typer.Option("--sensitivities", help="Show the sensitivities to all numbers; takes some seconds.")
    ] = False,
    envelope: Annotated[
        int,
        typer.Option(metavar="N", help="Show in the scene how far N closed-loop flights in gusts stray, 95 % of them."),
    ] = 0,
    no_verify: NoVerify = False,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write a page that shows a flight: in space, over time, leg by leg. It opens in any browser, without a network."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.flight_sources import report_of_flights
        from airrace.runs.output import default_output_path, ensure_free, write_text

        path = output or default_output_path(run_file, "html")
        names = [str(run_file), *(flights or [])]
        ensure_room(path, as_json=as_json)
        ensure_free(path, force=force, sources=names)
        page, opened = report_of_flights(
            names, stage=stage, sensitivities=sensitivities, verify=not no_verify, envelope=envelope
        )
        write_text(path, page)
        confirmations = {one.label: one.source.confirmation for one in opened}
        answer.fields["verified"] = [one and one.verified for one in confirmations.values()]
        answer.fields["verification"] = [one and one.words for one in confirmations.values()]
        answer_with_files(answer, [path], quiet=quiet, remark="; any browser opens it", format="html", flights=names)
        if not quiet:
            answer.texts.extend(f"{label}: {one.remark}" for label, one in confirmations.items() if one is not None)
        answer.fail_if_refuted(confirmations)


class _Formats(TyperGroup):
    """The subcommands: `csv`, and one for every registered format, made when the first of them is looked up."""

    # Any: contexts and commands belong to click, whose place depends on typer's version.
    def list_commands(self, ctx: Any) -> list[str]:
        return [*super().list_commands(ctx), *(name for name in _formats() if name not in self.commands)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        known = super().get_command(ctx, cmd_name)
        form = None if known else _formats().get(cmd_name)
        return known if form is None else _subcommand(form)


export = typer.Typer(name="export", help="Write a flight for other programs.", no_args_is_help=True, cls=_Formats)


@export.callback()
def _common() -> None:
    """Write a flight for other programs."""


@export.command("csv", cls=Command)
def csv_table(
    name: AnyFlight,
    stage: StageOfFlights = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Rows per second; by default one row per node of the mesh.")
    ] = None,
    output: Annotated[
        Path, output_option("FILE", "Write here instead of to stdout, and the gate splits beside it.")
    ] = STANDARD,
    splits: Annotated[bool, typer.Option("--splits", help="Write the gate splits instead of the flight.")] = False,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write comma-separated values: the flight as one table, the gate splits as another.

    Headers name the units. To stdout goes one table alone: the flight, or the gate splits with --splits.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.errors import UsageError
        from airrace.runs.flight_sources import open_file, source_of
        from airrace.runs.log_view import LogView
        from airrace.runs.output import FlightName, ensure_file_name, ensure_free
        from airrace.runs.stage_data import Splits
        from airrace.views.plain_text import PlainStream

        if splits and rate is not None:
            raise UsageError("gate splits have no rate; leave out --splits or --rate")
        ensure_room(output, as_json=as_json)
        ensure_file_name(output)
        beside = [] if splits or output == STANDARD else [output.with_suffix(f".splits{output.suffix}")]
        for path in (output, *beside):
            ensure_free(path, force=force, sources=[name])
        named = FlightName.of(name)
        view = source_of(open_file(named.path), named.stage or stage)
        passings = view.splits if isinstance(view, LogView) else Splits(view.result.splits)
        if output != STANDARD:
            _ = passings.to_csv(output) if splits else view.to_csv(output, rate)
        elif splits:
            answer.texts.append(passings.to_csv())
        else:
            try:
                view.write_csv(cast(TextIO, PlainStream(sys.stdout)), rate)
            except BrokenPipeError:  # the reader has seen enough
                abandon_stdout()
        for path in beside:
            passings.to_csv(path)
        answer_with_files(answer, [output, *beside], quiet=quiet, format="csv", flights=[name])


def _formats() -> Mapping[str, "Format"]:
    from airrace.errors import UsageError
    from airrace.export.formats import formats

    try:
        return formats()
    except UsageError as error:
        raise typer.BadParameter(str(error)) from error


def _subcommand(form: "Format") -> Any:  # Any: as above
    """Return the subcommand of a format."""

    def write(
        names: FlightNames,
        output: Annotated[
            Path | None, output_option("FILE", "The file; by default beside the first run, as RUN.FORMAT.")
        ] = None,
        stage: StageOfFlights = None,
        rate: Annotated[
            float | None, typer.Option(metavar="HZ", help="Samples per second; by default what suits the format.")
        ] = None,
        origin: Annotated[
            str | None,
            typer.Option(metavar="LAT,LON,ELEV", help="Where the course lies: degrees, and metres above the sea."),
        ] = None,
        start: Annotated[
            str | None,
            typer.Option(metavar="TIME", help="When the clock starts, e.g. 2014-04-13T12:00:00Z; by default in 2000."),
        ] = None,
        aircraft_model: Annotated[
            str | None,
            typer.Option(metavar="FILE.acf", help="The aircraft that X-Plane shows; by default a Cessna 172."),
        ] = None,
        force: Force = False,
        as_json: AsJson = False,
        quiet: Quiet = False,
        verbose: Verbose = False,
    ) -> None:
        with answering(as_json=as_json, verbose=verbose) as answer:
            from airrace.runs.flight_sources import open_flights, write_flights
            from airrace.runs.output import default_output_path, ensure_free

            path = output or default_output_path(names[0], form.suffix or form.name)
            ensure_room(path, as_json=as_json)
            ensure_free(path, force=force, sources=names)
            write_flights(
                form.name,
                lambda: open_flights(names, stage=stage),
                path,
                rate=rate,
                origin=origin,
                start=start,
                model=aircraft_model,
            )
            answer_with_files(answer, [path], quiet=quiet, format=form.name, flights=names)

    if not form.has_models:  # then there is nothing to choose
        signature = inspect.signature(write)
        parameters = [one for name, one in signature.parameters.items() if name != "aircraft_model"]
        write.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(form.name, help=form.help, cls=Command)(write)
    return typer.main.get_command(alone)


def film(
    names: FlightNames,
    output: Annotated[
        Path | None, output_option("FILE.mp4", "The film; or .gif; by default beside the first run, as RUN.mp4.")
    ] = None,
    view: Annotated[
        FilmView, typer.Option(help="Cameras at the gates and in the air, or one view of the report throughout.")
    ] = FilmView.TV,
    form: Annotated[
        str,
        typer.Option("--format", metavar="16:9|9:16|1:1", help="1280x720, 720x1280, 960x960; of a GIF the half."),
    ] = "16:9",
    size: Annotated[
        str | None, typer.Option(metavar="WIDTHxHEIGHT", help="Pixels, instead of a format; e.g. 1920x1080.")
    ] = None,
    fps: Annotated[
        float | None, typer.Option(metavar="N", help="Pictures per second; by default 30, of a GIF 15.")
    ] = None,
    begin: Annotated[
        float | None, typer.Option("--from", metavar="S", help="Where the film begins, on the clock of the race.")
    ] = None,
    end: Annotated[float | None, typer.Option("--to", metavar="S", help="Where it ends; else at the finish.")] = None,
    seconds: Annotated[float | None, typer.Option(metavar="S", help="How long it is, instead of its end.")] = None,
    stage: StageOfFlights = None,
    no_verify: NoVerify = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Film a flight, with others beside it: the scene of the report as television shows it (needs Chromium, ffmpeg)."""
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.checkpoint.atomic import replace_file
        from airrace.report.film import film_of, film_settings
        from airrace.runs.flight_sources import report_of_flights
        from airrace.runs.output import default_output_path, ensure_free
        from airrace.views.plain_text import SafeStream

        path = output or default_output_path(names[0], "mp4")
        settings = film_settings(path, view=view, format=form, size=size, fps=fps, from_=begin, to=end, seconds=seconds)
        ensure_room(path, as_json=as_json)
        ensure_free(path, force=force, sources=names)
        page, opened = report_of_flights(names, stage=stage, verify=not no_verify)
        answer.fail_if_refuted({one.label: one.source.confirmation for one in opened})
        watched = not quiet and sys.stderr.isatty()
        terminal = SafeStream(sys.stderr, commanded=True)

        def watch(share: float) -> None:
            print(f"\rfilming: {share:4.0%}", end="\n" if share == 1.0 else "", file=terminal, flush=True)

        replace_file(path, film_of(page, settings, path.suffix, *[watch] * watched))
        answer_with_files(answer, [path], quiet=quiet, format=path.suffix[1:].lower(), flights=names)


def card(
    name: AnyFlight,
    output: Annotated[
        Path | None, output_option("FILE.png", "The card; by default beside the run, as RUN.card.png.")
    ] = None,
    stage: StageOfFlights = None,
    no_verify: NoVerify = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Draw a card of a flight for a message or an article: line, name, aircraft, time, wind (needs Chromium).

    It is 1200 pixels wide and 630 high.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.checkpoint.atomic import replace_file
        from airrace.report.film import card_of, ensure_card
        from airrace.runs.flight_sources import report_of_flights
        from airrace.runs.output import default_output_path, ensure_free

        path = output or default_output_path(name, "card.png")
        ensure_card(path)
        ensure_room(path, as_json=as_json)
        ensure_free(path, force=force, sources=[name])
        page, opened = report_of_flights([name], stage=stage, verify=not no_verify)
        answer.fail_if_refuted({one.label: one.source.confirmation for one in opened})
        replace_file(path, card_of(page))
        answer_with_files(answer, [path], quiet=quiet, format="png", flights=[name])
