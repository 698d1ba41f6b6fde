"""Flights: imported, briefed, compared, drawn, reported, filmed and exported. `RUN.h5:STAGE` names one, a log, too.

A file that is no whole, undamaged checkpoint is a CheckpointError, one of inputs that this version no longer accepts an
InputError. An argument out of range, a stage without a flight, a file that exists and a program or library that is
missing are a UsageError, what the system refuses to write is a StorageError.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO, cast

from airrace import options
from airrace.options import Option
from airrace.pages.report.film import FilmView, Language
from airrace.pages.views.tables import UNITS
from airrace.runtime.standard_streams import STANDARD, abandon_stdout

if TYPE_CHECKING:
    from airrace.flights.results import Flight
    from airrace.flights.results.comparison import Comparison
    from airrace.runs.log_view import LogView
    from airrace.runs.stage_data import Brief

AnyFlight = Annotated[str, Option("RUN.h5 for its last stage, or RUN.h5:STAGE, or a flight log.", "FLIGHT")]
FlightNames = Annotated[
    str, Option("RUN.h5 for its last stage, or RUN.h5:STAGE, e.g. rovinj.h5:point-mass.", "FLIGHT...")
]
NoOrMoreFlights = Annotated[
    str,
    Option("RUN.h5 for its last stage, or RUN.h5:STAGE, e.g. rovinj.h5:point-mass.", "FLIGHT...", optional=True),
]
MoreFlights = Annotated[
    Sequence[str],
    Option(
        "A flight and who flies it, e.g. run.h5,name=Bee,nation=SUI,number=7,colour=#ff8800; as often as you like.",
        "FLIGHT,KEY=VALUE,...",
    ),
]
Languages = Annotated[Language, Option("Of the texts, and of their numbers.")]
Units = Annotated[
    str, Option("Units for people: knots or km/h, metres or feet; never of --json, --csv.", choices=tuple(UNITS))
]
Lateness = Annotated[
    bool,
    Option("Tell what each cue costs that is 0.1 s late or early; each is solved twice, a minute or more in all."),
]
Drawing = str | Path | None
REPLAY_STEP = 0.1
"""The longest time between two states of a replay, s: accelerations follow from successive ones."""
HEIGHT_OFFSET_MAX = 10_000.0
"""The largest offset of a log's heights, m: no air race is flown higher."""
CostToGo = Annotated[
    bool, Option("Tell what was lost at every moment of the others, by the best that was left; half a minute each.")
]


@dataclass(frozen=True)
class WrittenFlights:
    """A file that was written, and the flights that it shows."""

    path: Path
    flights: "tuple[Flight, ...]"


