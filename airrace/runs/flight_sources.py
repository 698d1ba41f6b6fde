"""Flights by the names that every command takes: opened, exported, reported, and the footprints of falls from them.

`RUN.h5` is the last stage of a run, `RUN.h5:STAGE` another one, `LOG.h5` an imported log, and `LOG.csv` a log itself.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from airrace.errors import NotCertified, UsageError
from airrace.files.checkpoint import LogCheckpoint, read_stored
from airrace.files.checkpoint.atomic import replace_file
from airrace.files.export.formats import formats
from airrace.files.export.globe import clock_start, on_globe
from airrace.flights.logs.reading import is_log
from airrace.flights.results import Flight, Verification
from airrace.flights.results.comparison import ensure_comparable
from airrace.model.track.course import Origin
from airrace.pages.report.film import Language
from airrace.pages.views.drawing import FORMATS, ensure_drawable, save_figure
from airrace.pages.views.stage_tables import claim
from airrace.pages.views.tables import RACE, Units
from airrace.procedure.stage import Stage
from airrace.runs.log_view import LogView, fly_log_through, open_log
from airrace.runs.output import FlightName, write_text
from airrace.runs.run_state import RunState, ensure_readable, run_of_checkpoint
from airrace.runs.stage_view import StageView
from airrace.runtime.standard_streams import name_of

if TYPE_CHECKING:
    from airrace.flights.safety.footprint import Footprint


def open_flights(
    texts: Sequence[str], *, stage: str | None = None, verify: bool | None = None, comparable: bool = False
) -> list[Flight]:
    """Return the flights of these names, each with a label of its own.

    Labels are the names of the files as they are given, with the stage where one was named or the flights are of
    several ones; with their folders where that tells them apart, and with a number where one is given twice. A log
    that is not imported yet is aligned with the course of the first file that has one.

    Args:
        texts: `RUN.h5`, `RUN.h5:STAGE`, a flight log `LOG.h5`, or a log itself each.
        stage: for runs whose names say none; None for their last ones.
        verify: whether stages of runs are measured again, and imported logs made once more, and several of them are
            judged together; None where that is no question.
        comparable: whether they must be of courses with the same passings, which is found out before all else.

    Raises:
        CheckpointError: a file is no whole, undamaged checkpoint.
        InputError: this version of airrace no longer accepts its inputs, or a log is not valid.
        UsageError: a run has no such stage, or that found no flight, or no course is at hand for a log, or flights
            that must be comparable are not.
    """
    return _open_with_files(texts, stage, verify, comparable=comparable)[1]


def open_sources(texts: Sequence[str], *, stage: str | None = None) -> list[StageView | LogView]:
    """Return the stages and logs of these names, as they are stored; errors as of `open_flights`."""
    names = [FlightName.of(text) for text in texts]
    opened = {name.path: open_file(name.path) for name in names if not _is_log(name)}
    return [_source(name, opened, stage) for name in names]


def _open_with_files(
    texts: Sequence[str], stage: str | None, verify: bool | None, *, comparable: bool = False
) -> tuple[dict[Path, RunState | LogView], list[Flight]]:
    """Return the files by their paths beside the flights of `open_flights`."""
    names = [FlightName.of(text) for text in texts]
    opened = {name.path: open_file(name.path) for name in names if not _is_log(name)}
    if comparable:
        courses = [
            (text, opened[name.path].inputs.race.course)
            for text, name in zip(texts, names, strict=True)
            if name.path in opened
        ]
        for named_course in courses[1:]:
            ensure_comparable(courses[0], named_course)
    sources = [_source(name, opened, stage) for name in names]
    labels = _labels(texts, names, sources)
    if verify is not None:
        from airrace.runs.verification import with_verification, with_verifications  # loads the solver

        for path, run_or_log in opened.items():
            if isinstance(run_or_log, LogView):
                opened[path] = with_verification(run_or_log, verify=verify)
            else:
                stages: set[Stage] = set()
                for name, source in zip(names, sources, strict=True):
                    if name.path == path and isinstance(source, StageView):
                        stages.add(source.stage)
                opened[path] = with_verifications(run_or_log, stages, verify=verify)
        for number, name in enumerate(names):
            if not _is_log(name):
                sources[number] = _source(name, opened, stage)
    if verify and sum(isinstance(source, LogView) for source in sources) > 1:
        from airrace.runs.joint_judgement import log_views_judged_together  # loads what makes flights of logs

        numbers = [number for number, source in enumerate(sources) if isinstance(source, LogView)]
        views = [source for source in sources if isinstance(source, LogView)]
        for number, view in zip(numbers, log_views_judged_together(views), strict=True):
            sources[number] = view
            if names[number].path in opened:
                opened[names[number].path] = view
    flights = [source.flight(label) for source, label in zip(sources, labels, strict=True)]
    sources_named = (replace(flight.source, entrant=name.entrant) for flight, name in zip(flights, names, strict=True))
    return opened, [replace(flight, source=source) for flight, source in zip(flights, sources_named, strict=True)]


def open_flight(text: str, *, stage: str | None = None) -> Flight:
    """Return the one flight of a name; errors as of `open_flights`."""
    return open_flights([text], stage=stage)[0]


def open_stage(text: str, *, stage: str | None = None) -> StageView:
    """Return the stage of a run that a name tells; errors as of `open_flights`.

    Raises:
        UsageError: it is a flight log.
    """
    name = FlightName.of(text)
    opened = None if _is_log(name) else source_of(open_file(name.path), name.stage or stage)
    if not isinstance(opened, StageView):
        raise UsageError(f"{text} is a flight log; only the stage of a run is solved again")
    return opened


def open_file(path: Path) -> RunState | LogView:
    """Return the run or the flight log in a file; errors as of `open_flights`."""
    stored = read_stored(path)
    return open_log(stored) if isinstance(stored, LogCheckpoint) else ensure_readable(run_of_checkpoint(stored, path))


def source_of(opened: RunState | LogView, stage: str | None) -> StageView | LogView:
    """Return the stage of a run, None for its last one, or a flight log, which has no stages.

    Raises:
        UsageError: there is no such stage.
    """
    if isinstance(opened, RunState):
        return opened.stage(stage)
    if stage is not None:
        raise UsageError(f"a flight log has no stages; leave `{stage}` out")
    return opened


def _is_log(name: FlightName) -> bool:
    return name.stage is None and is_log(name.path)


def _source(name: FlightName, opened: Mapping[Path, RunState | LogView], stage: str | None) -> StageView | LogView:
    if not _is_log(name):
        opened_file = opened[name.path]
        return source_of(opened_file, name.stage or (stage if isinstance(opened_file, RunState) else None))
    if not opened:
        raise UsageError(
            f"no course is at hand for the log {name.path}; import it with `airrace import {name.path} --course TRACK`"
        )
    return fly_log_through(name.path, next(iter(opened.values())).inputs)


def _labels(texts: Sequence[str], names: Sequence[FlightName], sources: Sequence[StageView | LogView]) -> list[str]:
    """Return unique labels: who flies, else the file's name without its folder where that tells no two apart."""
    stages = [source.name if isinstance(source, StageView) else "" for source in sources]
    several = len(set(filter(None, stages))) > 1
    endings = [
        f":{name.stage or stage}" if name.stage or (several and stage) else ""
        for name, stage in zip(names, stages, strict=True)
    ]
    labels = [
        name.entrant.name or f"{Path(name_of(name.path)).name}{ending}"
        for name, ending in zip(names, endings, strict=True)
    ]
    if len(set(labels)) < len(labels):
        labels = [
            name.entrant.name or (text if name.stage else f"{text}{ending}")
            for text, name, ending in zip(texts, names, endings, strict=True)
        ]
    if len(set(labels)) < len(labels):
        labels = [f"{label} ({number})" for number, label in enumerate(labels, start=1)]
    return labels


