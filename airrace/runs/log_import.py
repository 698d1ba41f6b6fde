"""Flown logs imported: a log and a course become a flight with its passings and penalties."""

from collections.abc import Sequence
from pathlib import Path

from airrace.errors import UsageError
from airrace.inputs import Inputs, load_inputs
from airrace.inputs.log_layout import read_layout, with_columns, with_zone
from airrace.logs.log_flight import flown_flight
from airrace.logs.reading import read_log
from airrace.logs.recording import ColumnLayout
from airrace.runs.given import AircraftGiven, TrackGiven, Values, aircraft_of, document_or_path, value_texts
from airrace.runs.log_view import LogView, new_flown_log
from airrace.standard_streams import stem_of


def import_log(
    log: str | Path,
    track: TrackGiven,
    *,
    aircraft: AircraftGiven | None = None,
    set: Values = (),
    mapping: str | Path | None = None,
    columns: Sequence[str] = (),
    time_zone: str | None = None,
    noise: float | None = None,
    run: int | None = None,
    name: str | None = None,
) -> LogView:
    """Read a log of a flight, and find, smooth and judge its run through a course.

    Args:
        log: a CSV, GPX, IGC or ACMI file; the last also zipped.
        track: see `airrace.optimize`.
        aircraft: see `airrace.optimize`.
        set: single values of course and aircraft that are otherwise, see `airrace.optimize`.
        mapping: a mapping of the columns, a file of the language `airrace/log/1`.
        columns: columns on top of those of the mapping, `NAME=HEADER [UNIT]` each.
        time_zone: of times that name none, `+02:00` or `Europe/Zagreb`; None for what the mapping says, else UTC.
        noise: standard deviation of the positions, m; None to estimate it from them.
        run: which of several runs through the course, counted from 1; None for the one that passes most closely.
        name: of the aircraft of an ACMI recording that holds several.

    Raises:
        InputError: course, mapping or log are not valid, or the log does not pass the course; it names file and line.
        UsageError: an argument says nothing sensible.
    """
    named = document_or_path(track)
    if named is None:
        raise UsageError("a course is needed: a name, a file or an object")
    flown_by = document_or_path(aircraft_of(track, aircraft))
    inputs = load_inputs(named, aircraft=flown_by, overrides=value_texts(set))
    layout, known_noise = (ColumnLayout(), None) if mapping is None else read_layout(Path(mapping))
    layout = with_columns(layout, columns)
    layout = layout if time_zone is None else with_zone(layout, time_zone)
    if noise is not None and not 0.0 < noise <= 100.0:
        raise UsageError(f"a noise of {noise:g} m makes no sense: it must lie above 0 and not above 100")
    return flown_through(
        Path(log), inputs, layout=layout, noise=known_noise if noise is None else noise, run=run, name=name
    )


def flown_through(
    log: Path,
    inputs: Inputs,
    *,
    layout: ColumnLayout | None = None,
    noise: float | None = None,
    run: int | None = None,
    name: str | None = None,
) -> LogView:
    """Return a log as a flight through a course that is at hand; arguments and errors are those of `import_log`."""
    recording = read_log(log, layout, aircraft=name)
    flown = flown_flight(recording, inputs.race, label=stem_of(log), penalties=inputs.penalties, noise=noise, run=run)
    return new_flown_log(inputs, flown)