def import_log(
    log: Annotated[str | Path, Option("The log: CSV, GPX, KML, NMEA, IGC, ACMI or FIT.", "LOG")],
    track: Annotated[
        options.TrackGiven,
        Option(
            "The course of the race: a file, or a name that `airrace tracks` lists.",
            "TRACK",
            flags=("--course",),
            completion="tracks",
        ),
    ],
    *,
    output: Annotated[
        str | Path | None, options.output("FILE.h5", "The flight; by default beside the log, as LOG.h5.")
    ] = None,
    mapping: Annotated[str | Path | None, Option("What the columns of a CSV file mean.", "FILE.yaml")] = None,
    columns: options.Columns = (),
    time_zone: Annotated[
        str | None, Option("Of times that name none: +02:00 or Europe/Zagreb; else UTC.", "ZONE")
    ] = None,
    noise: Annotated[float | None, Option("Standard deviation of the positions; estimated by default.", "M")] = None,
    accuracy: Annotated[
        float | None,
        Option("Standard deviation of what positions are off by together; by default as the log says, else 2.5.", "M"),
    ] = None,
    height_offset: Annotated[
        float, Option("Added to the heights of the log, which count from another zero, e.g. its ellipsoid.", "M")
    ] = 0.0,
    run: Annotated[int | None, Option("Which run through the course, where there are several.", "N", min=1)] = None,
    name: Annotated[str | None, Option("Which aircraft of an ACMI recording.", "NAME")] = None,
    cost_to_go: Annotated[
        str | Path | None,
        Option("Tell what was lost at every moment, by the cost to go of this run's point mass.", "RUN.h5"),
    ] = None,
    aircraft: options.Aircraft = None,
    set: options.Set = (),
    force: options.Force = False,
) -> "LogView":
    """Import a flight log: find its run through a course, smooth it, and tell which rules it would break.

    show, report, compare, plot and export take the file that is written.

    Args:
        output: the file to be written; None for none.
        mapping: a file of the language `airrace/log/1`.
        columns: on top of those of the mapping, `NAME=HEADER [UNIT]` each.
        run: counted from 1; None for the one that passes most closely.

    Raises:
        InputError: course, mapping or log are not valid, or the log does not pass the course; it names file and line.
        UsageError: an argument is out of range, or the file exists.
        StorageError: the system refused to write the file.
    """
    from airrace.errors import UsageError
    from airrace.files.inputs.log_columns import read_layout, with_columns, with_zone
    from airrace.flights.logs.csv_log import ColumnLayout
    from airrace.runs.execution_plan import read_inputs
    from airrace.runs.log_view import fly_log_through
    from airrace.runs.output import documents_of, ensure_free

    path = None if output is None else Path(output)
    if path is not None:
        ensure_free(path, force=force, sources=[log, track, aircraft, mapping])
    inputs = read_inputs(track, aircraft, set=set)
    layout, stated_noise = (ColumnLayout(), None) if mapping is None else read_layout(Path(mapping))
    layout = with_columns(layout, columns)
    layout = layout if time_zone is None else with_zone(layout, time_zone)
    if noise is not None and not 0.0 < noise <= 100.0:
        raise UsageError(f"a noise of {noise:g} m is out of range: it must lie above 0 and not above 100")
    if accuracy is not None and not 0.0 < accuracy <= 100.0:
        raise UsageError(f"an accuracy of {accuracy:g} m is out of range: it must lie above 0 and not above 100")
    if not abs(height_offset) <= HEIGHT_OFFSET_MAX:
        raise UsageError(
            f"a height offset of {height_offset:g} m is out of range: it must lie within +-{HEIGHT_OFFSET_MAX:g}"
        )
    layout = layout if accuracy is None else replace(layout, accuracy=accuracy)
    noise = stated_noise if noise is None else noise
    view = fly_log_through(
        Path(log), inputs, layout=layout, noise=noise, run=run, name=name, height_offset=height_offset
    )
    if path is not None:
        ensure_free(path, force=True, sources=documents_of(inputs))
        view.save(path)
    if cost_to_go is not None:
        from airrace.runs.cost_to_go import log_loss  # loads the solver

        view = replace(view, cost_to_go=log_loss(Path(cost_to_go), view))
    return view


def brief(flight: AnyFlight, *, stage: options.StageOfFlights = None, lateness: Lateness = False) -> "Brief":
    """Tell what the pilot does on every leg: when and where to roll, which way, how hard to pull and for how long."""
    from airrace.runs.flight_sources import open_flight, open_stage
    from airrace.runs.stage_data import Brief

    name = options.stage_text(stage)
    cues = Brief.of(open_flight(flight, stage=name))
    return replace(cues, prices=open_stage(flight, stage=name).cues(lateness=True).prices) if lateness else cues


