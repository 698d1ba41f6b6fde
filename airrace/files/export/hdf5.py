"""HDF5: a group for every flight, with its histories and, of an optimum, mesh, phases and duals by name."""

import io
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from airrace.files.export.earth import earth_histories
from airrace.files.export.globe import stamp
from airrace.files.export.mat import variable_names
from airrace.files.export.optimum import optimum_variables
from airrace.flights.results import Flight

# h5py ships no types: what comes from it is unknown to the checker.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false


def hdf5(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return an HDF5 file with a group for every flight, named after its label.

    `histories` has all histories in SI units and radians over `time`; `passings` the names and times of passings;
    `optimum` what belongs to an optimum. Units, meanings and signs are attributes.
    """
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        for name, flight in zip(variable_names([flight.label for flight in flights]), flights, strict=True):
            group: Any = file.create_group(name)  # Any: untyped in h5py
            about = {"label": flight.label, "track": flight.course.name, "aircraft": flight.aircraft.name}
            about |= {"stage": flight.source.stage, "begin": stamp(begin, 0.0), **flight.stamp.properties()}
            for key, text in about.items():
                group.attrs[key] = text.replace("\0", " ")
            group.attrs["race_time"] = flight.race_time
            _write(group, "histories/time", flight.time, {"units": "s", "long_name": "time since the start"})
            for history_name, history in earth_histories(flight.histories).items():
                quantity = history.quantity
                meaning = {"units": quantity.unit, "long_name": quantity.text, "basis": history.basis.value}
                _write(group, f"histories/{history_name}", history.values, meaning)
            found = [crossing for crossing in flight.crossings if crossing.found]
            _write(group, "passings/name", np.array([crossing.name for crossing in found]), {})
            _write(group, "passings/time", np.array([crossing.time for crossing in found]), {"units": "s"})
            for variable in optimum_variables(flight):
                about_values = {**variable.attributes, "dimension": variable.dimension}
                _write(group, f"optimum/{variable.name}", variable.values, about_values)
    return buffer.getvalue()


def _write(group: Any, path: str, values: NDArray[Any], attributes: Mapping[str, str]) -> None:  # Any: as above
    if values.dtype.kind == "U":
        values = np.array([text.replace("\0", " ") for text in values.tolist()], dtype=h5py.string_dtype())
    dataset = group.create_dataset(path, data=values)
    for key, value in attributes.items():
        dataset.attrs[key] = value
