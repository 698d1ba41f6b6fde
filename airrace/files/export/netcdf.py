"""NetCDF files, and datasets of xarray."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from airrace.files.export.csv import FlightOrigin
from airrace.files.export.earth import EARTH, earth_histories
from airrace.files.export.flight_table import FlightTable
from airrace.files.export.globe import all_histories, stamp
from airrace.files.export.optimum import optimum_variables
from airrace.flights.results import Flight
from airrace.optimal_control.trajectory import Array
from airrace.procedure.result import StageResult
from airrace.runtime.resources import extra

if TYPE_CHECKING:
    from xarray import Dataset


def netcdf(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a netCDF file of all histories in SI units and radians along the dimension `obs`, flight after flight.

    `rowSize` says how many of them belong to each flight, `flight` what it is called. A history that a flight does not
    have is NaN. Units, meanings and where values come from are attributes. What belongs to an optimum is over `node`,
    `interval`, `phase` and `limit`; where there are several flights, the names end in the flight's number, from 1.
    """
    # Imported here: no other format but MATLAB's needs scipy. ignore: untyped in scipy.
    from scipy.io import netcdf_file  # pyright: ignore[reportUnknownVariableType]

    buffer = io.BytesIO()
    file: Any = netcdf_file(buffer, "w", version=2)  # Any: untyped in scipy
    file.Conventions, file.featureType, file.source = "CF-1.11", "trajectory", "airrace"
    file.title = _text(", ".join(dict.fromkeys(flight.course.name for flight in flights)))
    file.createDimension("trajectory", len(flights))
    file.createDimension("obs", sum(len(flight.time) for flight in flights))
    _texts(file, "flight", [flight.label for flight in flights], {"cf_role": "trajectory_id", "long_name": "flight"})
    _texts(file, "track", [flight.course.name for flight in flights], {"long_name": "course of the race"})
    _texts(file, "aircraft", [flight.aircraft.name for flight in flights], {"long_name": "aircraft that flies"})
    _texts(file, "stage", [flight.source.stage for flight in flights], {"long_name": "stage of the run"})
    for name, meaning in _PROPERTIES.items():
        texts = [flight.stamp.properties()[name] for flight in flights]
        _texts(file, name, texts, {"long_name": meaning})
    size = file.createVariable("rowSize", "i", ("trajectory",))
    size[:] = np.array([len(flight.time) for flight in flights])
    size.sample_dimension, size.long_name = "obs", "number of observations of this flight"
    race_time = file.createVariable("race_time", "d", ("trajectory",))
    race_time[:] = np.array([flight.race_time for flight in flights])
    race_time.units, race_time.long_name = "s", "race time"
    time = file.createVariable("time", "d", ("obs",))
    time[:] = np.concatenate([flight.time for flight in flights])
    time.units = f"seconds since {stamp(begin, 0.0)[:-1].removesuffix('.000').replace('T', ' ')}"
    time.long_name, time.standard_name, time.axis = "time since the start", "time", "T"
    renamed = [replace(flight, histories=earth_histories(flight.histories)) for flight in flights]
    for name, history in all_histories(renamed).items():
        variable = file.createVariable(name, "d", ("obs",))
        variable[:] = np.concatenate([flight.values(name) for flight in renamed])
        variable.units, variable.long_name = history.quantity.unit, _text(history.quantity.text or name)
        variable.basis = history.basis.value
    for number, flight in enumerate(flights, start=1):
        _write_optimum(file, flight, f"_{number}" if len(flights) > 1 else "")
    file.flush()
    content = buffer.getvalue()
    file.close()
    return content


_PROPERTIES = {
    "certificate": "whether it is certified, and why not",
    "air": "air of the day",
    "pilot": "whose limits the pilot keeps to",
    "reserve": "what was asked of it in disturbances",
}


def _write_optimum(file: Any, flight: Flight, suffix: str) -> None:  # Any: untyped in scipy
    """Write mesh, phases and duals of an optimum, with a suffix to all names."""
    for variable in optimum_variables(flight):
        name, dimension, values = f"{variable.name}{suffix}", f"{variable.dimension}{suffix}", variable.values
        if dimension not in file.dimensions:
            file.createDimension(dimension, len(values))
        if values.dtype.kind == "U":
            _texts(file, name, values.tolist(), variable.attributes, dimension)
            continue
        written = file.createVariable(name, "i" if values.dtype.kind == "i" else "d", (dimension,))
        written[:] = values
        for key, value in variable.attributes.items():
            setattr(written, key, _text(value))


def _texts(
    file: Any, name: str, texts: Sequence[str], about: Mapping[str, str], dimension: str = "trajectory"
) -> None:  # Any: untyped in scipy
    """Write a variable with a row of characters for each text; the classic format knows no strings."""
    encoded = [_text(text).encode() for text in texts]
    width = max(1, *map(len, encoded))
    file.createDimension(f"{name}_length", width)
    variable = file.createVariable(name, "c", (dimension, f"{name}_length"))
    variable[:] = np.array(encoded, f"S{width}").view("S1").reshape(len(encoded), width)
    variable._Encoding = "ascii"  # by which xarray makes texts of the characters
    for key, value in about.items():
        setattr(variable, key, _text(value))


def _text(text: str) -> str:
    """Return a text in ASCII, as the classic format has its attributes."""
    return text.encode("ascii", "replace").decode()


def flight_dataset(flight: FlightTable, result: StageResult, provenance: FlightOrigin) -> "Dataset":
    """Return all states and controls over the dimension `time` (s), with `north`, `east` and `height` for x, y and z.

    `phase` is a coordinate: the leg that each time belongs to. Controls are those of the interval in which a time lies.

    Raises:
        UsageError: xarray is not installed.
    """
    xarray: Any = extra("xarray", "a dataset")  # Any: without xarray there are no types
    histories = flight.samples.histories
    variables: dict[str, tuple[str, Array, dict[str, str]]] = {}
    for quantity in flight.quantities:
        name, sign, text = EARTH.get(quantity.name, (quantity.name, 1.0, quantity.text))
        about = {"units": quantity.unit, "long_name": text or name}
        variables[name] = ("time", sign * histories[quantity.name], about)
    return xarray.Dataset(
        variables,
        coords={
            "time": ("time", flight.samples.time, {"units": "s", "long_name": "time since the start"}),
            "phase": (
                "time",
                np.array(flight.phases),
                {"long_name": "the leg, named after its passings"},
            ),
        },
        attrs=provenance.attributes(result),
    )