def compare(
    *flights: FlightNames,
    stage: options.StageOfFlights = None,
    plot: Annotated[
        Drawing,
        Option("Draw the comparison into this file (needs matplotlib); or .svg, .pdf.", "FILE.png", written=True),
    ] = None,
    loss_map: Annotated[
        Drawing,
        Option("Draw a map in the colours of the time lost, likewise.", "FILE.png", flags=("--map",), written=True),
    ] = None,
    cost_to_go: CostToGo = False,
    verify: options.NoVerify = True,
    force: options.Force = False,
) -> "list[Comparison]":
    """Hold flights against the first one: where time is lost, leg by leg, and how the flights differ there."""
    from airrace.errors import UsageError
    from airrace.flights.results.comparison import compare_flights
    from airrace.pages.views.drawing import ensure_drawable, save_figure
    from airrace.runs.flight_sources import open_flights
    from airrace.runs.output import ensure_free

    if len(flights) < 2:
        raise UsageError("a comparison takes two flights or more, e.g. RUN.h5:point-mass RUN.h5:six-dof")
    drawings = [Path(path) for path in (plot, loss_map) if path is not None]
    for path in drawings:
        ensure_drawable(path)
    ensure_free(*drawings, force=force, sources=flights)
    stage_name = options.stage_text(stage)
    reference, *more_flights = open_flights(flights, stage=stage_name, verify=verify, comparable=True)
    comparisons = [compare_flights(reference, flight) for flight in more_flights]
    if cost_to_go:
        from airrace.runs.cost_to_go import losses_by_name  # loads the solver

        losses = losses_by_name(flights, stage=options.stage_text(stage))
        comparisons = [replace(pair, cost_to_go=loss) for pair, loss in zip(comparisons, losses, strict=True)]
    if drawings:
        from airrace.pages.views.flight_figures import comparison_figure, loss_figure

        for path, figure in ((plot, comparison_figure), (loss_map, loss_figure)):
            if path is not None:
                save_figure(figure(comparisons), Path(path))
    return comparisons


def follow(
    run: Annotated[str | Path, options.RUN_FILE],
    *,
    stage: Annotated[str | None, Option("By which it is flown on.", "STAGE", completion="stages")] = "point-mass",
    udp: Annotated[int | None, Option("Read datagrams at this port of 127.0.0.1.", "PORT", min=1, max=65535)] = None,
    replay: Annotated[str | None, Option("Replay this flight instead: a log, or RUN.h5:STAGE.", "FLIGHT")] = None,
    speed: Annotated[float, Option("Of a replay, as times as fast; 0 for without a pause.", "N", min=0)] = 1.0,
    gates: Annotated[int, Option("So many gates ahead the line leads.", "N", min=1)] = 3,
    every: Annotated[float, Option("The least time between two answers.", "S", min=0.05)] = 0.5,
    overlay: Annotated[
        int | None,
        Option(
            "Serve the graphics of films live at this port of 127.0.0.1, as a browser source.", "PORT", min=1, max=65535
        ),
    ] = None,
    delay: Annotated[float, Option("By which the graphics come later than the states.", "S", min=0)] = 0.0,
    entrant: Annotated[
        str, Option("Who flies, for the graphics, e.g. name=Bee,nation=SUI,number=7,colour=#ff8800.", "KEY=VALUE,...")
    ] = "",
    flight: MoreFlights = (),
    language: Languages = Language.EN,
) -> "Iterator[dict[str, object]]":
    """Follow a flight while it is flown: gap, cost to go, next cues and the line of the next gates, as JSON lines.

    States come from standard input, as JSON lines or NMEA sentences, or as datagrams, X-Plane's data output among them.

    Args:
        flight: beside the optimum in the graphics.

    Raises:
        UsageError: the stage is no optimum, or a port is taken.
    """
    from airrace.errors import UsageError
    from airrace.pages.report.film import language_named
    from airrace.runs.flight_sources import open_flights, open_sources
    from airrace.runs.follow import follow_stream, replayed, standard_input, udp_port
    from airrace.runs.stage_view import StageView

    (view,) = open_sources([str(run)], stage=stage)
    if not isinstance(view, StageView):
        raise UsageError(f"{run} is a flight log: a run is followed by its optimum")
    if udp is not None and replay is not None:
        raise UsageError("--udp and --replay exclude each other")
    messages = standard_input() if udp is None else udp_port(udp)
    if replay is not None:
        messages = replayed(open_flights([str(run), replay])[1], every=min(every, REPLAY_STEP), speed=speed)
    if overlay is None:
        if delay or entrant or flight:
            raise UsageError("--delay, --entrant and --flight are of the graphics: add --overlay PORT")
        return follow_stream(view, messages, gates=gates, every=every)
    from airrace.runs.output import entrant_of
    from airrace.runs.overlay import Overlay, follow_with_overlay

    flights = open_flights([str(run), *flight], stage=stage, comparable=True)
    graphics = Overlay(flights, entrant_of(entrant), language_named(language), delay)
    return follow_with_overlay(graphics, overlay, view, messages, gates=gates, every=every)