def write_flights(
    format_name: str,
    open_them: Callable[[], Sequence[Flight]],
    path: Path,
    *,
    rate: float | None = None,
    origin: str | None = None,
    start: str | None = None,
    model: str | None = None,
) -> None:
    """Write flights into a file, as `airrace export FORMAT` does.

    Args:
        format_name: one of `airrace.files.export.formats.formats()`.
        open_them: opens the flights, at least one, once the other arguments are known to make sense.
        path: the file, which is replaced as a whole.
        rate: samples per second; None for what suits the format.
        origin: where the courses lie, `LAT,LON` or `LAT,LON,ELEV` (degrees, m); None for what they say.
        start: when the clock starts, ISO 8601, UTC unless it says otherwise; None for the clock of the flights.
        model: an aircraft of the viewer's own, which X-Plane has; None for the usual one.

    Raises:
        UsageError: there is no such format, an argument is out of range, a course has no origin where the format
            needs one, or a library that it needs is not installed.
        StorageError: the system refused.
    """
    if format_name not in formats():
        raise UsageError(f"there is no format {format_name!r}; known are {', '.join(formats())}")
    chosen, where = formats()[format_name], None if origin is None else origin_of(origin)
    stated = None if start is None else begin_of(start)
    if model is not None and not chosen.has_models:
        raise UsageError(f"the viewers of {format_name} have no aircraft of their own; leave out the model")
    low, high = 1e-3, 1e4  # Hz
    if rate is not None and not low <= rate <= high:
        raise UsageError(f"a rate of {rate:g} Hz cannot be exported: it must lie between {low:g} and {high:g}")
    flights = open_them()
    if chosen.globe or where is not None:
        flights = [on_globe(flight, where) for flight in flights]
    hertz = chosen.rate_hz if rate is None else rate
    if hertz is not None:
        flights = [flight.at_rate(hertz) for flight in flights]
    replace_file(path, chosen.write(flights, stated or clock_start(flights), model))


