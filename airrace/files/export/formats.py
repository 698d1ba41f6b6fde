"""The formats in which flights are exported, each with one registration: below, or by `register` in an extension."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from importlib import import_module
from typing import TYPE_CHECKING

from airrace.runtime.extensions import load_extensions

if TYPE_CHECKING:
    from airrace.flights.results import Flight

Writer = Callable[..., bytes]
"""A function of flights and the instant at which their clocks start that returns the content of a file. For a viewer
with aircraft of its own it takes the file of one as `model`."""


@dataclass(frozen=True)
class Format:
    """A format, which is also the subcommand `airrace export NAME`.

    Attributes:
        name: of the subcommand.
        help: what a file holds, in a sentence.
        writer: a function, or `module:function`, which is imported when the first file is written.
        rate_hz: samples per second unless set otherwise; None for all samples of a flight.
        globe: whether it needs latitude, longitude and altitude, and so an origin of the course.
        suffix: of its files, where that is not the name.
        has_models: whether its viewer has aircraft of its own, one of which may be named.
    """

    name: str
    help: str
    writer: Writer | str
    rate_hz: float | None = None
    globe: bool = False
    suffix: str = ""
    has_models: bool = False

    def write(self, flights: Sequence["Flight"], begin: datetime, model: str | None = None) -> bytes:
        """Return the content of a file.

        Args:
            flights: with latitudes and longitudes where `globe` says so.
            begin: the instant at which their clocks start.
            model: an aircraft of the viewer's own, where it has any; None for the default.
        """
        options = {} if model is None else {"model": model}
        if not isinstance(self.writer, str):
            return self.writer(flights, begin, **options)
        module, _, function = self.writer.partition(":")
        return getattr(import_module(module), function)(flights, begin, **options)


_formats: dict[str, Format] = {}


def register(form: Format) -> Format:
    """Add a format, and with it the subcommand `airrace export NAME`; return it.

    An extension that calls this needs nothing else: import it, or name it in `AIRRACE_EXTENSIONS`.

    Raises:
        ValueError: there is a format of this name.
    """
    if form.name in ("csv", *_formats):
        raise ValueError(f"there is an export format {form.name} already")
    _formats[form.name] = form
    return form


def formats() -> Mapping[str, Format]:
    """Return all formats by name, those of extensions included.

    Raises:
        UsageError: an extension cannot be loaded.
    """
    load_extensions()
    return _formats


_KML = "gates, people, lines, the flight path, the flight in time, and a tour behind it."
_TACVIEW = "several aircraft with attitude, airspeeds and load factors; passings are events."
for _name, _rate_hz, _help in (
    ("kml", 10.0, f"KML for Google Earth and map viewers: {_KML}"),
    ("kmz", 10.0, "KML, zipped, with a model of the aircraft."),
    ("acmi", 20.0, f"Tacview 2.2: {_TACVIEW}"),
    ("fdr", 20.0, "X-Plane's flight data recorder, version 4, with a mark at every passing; one flight."),
    ("czml", 10.0, "CZML for Cesium: the course, the flights in time, and a model of the aircraft."),
    ("gpx", 5.0, "GPX 1.1: gates and pylons as waypoints, a track for every flight."),
    ("geojson", 10.0, "GeoJSON: the course, the flight paths and their passings."),
):
    _module = "kml" if _name == "kmz" else _name
    _writer = f"airrace.files.export.{_module}:{_name}"
    register(Format(_name, _help, _writer, _rate_hz, globe=True, has_models=_name == "fdr"))
_PARQUET = "Parquet: all histories of all flights in one table (needs pyarrow)."
_NETCDF = "netCDF after the CF conventions: all histories and the duals of an optimum, with units."
register(Format("parquet", _PARQUET, "airrace.files.export.parquet:parquet"))
register(Format("netcdf", _NETCDF, "airrace.files.export.netcdf:netcdf", suffix="nc"))
register(
    Format("mat", "MATLAB: a structure for every flight, with the duals of an optimum.", "airrace.files.export.mat:mat")
)
_HDF5 = "HDF5: histories and, of an optimum, mesh, phases, costates and multipliers by name."
register(Format("hdf5", _HDF5, "airrace.files.export.hdf5:hdf5", suffix="hdf5"))