def plot(
    flight: Annotated[str, Option("RUN.h5 for its last stage, or RUN.h5:STAGE.", "FLIGHT")],
    *,
    output: Annotated[
        Drawing,
        options.output(
            "FILE.png", "The drawing; or .svg, .pdf; by default RUN.png, or RUN.kneeboard.pdf, beside the run."
        ),
    ] = None,
    kneeboard: Annotated[bool, Option("Pages for the knee, lap by lap: map, gates, and cues.")] = False,
    paper: Annotated[
        str, Option("Of the kneeboard: pages of A5, or two on a sheet of A4, to be folded.", choices=("a5", "a4"))
    ] = "a5",
    lateness: Lateness = False,
    units: Units = "kt-m",
    stage: options.StageOfFlights = None,
    force: options.Force = False,
) -> WrittenFlights:
    """Draw a flight: plan and profile by load factor, and histories with their limits (needs matplotlib)."""
    from airrace.pages.views.drawing import ensure_drawable, save_figure
    from airrace.runs.flight_sources import open_flight, open_stage
    from airrace.runs.output import ensure_free, output_path

    path = output_path(output, flight, "kneeboard.pdf" if kneeboard else "png")
    ensure_drawable(path)
    ensure_free(path, force=force, sources=[flight])
    flight_ = open_flight(flight, stage=options.stage_text(stage))
    from airrace.pages.views.flight_figures import flight_figure
    from airrace.pages.views.kneeboard import save_kneeboard
    from airrace.pages.views.tables import units_named

    if kneeboard:
        prices = open_stage(flight, stage=options.stage_text(stage)).cues(lateness=True).prices if lateness else ()
        save_kneeboard(flight_, path, units_named(units), paper=paper, prices=prices)
    else:
        save_figure(flight_figure(flight_), path)
    return WrittenFlights(path, (flight_,))


def report(
    run: Annotated[str | Path, options.RUN_FILE],
    *flights: Annotated[
        str,
        Option("Flights that fly beside it: `RUN.h5`, `RUN.h5:STAGE` or a flight log, as many as you like.", "FLIGHT"),
    ],
    output: Annotated[
        str | Path | None, options.output("FILE.html", "The page; by default beside the run, as RUN.html.")
    ] = None,
    stage: options.Stage = None,
    units: Units = "kt-m",
    sensitivities: Annotated[bool, Option("Show the sensitivities to all numbers; takes some seconds.")] = False,
    envelope: Annotated[
        int, Option("Show in the scene how far N closed-loop flights in gusts stray, 95 % of them.", "N")
    ] = 0,
    cost_to_go: CostToGo = False,
    verify: options.NoVerify = True,
    force: options.Force = False,
) -> WrittenFlights:
    """Write a page that shows a flight: in space, over time, leg by leg. It opens in any browser, without a network."""
    from airrace.pages.views.tables import units_named
    from airrace.runs.flight_sources import report_of_flights
    from airrace.runs.output import ensure_free, output_path, write_text

    path, names = output_path(output, run, "html"), [str(run), *flights]
    ensure_free(path, force=force, sources=names)
    beside: list[str] = []
    if cost_to_go:
        from airrace.pages.report.cost_section import cost_section
        from airrace.runs.cost_to_go import losses_by_name  # loads the solver

        beside = [cost_section(loss) for loss in losses_by_name(names, stage=options.stage_text(stage))]
    page, page_flights = report_of_flights(
        names,
        stage=options.stage_text(stage),
        sensitivities=sensitivities,
        verify=verify,
        envelope=envelope,
        units=units_named(units),
        beside=beside,
    )
    write_text(path, page)
    return WrittenFlights(path, tuple(page_flights))


