"""MATLAB's MAT-files, level 5: one structure per flight."""

import io
import re
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from airrace.files.export.earth import earth_histories
from airrace.files.export.globe import stamp
from airrace.files.export.optimum import optimum_variables
from airrace.flights.results import Flight

NAME_LENGTH_MAX = 31


def mat(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a MAT-file with every flight as a structure named after its label.

    A structure holds `time`, the histories (SI, radians), `units` and `passings`, among others. That of an optimum has
    `optimum`: mesh, phases, costates, Hamiltonian and multipliers by name, their `units`, and what their `signs` mean.
    """
    # Imported here: no other format needs scipy. ignore: untyped in scipy.
    from scipy.io import savemat  # pyright: ignore[reportUnknownVariableType]

    names = variable_names([flight.label for flight in flights])
    file = io.BytesIO()
    content = {name: _structure(flight, begin) for name, flight in zip(names, flights, strict=True)}
    savemat(file, content, long_field_names=True, oned_as="column")
    return file.getvalue()


def _structure(flight: Flight, begin: datetime) -> dict[str, object]:
    passings = [crossing for crossing in flight.crossings if crossing.found]
    histories, variables = earth_histories(flight.histories), optimum_variables(flight)
    structure: dict[str, object] = {
        "label": flight.label,
        "track": flight.course.name,
        "aircraft": flight.aircraft.name,
        "stage": flight.source.stage,
        **flight.stamp.properties(),
        "race_time": flight.race_time,
        "begin": stamp(begin, 0.0),
        "time": flight.time,
        **{name: history.values for name, history in histories.items()},
        "units": {"time": "s"} | {name: history.quantity.unit for name, history in histories.items()},
        "passings": {
            "name": np.array([passing.name for passing in passings], object),
            "time": np.array([passing.time for passing in passings]),
        },
    }
    if variables:
        optimum: dict[str, object] = {}
        for variable in variables:
            is_text = variable.values.dtype.kind == "U"
            optimum[variable.name] = variable.values.astype(object) if is_text else variable.values
        for field, attribute in (("units", "units"), ("signs", "sign")):
            optimum[field] = {
                variable.name: variable.attributes[attribute]
                for variable in variables
                if attribute in variable.attributes
            }
        structure["optimum"] = optimum
    return structure


def variable_names(labels: Sequence[str]) -> list[str]:
    """Return names of variables: letters, digits and underscores, unique."""
    names: list[str] = []
    for number, label in enumerate(labels, start=1):
        name = re.sub(r"\W", "_", label, flags=re.ASCII)
        name = (name if name[:1].isalpha() else f"flight_{name}")[:NAME_LENGTH_MAX]
        names.append(f"{name[: NAME_LENGTH_MAX - 4]}_{number}" if name in names else name)
    return names