def origin_of(text: str) -> Origin:
    """Return the place that `LAT,LON,ELEV` names; without an elevation at the level of the sea.

    Raises:
        UsageError: it names none.
    """
    try:
        latitude, longitude, *rest = (float(number) for number in text.split(","))
        (elevation,) = rest or [0.0]
    except ValueError as error:
        raise UsageError(f"--origin {text}: expected LAT,LON,ELEV, e.g. 45.08,13.63,0") from error
    on_earth = abs(latitude) < 90.0 and abs(longitude) <= 180.0 and -500.0 <= elevation <= 9000.0
    if not on_earth:
        raise UsageError(f"--origin {text}: no place has this latitude, longitude (degrees) and elevation (m)")
    return Origin(math.radians(latitude), math.radians(longitude), elevation)


def begin_of(text: str) -> datetime:
    """Return the instant that an ISO 8601 text names, UTC unless it says otherwise.

    Raises:
        UsageError: it names none.
    """
    try:
        when = datetime.fromisoformat(text)
    except ValueError as error:
        raise UsageError(f"--start {text}: expected a time such as 2014-04-13T12:00:00Z") from error
    if not 1 < when.year < 9999:
        raise UsageError(f"--start {text}: expected a time such as 2014-04-13T12:00:00Z")
    return when if when.tzinfo is not None else when.replace(tzinfo=UTC)


def ensure_footprint_file(path: Path) -> None:
    """Find out now whether a footprint can be written into a file of this name.

    Raises:
        UsageError: the name says no known format, or a drawing needs matplotlib.
    """
    suffix, suffixes = path.suffix.lower(), (".geojson", ".kml", ".csv", *FORMATS)
    if suffix not in suffixes:
        raise UsageError(f"cannot write a footprint into {path}; its name must end in one of {', '.join(suffixes)}")
    if suffix in FORMATS:
        ensure_drawable(path)