def film(
    *flights: NoOrMoreFlights,
    flight: MoreFlights = (),
    output: Annotated[
        str | Path | None,
        options.output(
            "FILE.mp4",
            "The film; or .mov (ProRes 4444), .zip (PNG), .gif; by default beside the first run, as RUN.mp4.",
        ),
    ] = None,
    view: Annotated[
        FilmView, Option("Cameras at the gates and in the air, or one view of the report throughout.")
    ] = FilmView.TV,
    format: Annotated[str, Option("1280x720, 720x1280, 960x960; of a GIF the half.", "16:9|9:16|1:1")] = "16:9",
    size: Annotated[str | None, Option("Pixels, instead of a format; e.g. 1920x1080.", "WIDTHxHEIGHT")] = None,
    fps: Annotated[
        float | None, Option("Pictures per second, e.g. 50 or 59.94; by default 30, of a GIF 15.", "N")
    ] = None,
    from_: Annotated[float | None, Option("Where the film begins, on the clock of the race.", "S")] = None,
    to: Annotated[float | None, Option("Where it ends; else at the finish.", "S")] = None,
    seconds: Annotated[float | None, Option("How long it is, instead of its end.", "S")] = None,
    graphics_only: Annotated[bool, Option("The graphics on nothing, into a file with an alpha channel.")] = False,
    language: Languages = Language.EN,
    stage: options.StageOfFlights = None,
    verify: options.NoVerify = True,
    force: options.Force = False,
    watch: Callable[[int, int], None] = lambda done, total: None,
) -> WrittenFlights:
    """Film a flight, with others beside it: the scene of the report as television shows it (needs Chromium, ffmpeg).

    A film of several flights ends with the legs on which the gap changed most, in slow motion, and with the result.

    Args:
        watch: is called with the pictures that are drawn and with all, first when the flights are verified.
    """
    from airrace.files.checkpoint.atomic import replace_file
    from airrace.pages.report.contents import race_begins
    from airrace.pages.report.film import film_of, film_settings, language_named
    from airrace.runs.flight_sources import report_of_flights
    from airrace.runs.output import ensure_free, output_path

    names = _named(flights, flight)
    path = output_path(output, names[0], "mp4")
    settings = film_settings(
        path,
        view=view,
        format=format,
        size=size,
        fps=fps,
        from_=from_,
        to=to,
        seconds=seconds,
        graphics_only=graphics_only,
    )
    ensure_free(path, force=force, sources=names)
    page, page_flights = report_of_flights(
        names, stage=options.stage_text(stage), verify=verify, language=language_named(language)
    )
    replace_file(path, film_of(page, settings, path.suffix, watch, race_begins(page_flights[0])))
    return WrittenFlights(path, tuple(page_flights))


def card(
    *flights: NoOrMoreFlights,
    flight: MoreFlights = (),
    output: Annotated[
        str | Path | None, options.output("FILE.png", "The card; by default beside the run, as RUN.card.png.")
    ] = None,
    language: Languages = Language.EN,
    stage: options.StageOfFlights = None,
    verify: options.NoVerify = True,
    force: options.Force = False,
    watch: Callable[[int, int], None] = lambda done, total: None,
) -> WrittenFlights:
    """Draw a card of a flight, or of a duel of two, for a message or an article: lines, times (needs Chromium).

    It is 1200 pixels wide and 630 high.

    Args:
        watch: is called with 0 and 1 when the flights are verified, and with 1 and 1 when the card is drawn.
    """
    from airrace.errors import UsageError
    from airrace.files.checkpoint.atomic import replace_file
    from airrace.pages.report.film import card_of, ensure_card, language_named
    from airrace.runs.flight_sources import report_of_flights
    from airrace.runs.output import ensure_free, output_path

    names = _named(flights, flight)
    if len(names) > 2:
        raise UsageError("a card shows one flight, or two in a duel")
    path = output_path(output, names[0], "card.png")
    ensure_card(path)
    ensure_free(path, force=force, sources=names)
    page, page_flights = report_of_flights(
        names, stage=options.stage_text(stage), verify=verify, language=language_named(language)
    )
    watch(0, 1)
    replace_file(path, card_of(page))
    watch(1, 1)
    return WrittenFlights(path, tuple(page_flights))


