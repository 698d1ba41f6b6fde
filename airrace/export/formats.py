"""The formats that flights can be written in, by the names that users give them."""

from collections.abc import Callable, Sequence
from datetime import datetime

from airrace.export.acmi import acmi
from airrace.export.czml import czml
from airrace.export.fdr import fdr
from airrace.export.geojson import geojson
from airrace.export.gpx import gpx
from airrace.export.kml import kml, kmz
from airrace.export.mat import mat
from airrace.export.netcdf import netcdf
from airrace.export.parquet import parquet
from airrace.records import record
from airrace.results import Flight


@record
class Format:
    """One format.

    Attributes:
        write: from flights and the instant at which their clocks start to the content of a file.
        rate_hz: samples per second unless somebody asks otherwise; None for all that a flight has.
        globe: whether it wants latitudes and longitudes.
        suffix: of its files, where that is not the name of the format.
    """

    write: Callable[[Sequence[Flight], datetime], bytes]
    rate_hz: float | None
    globe: bool = True
    suffix: str = ""


FORMATS = {
    "kml": Format(kml, 10.0),
    "kmz": Format(kmz, 10.0),
    "acmi": Format(acmi, 20.0),
    "fdr": Format(fdr, 20.0),
    "czml": Format(czml, 10.0),
    "gpx": Format(gpx, 5.0),
    "geojson": Format(geojson, 10.0),
    "parquet": Format(parquet, None, globe=False),
    "netcdf": Format(netcdf, None, globe=False, suffix="nc"),
    "mat": Format(mat, None, globe=False),
}
"""The formats by the names of the subcommands that write them."""