def flight_footprint(
    flight: Flight, drag_area: float | None, glide_ratio: float | None, output: Path | None, origin: str | None = None
) -> "Footprint":
    """Return what falls where from a flight.

    Args:
        flight: from which it falls.
        drag_area, glide_ratio: see `footprint_of`.
        output: the file into which it is written, in the format that its name says; None for none.
        origin: where the course lies, see `origin_of`; None for what it says.

    Raises:
        UsageError: an argument is out of range, there is no such format, or the course has no origin where the
            format needs one.
        StorageError: the system refused.
    """
    from airrace.flights.safety.footprint import Track, footprint_of  # takes scipy, which no reader of runs needs

    place = None if origin is None else origin_of(origin)
    footprint = footprint_of(flight.race, [Track.from_flight(flight)], drag_area=drag_area, glide_ratio=glide_ratio)
    if output is None:
        return footprint
    from airrace.files.export.footprint_files import footprint_csv, footprint_geojson, footprint_kml

    ensure_footprint_file(output)
    suffix = output.suffix.lower()
    if suffix in FORMATS:
        from airrace.pages.views.safety_views import footprint_figure

        save_figure(footprint_figure(footprint, flight), output)
    elif suffix == ".csv":
        write_text(output, footprint_csv(footprint))
    else:
        write = footprint_geojson if suffix == ".geojson" else footprint_kml
        write_text(output, write(footprint, on_globe(flight, place).at_rate(10.0), clock_start([flight])).decode())
    return footprint


def report_of_flights(
    names: Sequence[str],
    *,
    stage: str | None = None,
    sensitivities: bool = False,
    verify: bool = True,
    envelope: int = 0,
    units: Units = RACE,
    beside: Sequence[str] = (),
    language: Language = Language.EN,
) -> tuple[str, list[Flight]]:
    """Return the page as text, and its flights.

    Args:
        names: `RUN.h5`, `RUN.h5:STAGE` or a flight log each; the report is about the first of them, the others fly
            beside it.
        stage: for those that name none; None for the last one of the run.
        sensitivities: whether the sensitivities are computed and shown, which takes some seconds.
        verify: whether the stages are measured again, which takes about a second each.
        envelope: how many closed-loop flights show in the scene how far they stray; 0 for none.
        units: of speeds and lengths.
        beside: sections on the other flights, HTML.
        language: of films and cards that are taken of the page.

    Raises:
        CheckpointError: a file is no whole, undamaged checkpoint.
        InputError: this version of airrace no longer accepts its inputs.
        UsageError: a run has no such stage, or that found no flight, or a flight is of a course with other passings.
        NotCertified: sensitivities were asked for, and the stage is no certified optimum, or the first flight is a log.
    """
    from airrace.pages.report.flight_page import flight_page

    first = FlightName.of(names[0])
    files, flights = _open_with_files(names, stage, verify, comparable=True)
    run_or_log = files[first.path] if first.path in files else open_file(first.path)
    if isinstance(run_or_log, LogView):
        if sensitivities:
            raise NotCertified(f"{first.path} is a flight log: it has no sensitivities")
        if envelope:
            raise UsageError(f"{first.path} is a flight log: no envelope is simulated along it")
        footer = f"airrace {flights[0].source.version}"
        return flight_page(flights, log_sections(run_or_log), footer, units=units, language=language), flights
    view = run_or_log.stage(first.stage or stage)
    page = _stage_page(
        run_or_log,
        view,
        flights,
        sensitivities=sensitivities,
        envelope=envelope,
        units=units,
        beside=beside,
        language=language,
    )
    return page, flights