def _named(flights: Sequence[str], more: Sequence[str]) -> list[str]:
    """Return the flights of a film or a card by both ways of naming them.

    Raises:
        UsageError: there are none.
    """
    from airrace.errors import UsageError

    names = [*flights, *more]
    if not names:
        raise UsageError("name a flight: RUN.h5, or --flight RUN.h5,name=...")
    return names


def export(
    format: str,
    *flights: FlightNames,
    output: Annotated[
        str | Path | None, options.output("FILE", "The file; by default beside the first run, as RUN.FORMAT.")
    ] = None,
    stage: options.StageOfFlights = None,
    rate: Annotated[float | None, Option("Samples per second; by default what suits the format.", "HZ")] = None,
    origin: options.Origin = None,
    start: Annotated[
        str | None,
        Option("When the clock starts, e.g. 2014-04-13T12:00:00Z; by default as of a log, else in 2000.", "TIME"),
    ] = None,
    model: Annotated[
        str | None,
        Option("The aircraft that X-Plane shows; by default a Cessna 172.", "FILE.acf", flags=("--aircraft-model",)),
    ] = None,
    force: options.Force = False,
) -> Path:
    """Write flights for another program; return the path of the file.

    Args:
        format: e.g. `kml`, `acmi`, `netcdf`; see `airrace.files.export.formats`.

    Raises:
        CheckpointError: a file is no whole, undamaged checkpoint.
        UsageError: there is no such format or stage, an argument is out of range, the file exists, the course has no
            origin where the format needs one, or a library that it needs is not installed.
        StorageError: the system refused to write the file.
    """
    from airrace.files.export.formats import formats
    from airrace.runs.flight_sources import open_flights, write_flights
    from airrace.runs.output import ensure_free, output_path

    exporter = formats().get(format)
    path = output_path(output, flights[0], format if exporter is None else exporter.suffix or format)
    ensure_free(path, force=force, sources=flights)
    write_flights(
        format,
        lambda: open_flights(flights, stage=options.stage_text(stage)),
        path,
        rate=rate,
        origin=origin,
        start=start,
        model=model,
    )
    return path


def export_csv(
    flight: AnyFlight,
    *,
    stage: options.StageOfFlights = None,
    rate: Annotated[float | None, Option("Rows per second; by default one row per node of the mesh.", "HZ")] = None,
    output: Annotated[
        str | Path, options.output("FILE", "Write here instead of to stdout, and the gate splits beside it.")
    ] = STANDARD,
    splits: Annotated[bool, Option("Write the gate splits instead of the flight.")] = False,
    force: options.Force = False,
) -> Sequence[Path]:
    """Write comma-separated values: the flight as one table, the gate splits as another.

    Headers name the units. To stdout goes one table alone: the flight, or the gate splits with --splits.

    Returns:
        The files.
    """
    from airrace.errors import UsageError
    from airrace.pages.views.plain_text import PlainStream
    from airrace.runs.flight_sources import open_file, source_of
    from airrace.runs.log_view import LogView
    from airrace.runs.output import FlightName, ensure_file_name, ensure_free
    from airrace.runs.stage_data import Splits

    if splits and rate is not None:
        raise UsageError("gate splits have no rate; leave out --splits or --rate")
    path = Path(output)
    ensure_file_name(path)
    beside = [] if splits or path == STANDARD else [path.with_suffix(f".splits{path.suffix}")]
    ensure_free(path, *beside, force=force, sources=[flight])
    name = FlightName.of(flight)
    view = source_of(open_file(name.path), name.stage or options.stage_text(stage))
    passings = view.splits if isinstance(view, LogView) else Splits(view.result.splits)
    if path == STANDARD:
        stream = cast(TextIO, PlainStream(sys.stdout))
        try:
            _ = stream.write(passings.to_csv()) if splits else view.write_csv(stream, rate)
        except BrokenPipeError:  # the reader has seen enough
            abandon_stdout()
    elif splits:
        passings.to_csv(path)
    else:
        view.to_csv(path, rate)
    for splits_path in beside:
        passings.to_csv(splits_path)
    return [path, *beside]
