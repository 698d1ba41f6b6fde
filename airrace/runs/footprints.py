"""Footprints of flights as they are asked for: of a run, a stage or a log, as objects and in files."""

from pathlib import Path

from airrace.errors import UsageError
from airrace.export.globe import BEGIN, on_globe
from airrace.results import Flight
from airrace.runs.flight_sources import origin_of
from airrace.runs.output import write_text
from airrace.safety.footprint import Footprint, Track, footprint_of
from airrace.track.course import Origin
from airrace.views.drawing import FORMATS, ensure_drawable, save_figure

GLOBE = (".geojson", ".kml")
SUFFIXES = (*GLOBE, ".csv", *FORMATS)


def flight_footprint(
    flight: Flight, drag_area: float | None, glide_ratio: float | None, output: Path | None, origin: str | None = None
) -> Footprint:
    """Return what falls where from a flight, and write it into a file unless that is None.

    Arguments and errors are those of `footprint_of`, `write_footprint` and, for the origin, `origin_of`.
    """
    place = None if origin is None else origin_of(origin)
    found = footprint_of(flight.race, [Track.of(flight)], drag_area=drag_area, glide_ratio=glide_ratio)
    if output is not None:
        write_footprint(found, flight, output, origin=place)
    return found


def ensure_footprint_file(path: Path) -> None:
    """Find out now whether a footprint can be written into a file of this name.

    Raises:
        UsageError: the name says no known format, or a drawing needs matplotlib.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise UsageError(f"cannot write a footprint into {path}; its name must end in one of {', '.join(SUFFIXES)}")
    if suffix in FORMATS:
        ensure_drawable(path)


def write_footprint(footprint: Footprint, flight: Flight, path: Path, *, origin: Origin | None = None) -> None:
    """Write a footprint, in the format that the name of the file says, replacing the file as a whole.

    Args:
        footprint: of the flight.
        flight: shown beside it.
        path: `.geojson`, `.kml`, `.csv`, `.png`, `.svg` or `.pdf`.
        origin: where the course lies; None for what it says.

    Raises:
        UsageError: there is no such format, or the course has no origin where the format needs one.
        StorageError: the system refused.
    """
    from airrace.export.footprint import footprint_csv, footprint_geojson, footprint_kml

    ensure_footprint_file(path)
    suffix = path.suffix.lower()
    if suffix in FORMATS:
        from airrace.views.footprint_figure import footprint_figure

        save_figure(footprint_figure(footprint, flight), path)
    elif suffix == ".csv":
        write_text(path, footprint_csv(footprint))
    else:
        placed = on_globe(flight, origin)
        write = footprint_geojson if suffix == ".geojson" else footprint_kml
        write_text(path, write(footprint, placed.at_rate(10.0), BEGIN).decode())