def log_sections(view: LogView) -> list[str]:
    """Return what a flight log knows besides its flight: passings that break rules, remarks, inputs."""
    from airrace.pages.report.sections import inputs_section, recording_section, violations_section

    log = view.recorded.log
    facts = [("log", log.path), ("format", log.format), ("begins", log.begins or "at an unknown date")]
    facts.append(("start", f"{log.offset:.3f} s after the first sample"))
    if math.isfinite(view.race_time_deviation):
        facts.append(("race time known to", f"{view.race_time_deviation:.2g} s"))
    return [
        violations_section(view.violations, view.assumption),
        recording_section(facts, view.remarks),
        inputs_section(view.inputs, [], view.recorded.versions),
    ]


def report_page(
    run: RunState,
    stage: str | Stage | None = None,
    others: Sequence[str] = (),
    *,
    sensitivities: bool = False,
    verify: bool = True,
    envelope: int = 0,
    units: Units = RACE,
    language: Language = Language.EN,
) -> str:
    """Return the report about a stage of a run that is at hand, with flights by their names beside it; arguments and
    errors are those of `report_of_flights`.
    """
    from airrace.runs.verification import with_verifications  # loads the solver

    run = with_verifications(run, [run.stage(stage).stage], verify=verify)
    view = run.stage(stage)
    flights = [view.flight(), *open_flights(others, verify=verify)]
    return _stage_page(
        run, view, flights, sensitivities=sensitivities, envelope=envelope, units=units, language=language
    )


def _stage_page(
    run: RunState,
    view: StageView,
    flights: Sequence[Flight],
    *,
    sensitivities: bool,
    envelope: int,
    units: Units,
    beside: Sequence[str] = (),
    language: Language = Language.EN,
) -> str:
    """Return the report about a stage of a run, with its flight and those beside it; `beside` are sections on them."""
    from airrace.pages.report.flight_page import flight_page
    from airrace.pages.report.sections import claim_section

    claim_text, verification = claim_of(run, view), view.verification or Verification(None)
    sections = stage_sections(view, searched_stage(run, view), sensitivities=sensitivities)
    scatter = view.safety(flights=envelope).result if envelope else None
    message = f"noted when it was solved: {view.message}" if view.message else ""
    footer = "; ".join(text for text in (f"airrace {view.versions['airrace']}", message, view.stale) if text)
    sections = [*beside, claim_section(claim_text, verification, view.stamp), *sections]
    return flight_page(flights, sections, footer, claimed=True, envelope=scatter, units=units, language=language)


def claim_of(run: RunState, view: StageView) -> str:
    """Return what is claimed of a stage of a run; empty where it does not hold."""
    results = [stage.result for stage in run.stages]
    number = [result.stage for result in results].index(view.stage)
    return claim(results[: number + 1])


def searched_stage(run: RunState, view: StageView) -> StageView:
    """Return the last stage up to this one that searched for routes; this one where none did."""
    names = [stage.name for stage in run]
    before = run.stages[: names.index(view.name) + 1]
    return next((stage for stage in reversed(before) if stage.result.search.routes), view)


def stage_sections(view: StageView, searched: StageView | None = None, *, sensitivities: bool = False) -> list[str]:
    """Return what a run knows of a stage: routes that were tried, sensitivities, certificate, inputs.

    Each is HTML, and empty where there is nothing to tell.

    Args:
        view: the stage.
        searched: the stage before it that tried routes; None for itself.
        sensitivities: whether sensitivities are computed and shown.

    Raises:
        NotCertified: sensitivities were asked for, and the stage is no certified optimum.
    """
    from airrace.pages.report.sections import certificate_section, inputs_section, search_section, sensitivities_section

    result = view.result
    solver_text = f"{result.stage.value}, {result.iterations} iterations, {result.timings.wall:.1f} s of wall time"
    return [
        search_section((searched or view).result),
        sensitivities_section(view.sensitivities() if sensitivities else None),
        certificate_section(view.certificate),
        inputs_section(view.inputs, [("stage", solver_text)], view.versions),
    ]
